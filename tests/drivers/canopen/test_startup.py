"""Refusals before anything is enabled, and the way to the start: homing, moving, enabling."""

from __future__ import annotations

from typing import Any

import pytest

from tautwave.config.keys.calibration import AxisCalibration
from tautwave.errors import BusTimeout, DeviceFault, DriverError
from tautwave.rig.calibrated import CalibratedDriver, identities
from tautwave_sim.canopen.dictionary import Entry
from tests.drivers.canopen.benches import Rig, block, make, node

NMT_OPERATIONAL, NMT_PRE_OPERATIONAL = 5, 127


def quirky(quirks: dict[str, Any], *, first: dict[str, Any] | None = None, **more: Any) -> Rig:
    bus = {key: more.pop(key) for key in ("allow_unwatched", "configure") if key in more}
    options = block(node(1, **(first or {})), simulator={"nodes": {"1": quirks}}, **more)
    return make(options, ("impedance",), mass=0.1, **bus)


def refused(rig: Rig, error: type[DriverError] = DeviceFault) -> str:
    with pytest.raises(error) as reported:
        rig.driver.open()
    rig.driver.close()
    for device in rig.devices():
        assert device.drive.motor.torque_counts == 0
    return str(reported.value)


IDENTITY = {"vendor": 0xFB, "product": 0x10}


@pytest.mark.parametrize(
    ("quirks", "first", "words"),
    [
        (
            {"identity": 0x99},
            {"identity": IDENTITY},
            "is a different device: 1018:02 product code is 0x99, but the rig expects 0x10",
        ),
        (
            {"lacks_modes": [10]},
            {},
            "does not support CST cyclic synchronous torque, which an impedance",
        ),
        (
            {"lacks_modes": [6]},
            {"homing": {"method": 35}},
            "does not support HM homing, which homing needs",
        ),
        (
            {"heartbeat_consumer": False, "rpdo_timer": "no_subindex"},
            {},
            "would keep following its last command if this program stops "
            "sending: .* has no 1016:01 "
            r"consumer heartbeat \(0x06020000: object does not exist\); .* has no 1400:05 deadline "
            r"timer \(0x06090011: sub-index does not exist\); use a drive",
        ),
        ({"abort_option": False}, {}, "has no 6007:00 abort connection option.*--allow-unwatched"),
        (
            {"least_heartbeat_ms": 100, "rpdo_timer": "no_object"},
            {},
            "1016:01 consumer heartbeat stays none: .*0x06090032: value too low",
        ),
        (
            {"ignores_heartbeat_consumer": True, "rpdo_timer": "no_object"},
            {},
            "1016:01 consumer heartbeat is",
        ),
    ],
)
def test_a_drive_that_cannot_do_it_is_named_with_object_and_remedy(
    quirks: dict[str, Any], first: dict[str, Any], words: str
) -> None:
    import re

    sentence = refused(quirky(quirks, first=first))
    assert sentence.startswith("master.a1 (node 1)")
    assert re.search(words, sentence), sentence


def test_one_watchdog_is_enough() -> None:
    for quirks in ({"heartbeat_consumer": False}, {"rpdo_timer": "no_object"}):
        rig = quirky(quirks)
        rig.open_and_enable()
        rig.driver.close()


def test_an_unwatched_drive_is_allowed_and_loud() -> None:
    rig = quirky({"abort_option": False}, allow_unwatched=True)
    rig.open_and_enable()
    ((axis, does),) = rig.driver.unwatched.items()
    assert axis == "master.a1"
    assert does.startswith("(node 1) keeps following its last command: ")
    assert "6007:00" in does
    assert axis not in rig.driver.watchdog_s
    rig.driver.close()
    assert rig.driver.unconfirmed == {}


@pytest.mark.parametrize(
    ("first", "objects", "words"),
    [
        ({}, {(0x6076, 0): 700}, "6076:00 motor rated torque is 700.* the rig states 0.5 N m"),
        ({}, {(0x6091, 1): 7}, "6091:01 .* is 7.* give 585.143 position units per motor turn"),
        ({}, {(0x6092, 1): 36000}, "36000 position units per motor turn, but the rig states 4096"),
        ({}, {(0x608F, 1): 1024}, "only 1024 increments per motor turn for the 4096 position"),
        ({}, {(0x6072, 0): 500}, "6072:00 max torque is 500.* is 0.25, below .*effort_limit"),
    ],
)
def test_scales_and_limits_are_compared_with_the_rig(
    first: dict[str, Any], objects: dict[tuple[int, int], int], words: str
) -> None:
    import re

    rig = quirky({}, first=first)
    for (index, sub), value in objects.items():
        rig.devices()[0].objects.set(index, sub, value)
    sentence = refused(rig)
    assert re.search(words, sentence), sentence


