"""Everything that goes wrong while running ends in its defined reaction; every case has a seed."""

from __future__ import annotations

import math
from typing import Any

import pytest

from tautwave.types import AxisCommand, Fault
from tests.drivers.canopen.benches import Rig, block, make, node

SEED = 7
TORQUE = 0.05
AT_S = 0.05
CYCLES = 200
ENABLED, DISABLE_VOLTAGE = 0x0F, 0x00


def with_faults(*events: dict[str, Any], quirks: Any = None, **more: Any) -> dict[str, Any]:
    probabilities = {key: more.pop(key) for key in list(more) if key in PROBABILITIES}
    simulator: dict[str, Any] = {"faults": {"seed": SEED, "events": list(events), **probabilities}}
    if quirks is not None:
        simulator["nodes"] = {"2": quirks}
    return block(node(1), node(2), simulator=simulator, **more)


PROBABILITIES = (
    "lost",
    "delayed",
    "duplicated",
    "corrupted",
    "error_frame",
    "sync_lost",
    "delay_s",
)


def started(options: dict[str, Any]) -> Rig:
    rig = make(options, mass=0.1)
    rig.open_and_enable()
    return rig


def until_fatal(rig: Rig, cycles: int = CYCLES) -> tuple[list[Fault], int]:
    """Run until a fatal fault; return all faults, and where in the log that cycle began."""
    told: list[Fault] = []
    for _ in range(cycles):
        at = len(rig.sent)
        rig.cycle(TORQUE)
        told += rig.driver.faults()
        if any(fault.fatal for fault in told):
            return told, at
    raise AssertionError(f"nothing fatal was told: {told}")


def zero_from_now_on(rig: Rig, axis: int, at: int) -> None:
    """The axis is told zero and no longer enabled, from the cycle of the fault on."""
    rig.run(5, TORQUE)
    commands = rig.commands(axis, at)
    assert commands
    assert all(target == 0 and word & 0x0F != ENABLED for word, target in commands)


def leave(rig: Rig) -> None:
    rig.driver.close()
    assert all(device.drive.motor.torque_counts == 0 for device in rig.devices())


DRIVE_FAULTS = {
    "heartbeat lost": ({"heartbeat_lost_at_s": AT_S}, "heartbeat lost: none for"),
    "reset": ({"resets_at_s": AT_S}, "reset behind our back"),
    "fault": ({"fault_at_s": AT_S, "fault_code": 0x2310}, "continuous overcurrent on the motor"),
    "emergency": ({"emergency_at_s": AT_S, "fault_code": 0x4310}, "EMCY 0x4310: drive too hot"),
    "mode lost": ({"mode_lost_at_s": AT_S}, "left CST cyclic synchronous torque for no mode"),
    "voltage": ({"voltage_off_at_s": AT_S}, "left OPERATION ENABLED by itself"),
    "silent": ({"silent_at_s": AT_S}, "heartbeat lost"),
}


@pytest.mark.parametrize(("quirks", "words"), DRIVE_FAULTS.values(), ids=list(DRIVE_FAULTS))
def test_what_befalls_a_drive_stops_that_axis_in_the_same_cycle(
    quirks: dict[str, Any], words: str
) -> None:
    rig = started(with_faults(quirks=quirks))
    rig.run(20, TORQUE)
    assert rig.commands(1)[-1][1] == 100  # 0.05 of 0.5 N m, per mille
    told, at = until_fatal(rig)
    fatal = [fault for fault in told if fault.fatal]
    assert words in fatal[0].text
    assert {fault.axis for fault in fatal} == {"master.a2"}
    zero_from_now_on(rig, 1, at)
    states = rig.cycle(TORQUE)
    assert states[0].valid  # the other axis lives on
    assert rig.commands(0)[-1] == (ENABLED, 100)
    leave(rig)


def test_a_mode_that_is_only_polled_is_missed_by_bit_12_at_once() -> None:
    options = with_faults(quirks={"mode_lost_at_s": AT_S})
    options["nodes"][1]["mapping"] = "lean"
    rig = started(options)
    told: list[Fault] = []
    for _ in range(CYCLES):
        rig.cycle(TORQUE)
        told += rig.driver.faults()
        if told:
            break
    assert "no longer follows the command (bit 12)" in told[0].text
    told, at = until_fatal(rig)
    assert "left CST cyclic synchronous torque" in told[-1].text
    zero_from_now_on(rig, 1, at)
    leave(rig)


def test_a_tolerated_emergency_is_told_and_stops_nothing() -> None:
    quirks = {"emergency_at_s": AT_S, "fault_code": 0x4310}
    rig = started(with_faults(quirks=quirks, tolerated_emergencies=[0x4310]))
    rows, told = rig.run(CYCLES, TORQUE)
    assert any("EMCY 0x4310" in fault.text for fault in told)
    assert not any(fault.fatal for fault in told)
    assert all(state.valid for state in rows[-1])
    leave(rig)


def test_a_lost_tpdo_costs_that_axis_and_that_cycle_only() -> None:
    rig = started(with_faults({"kind": "lost", "at_s": AT_S, "can_id": 0x182}))
    rows, told = rig.run(CYCLES, TORQUE)
    assert [state.valid for row in rows for state in row[:1]] == [True] * CYCLES
    missing = [at for at, row in enumerate(rows) if not row[1].valid]
    assert len(missing) == 1
    assert missing[0] == pytest.approx(AT_S * 1e3, abs=2)
    assert rows[missing[0]][1].age_ns > 1_000_000
    assert not told
    leave(rig)


def test_one_lost_tpdo_after_a_long_peace_is_no_silence() -> None:
    rig = started(with_faults({"kind": "lost", "at_s": 0.6, "can_id": 0x182}))
    rows, told = rig.run(700)  # more cycles than a silent drive is waited for
    assert sum(not row[1].valid for row in rows) == 1
    assert not told
    assert not rig.driver.notes[-1].startswith("master.a2 (node 2): TPDOs")
    leave(rig)
    assert "master.a2 (node 2): TPDOs 1 missing" in rig.driver.notes


@pytest.mark.parametrize("kind", ["lost", "sync_lost"])
def test_a_lost_sync_costs_one_cycle(kind: str) -> None:
    rig = started(with_faults({"kind": kind, "at_s": AT_S, "can_id": 0x80}))
    rows, _ = rig.run(CYCLES, TORQUE)
    missing = [at for at, row in enumerate(rows) if not all(state.valid for state in row)]
    assert len(missing) == 1
    leave(rig)


def compare_positions(rows: list[list[Any]], expected: list[list[Any]]) -> None:
    """Valid samples are those of a run in which nothing is late."""
    for row, right in zip(rows, expected, strict=True):
        for state, wanted in zip(row, right, strict=True):
            assert not state.valid or state.position == wanted.position


@pytest.mark.parametrize("delay_s", [0.3e-3, 0.9e-3, 1.05e-3, 1.4e-3, 2.0e-3, 2.05e-3])
def test_a_delayed_tpdo_is_never_taken_for_a_new_one(delay_s: float) -> None:
    late = started(with_faults({"kind": "delayed", "at_s": AT_S, "can_id": 0x182}, delay_s=delay_s))
    plain = started(with_faults())
    rows, _ = late.run(100, TORQUE)
    compare_positions(rows, plain.run(100, TORQUE)[0])
    assert sum(not row[1].valid for row in rows) <= 3
    assert all(state.valid for state in rows[-1])
    leave(late)
    leave(plain)


@pytest.mark.parametrize("delay_s", [1.1e-3, 1.4e-3, 2.0e-3, 2.3e-3, 3.0e-3, 4.05e-3])
def test_when_every_tpdo_is_late_from_now_on_none_is_taken_for_a_new_one(delay_s: float) -> None:
    event = {"kind": "delayed", "at_s": AT_S, "can_id": 0x182, "times": 100_000}
    late, plain = started(with_faults(event, delay_s=delay_s)), started(with_faults())
    rows, _ = late.run(120, TORQUE)
    compare_positions(rows, plain.run(120, TORQUE)[0])
    assert not any(row[1].valid for row in rows[60:])
    others = [row[0].valid for row in rows[60:]]
    assert sum(others) >= 0.85 * len(others)  # a cycle without SYNC now and then, to find out
    late.driver.close()
    leave(plain)


@pytest.mark.parametrize("times", [2, 3, 5])
def test_after_several_lost_tpdos_an_axis_comes_back(times: int) -> None:
    event = {"kind": "lost", "at_s": AT_S, "can_id": 0x182, "times": times}
    rig, plain = started(with_faults(event)), started(with_faults())
    rows, _ = rig.run(100, TORQUE)
    compare_positions(rows, plain.run(100, TORQUE)[0])
    assert times <= sum(not row[1].valid for row in rows) <= times + 3
    assert sum(not row[0].valid for row in rows) <= 1
    assert all(state.valid for state in rows[-1])
    leave(rig)
    leave(plain)