def test_a_node_that_is_not_there_is_named_with_its_bus() -> None:
    rig = quirky({})
    rig.devices()[0].silent = True
    assert "master.a1 (node 1) does not respond (read 1000:00" in refused(rig, BusTimeout)


def test_60c2_is_set_to_the_period_of_the_rig() -> None:
    rig = make(block(node(1)), ("impedance",), rate_hz=400.0)
    rig.driver.open()
    objects = rig.devices()[0].objects
    assert (objects.number(0x60C2, 1), objects.number(0x60C2, 2)) == (25, -4)
    rig.driver.close()


def test_1006_follows_the_period_of_the_rig_only_where_it_is_in_use() -> None:
    for before, after in ((2000, 2500), (0, 0)):
        rig = make(block(node(1)), ("impedance",), rate_hz=400.0)
        objects = rig.devices()[0].objects
        objects.set(0x1006, 0, before)
        rig.driver.open()
        said = [note for note in rig.driver.notes if "1006:00 SYNC" in note]
        assert objects.number(0x1006) == after
        text = "master.a1 (node 1): 1006:00 SYNC period = 2500 us (was 2000 us), read back"
        assert said == [text] * (before > 0)
        rig.driver.close()


def test_a_period_that_60c2_cannot_hold_is_refused() -> None:
    rig = make(block(node(1)), ("impedance",), rate_hz=1024.0)
    assert "cannot be represented in 60C2h" in refused(rig)
    lacking = block(node(1), simulator={"nodes": {1: {"interpolation_period": False}}})
    rig = make(lacking, ("impedance",), rate_hz=600.0)
    rig.driver.open()
    assert any("has no 60C2:01" in note for note in rig.driver.notes)
    rig.driver.close()


def test_everything_written_is_read_back_and_reported() -> None:
    rig = quirky({}, first={"identity": {"vendor": 0, "product": 0}})
    rig.driver.open()
    notes = "\n".join(rig.driver.notes)
    for words in (
        "(as the rig says)",
        "1017:00 producer heartbeat = 20 ms (was 0 ms), read back",
        "1016:01 consumer heartbeat = node 127 within 60 ms (was none), read back",
        "1400:05 deadline timer = 60 ms (was 0 ms), read back",
        "6007:00 abort connection option = 2 (was 1), read back",
        "6072:00 max torque = 2000 per mille (was 3000 per mille), read back",
        "TPDO1 0x181 on every SYNC: 6041 statusword, 6064 position actual value, 6061",
        "RPDO1 0x201 on every SYNC: 6040 controlword, 6071 target torque, 6060",
        "torque off, SWITCH ON DISABLED",
    ):
        assert words in notes
    assert rig.devices()[0].nmt == NMT_OPERATIONAL
    rig.driver.close()
    assert rig.devices()[0].nmt == NMT_PRE_OPERATIONAL
    assert rig.devices()[0].objects.number(0x1016, 1) == 0  # disarmed: nobody feeds it now
    # given back: else the next rig, with a higher effort_limit, would be refused
    assert rig.devices()[0].objects.number(0x6072, 0) == 3000


def test_lasting_settings_are_stored_only_when_asked_for() -> None:
    for configure in (False, True):
        rig = quirky({}, configure=configure)
        rig.driver.open()
        stored = any("settings stored (1010:01)" in note for note in rig.driver.notes)
        assert stored == configure
        text = "master.a1 (node 1): set until its power is off: 1017:00, 6007:00, "
        assert stored != any(note.startswith(text) for note in rig.driver.notes)
        written = [
            data for _, can_id, data in rig.sent if can_id == 0x601 and data[1:3] == b"\x10\x10"
        ]
        assert bool(written) == configure
        rig.driver.close()


@pytest.mark.parametrize(
    "quirks",
    [
        {"starts_in_fault": True},
        {"starts_in_fault": True, "fault_resets": 2},
        {"transition_ms": 20},
        {"mode_switch_ms": 30},
    ],
    ids=["fault", "two resets", "slow", "slow mode"],
)
@pytest.mark.parametrize("mapping", ["lean", "full"])
def test_difficult_drives_are_enabled_all_the_same(quirks: dict[str, Any], mapping: str) -> None:
    rig = quirky(quirks, first={"mapping": mapping})
    rig.open_and_enable()
    rows, reported = rig.run(20, 0.05)
    assert all(state.valid for state in rows[-1])
    assert not any(fault.fatal for fault in reported)
    rig.driver.close()