@pytest.mark.parametrize("delay_s", [0.1e-3, 0.2e-3])
def test_a_lost_tpdo_on_a_bus_that_has_become_slower_is_got_over(delay_s: float) -> None:
    lost = {"kind": "lost", "at_s": AT_S, "can_id": 0x182}
    slow = {"kind": "delayed", "at_s": AT_S, "can_id": 0x182, "times": 100_000}
    rig, plain = started(with_faults(lost, slow, delay_s=delay_s)), started(with_faults())
    rows, told = rig.run(100, TORQUE)
    compare_positions(rows, plain.run(100, TORQUE)[0])
    assert 1 <= sum(not row[1].valid for row in rows) <= 4
    assert all(state.valid for state in rows[-1])
    assert not any(fault.fatal for fault in told)
    leave(rig)
    leave(plain)


def in_peace_then(**faults: float) -> Rig:
    """A rig that was brought up before anything goes wrong."""
    rig = started(with_faults())
    storm = make(with_faults(**faults), mass=0.1).world.world.plan
    rig.world.world.plan.__dict__.update(storm.__dict__)
    return rig


def test_one_frame_of_ten_may_be_lost_at_random() -> None:
    rig = in_peace_then(lost=0.1)
    rows, told = rig.run(1000, TORQUE)
    assert not any(fault.fatal for fault in told)
    for axis in (0, 1):
        missing = "".join(" " if row[axis].valid else "x" for row in rows)
        assert 0.15 < missing.count("x") / len(rows) < 0.35  # SYNC or TPDO are lost in 0.19
        assert max(map(len, missing.split())) < 15
    rig.driver.close()


@pytest.mark.parametrize("kind", ["lost", "delayed", "duplicated", "corrupted", "error_frame"])
def test_a_seeded_storm_never_raises_and_repeats_itself(kind: str) -> None:
    def run() -> list[Any]:
        rig = in_peace_then(**{kind: 0.05})
        rows, told = rig.run(CYCLES, TORQUE)
        rig.driver.close()
        return [rows, [fault.text for fault in told]]

    one, other = run(), run()
    assert str(one) == str(other)
    lost = sum(not state.valid for row in one[0] for state in row)
    if kind == "lost":
        assert lost > 0


def test_bring_up_survives_lost_frames() -> None:
    rig = make(with_faults(lost=0.03), mass=0.1)
    rig.driver.open()
    assert any("answers SYNC" in note for note in rig.driver.notes)
    assert rig.clock.now_ns() > 600_000_000  # it waited for more than one answer in vain
    rig.driver.close()


def test_a_queue_that_is_full_for_a_while_is_congested() -> None:
    rig = started(with_faults({"kind": "queue_full", "at_s": AT_S, "duration_s": 0.004}))
    rig.run(round(AT_S * 1e3) - 2, TORQUE)
    told: list[Fault] = []
    at = len(rig.sent)
    for _ in range(20):
        rig.cycle(TORQUE)
        told += rig.driver.faults()
    assert [fault.fatal for fault in told] == [False]
    assert "congested" in told[0].text
    # What was held back is not sent later: first zero for both, then SYNC, then the present.
    log = [(can_id, data) for _, can_id, data in rig.sent[at:]]
    syncs = [place for place, (can_id, _) in enumerate(log) if can_id == 0x80]
    first = [
        place for place in syncs if log[place - 1][0] == 0x202 and not any(log[place - 1][1][2:4])
    ]
    assert first, log
    rows, _ = rig.run(5, TORQUE)
    assert all(state.valid for state in rows[-1])
    assert rig.commands(0)[-1][1] == 100
    leave(rig)


def test_a_queue_that_drains_within_a_cycle_still_gets_no_command_in_it() -> None:
    rig = started(with_faults())
    rig.run(10, TORQUE)
    begin, at = rig.clock.now_ns(), len(rig.sent)
    rig.port.full = True
    rig.driver.request()
    rig.port.full = False
    assert not any(state.valid for state in rig.driver.read(begin + 700_000))
    rig.driver.write([AxisCommand(TORQUE, 0.0)] * 2)
    assert not rig.commands(0, at)
    rig.clock.sleep_until(begin + 1_000_000)
    rig.run(3, TORQUE)
    assert [target for _, target in rig.commands(0, at)][:2] == [0, 100]
    leave(rig)


def test_a_full_queue_and_silence_is_a_dead_bus() -> None:
    rig = started(with_faults({"kind": "queue_full", "at_s": AT_S}))
    rig.run(round(AT_S * 1e3), TORQUE)
    for device in rig.devices():
        device.beats = False
    told, _ = until_fatal(rig)
    assert "dead bus: the transmit queue is full for" in told[0].text
    rows, _ = rig.run(3, TORQUE)
    assert not any(state.valid for row in rows for state in row)
    rig.driver.close()


@pytest.mark.parametrize(("kind", "words"), [("bus_off", "bus-off"), ("bus_down", "gone or down")])
def test_a_bus_that_goes_away_stops_every_axis(kind: str, words: str) -> None:
    rig = started(with_faults({"kind": kind, "at_s": AT_S}))
    told, _ = until_fatal(rig)
    assert words in next(fault for fault in told if fault.fatal).text
    rows, _ = rig.run(5, TORQUE)
    assert not any(state.valid for row in rows for state in row)
    rig.driver.close()
    rig.driver.close()
    # the drives' own watchdog has taken the torque away
    rig.world.advance(rig.clock.now_ns() + 200_000_000)
    assert all(device.drive.motor.torque_counts == 0 for device in rig.devices())


def test_error_frames_in_words() -> None:
    rig = started(with_faults())
    rig.port.injected.append((0x20000004, bytes([0, 0x20, 0, 0, 0, 0, 0, 0])))
    _, told = rig.run(2, TORQUE)
    assert "error passive (transmitting)" in told[0].text
    assert not told[0].fatal
    rig.port.injected.append((0x20000040, bytes(8)))
    told, _ = until_fatal(rig, 3)
    assert "bus-off: the controller has left the bus" in told[0].text
    rig.driver.close()


@pytest.mark.parametrize("can_id", [0x181, 0x081, 0x701, 0x581, 0x000, 0x7FF, 0x20000000, 0x1])
@pytest.mark.parametrize("size", range(9))
def test_no_bytes_raise(can_id: int, size: int) -> None:
    rig = started(block(node(1, mapping="lean"), node(2)))
    for value in (0x00, 0xFF, 0x61):
        rig.port.injected.append((can_id, bytes([value] * size)))
        rig.run(2, TORQUE)
    rig.driver.close()


def test_a_node_that_another_master_stops_is_told() -> None:
    rig = started(with_faults())
    rig.run(5, TORQUE)
    rig.world.transport.send(0, bytes((0x02, 2)))
    told, at = until_fatal(rig)
    assert "left NMT operational for stopped" in told[0].text
    zero_from_now_on(rig, 1, at)
    rig.driver.close()


def test_a_drive_that_no_command_reaches_is_switched_off_before_its_watchdog_is() -> None:
    gone = {"kind": "lost", "can_id": 0x202, "times": 10**6, "at_s": AT_S}
    rig = started(with_faults(gone, quirks={"rpdo_timer": "no_object"}))
    rig.run(CYCLES, TORQUE)
    motor = rig.devices()[1].drive.motor
    assert motor.torque_counts == 100  # the last command that arrived; heartbeats still do
    disarming = bytes.fromhex("2316100100000000")
    seen: list[int] = []
    send = rig.port.send

    def spy(can_id: int, data: bytes) -> bool:
        if (can_id, data) == (0x602, disarming):
            seen.append(motor.torque_counts)
        return send(can_id, data)

    rig.driver._exchange.port.send = spy  # type: ignore[union-attr,method-assign]
    leave(rig)
    assert seen == [0]


def test_a_drive_that_is_not_seen_to_be_off_keeps_its_watchdog() -> None:
    gone = [{"kind": "lost", "can_id": at, "times": 10**6, "at_s": AT_S} for at in (0x202, 0x602)]
    rig = started(with_faults(*gone, quirks={"rpdo_timer": "no_object"}))
    rig.run(CYCLES, TORQUE)
    at = len(rig.sent)
    rig.driver.close()
    assert "master.a2 (node 2) is left with its watchdogs armed" in " ".join(rig.driver.notes)
    told = [data for _, can_id, data in rig.sent[at:] if can_id == 0]
    assert told == [bytes((0x80, 1))]  # node 2 is not taken to where it may watch nobody
    rig.world.advance(rig.clock.now_ns() + 200_000_000)
    assert all(device.drive.motor.torque_counts == 0 for device in rig.devices())


def test_a_drive_watches_its_master_from_the_moment_it_is_enabled() -> None:
    beats = {"heartbeat_ms": 200, "heartbeat_timeout_ms": 400}
    options = with_faults({"kind": "bus_off", "at_s": 0.01}, quirks={"rpdo_timer": "no_object"})
    rig = started(options | beats)
    rig.run(20, TORQUE)
    assert rig.devices()[1].drive.motor.torque_counts == 100  # no command reaches it any more
    rig.driver.close()
    rig.world.advance(rig.clock.now_ns() + 500_000_000)
    assert all(device.drive.motor.torque_counts == 0 for device in rig.devices())


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("causality", ["impedance", "admittance"])
def test_what_is_no_finite_command_is_zero(value: float, causality: str) -> None:
    rig = make(causality=(causality, causality))
    rig.open_and_enable()
    rig.cycle(TORQUE, TORQUE)
    assert rig.commands(0)[-1][1] != 0
    rig.cycle(value, value)
    assert rig.commands(0)[-1][1] == 0
    leave(rig)