def test_a_drive_that_refuses_its_mode_is_reported_while_enabling() -> None:
    rig = quirky({"refuses_modes": [10]})
    rig.driver.open()
    with pytest.raises(DeviceFault, match="CST cyclic synchronous torque is requested in 6060h"):
        rig.enable(5000)
    rig.driver.close()


def test_a_drive_left_enabled_by_somebody_is_switched_off_before_anything_is_written() -> None:
    rig = quirky({})
    rig.open_and_enable()
    rig.run(10, 0.05)
    assert rig.devices()[0].drive.motor.torque_counts != 0
    again = rig.driver
    again.detach()  # the program died; a new one comes before the watchdog
    rig.driver.open()
    assert rig.devices()[0].drive.motor.torque_counts == 0
    writes = [
        data[1:3] for _, can_id, data in rig.sent if can_id == 0x601 and data[0] & 0xF0 == 0x20
    ]
    assert b"\x40\x60" in writes
    rig.driver.close()


def test_homing_and_moving_to_the_start_come_first() -> None:
    for mode in ("csp", "pv"):
        first = {
            "homing": {"method": 35},
            "move": {"position": 0.05, "velocity": 0.5, "mode": mode},
        }
        rig = quirky({}, first=first)
        rig.driver.open()
        rig.enable(5000)
        rig.cycle()
        rows, _ = rig.run(3)
        assert rows[0][0].position == pytest.approx(0.05, abs=0.01), mode
        assert rig.devices()[0].drive.mode == 10
        rig.driver.close()


def test_a_move_that_takes_too_long_is_reported() -> None:
    move = {"position": 100.0, "velocity": 0.1, "timeout_s": 0.2}
    rig = quirky({}, first={"move": move})
    rig.driver.open()
    with pytest.raises(BusTimeout, match=r"moving to 100 took more than 0\.2 s"):
        rig.enable(3000)
    rig.driver.close()


def test_homing_by_a_method_that_the_drive_has_not_is_refused() -> None:
    sentence = refused(quirky({}, first={"homing": {"method": 17}}))
    assert "6098:00 homing method" in sentence


RPM, TENTH_RPM, INCREMENTS = 0x00B44700, 0xFFB44700, 0x00B50300


@pytest.mark.parametrize(
    ("word", "gear", "factor", "refusal"),
    [
        (RPM, 1.0, 4096 / 60, ""),
        (RPM, 50.0, 4096 / 60, ""),  # of the motor
        (RPM, 50.0, 50 * 4096 / 60, ""),  # of the gear's output
        (TENTH_RPM, 1.0, 4096 / 600, ""),
        (INCREMENTS, 1.0, 1.0, ""),
        (INCREMENTS, 1.0, 7.0, "one unit is 1 counts/s, but the rig states velocity_factor 7;"),
        (RPM, 1.0, 1.0, "one unit is 68.2667 counts/s, but the rig states velocity_factor 1;"),
        (RPM, 50.0, 1.0, "one unit is 68.2667 or 3413.33 counts/s"),
    ],
)
def test_the_unit_of_velocity_is_held_against_the_drive_s(
    word: int, gear: float, factor: float, refusal: str
) -> None:
    given = node(1, gear_ratio=gear, velocity_factor=factor, rated_torque=0.02)
    rig = make(block(given), ("admittance",))
    rig.devices()[0].objects.add(0x60A9, 0, Entry("U32", "rw", word))
    if refusal:
        assert refusal in refused(rig)
        return
    rig.driver.open()
    rig.driver.close()
    assert any("60A9 velocity unit" in note for note in rig.driver.notes)


def test_a_drive_with_other_firmware_or_another_zero_is_not_the_one_that_was_calibrated() -> None:
    rig = quirky({})
    rig.driver.open()
    (said,) = identities(rig.driver).values()
    assert said["software"] == "1"
    assert said["home_offset"] == "0"
    rig.driver.close()
    rig = quirky({}, first={"home_offset": -500})
    known = CalibratedDriver(rig.driver, ["master.a1"], [AxisCalibration(device=dict(said))])
    objects = rig.devices()[0].objects
    objects.set(0x607C, 0, -500)
    objects.add(0x100A, 0, Entry("STR", "const", b"2.0"))
    with pytest.raises(DriverError, match=r"home_offset was 0, now -500") as reported:
        known.open()
    assert "software was 1, now 2.0" in str(reported.value)
    objects.remove(0x100A)
    objects.remove(0x607C)
    rig.driver.open()
    assert not {"software", "home_offset"} & identities(rig.driver)["master.a1"].keys()
    rig.driver.close()
