"""Drives that lack an object, keep a value of their own or stay where they are: what is said."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import canopen
import pytest

from tautwave.errors import BusTimeout, DeviceFault
from tautwave_drivers.canopen.network import PolledNetwork
from tautwave_drivers.cia402 import objects as o
from tautwave_drivers.cia402.aborts import ABORT_CODES, NOT_NOW
from tautwave_sim.canopen.dictionary import NOT_STORED, WRONG_STATE, SdoAbort
from tests.drivers.canopen.benches import Rig, block, make, node
from tests.drivers.canopen.foreign import foreign
from tests.drivers.canopen.test_startup import quirky, refused
from tests.foreign.cia402 import ForeignDrive

FAULT_OF_HOMING = 1 << 13
PRODUCES_SYNC, PDO_OFF = 1 << 30, 1 << 31
OPERATION_ENABLED = 0x0027
NMT_START = b"\x01"
ABORT = 0x80
"""The first byte of an SDO abort."""

Change = Callable[[Any], object]


def changed(change: Change, **more: Any) -> Rig:
    rig = quirky({}, **more)
    change(rig.devices()[0].objects)
    return rig


def refusing(index: int, sub: int, code: int) -> Change:
    def refuse(value: int) -> None:
        raise SdoAbort(code)

    return lambda objects: objects.writers.update({(index, sub): refuse})


def reading(index: int, sub: int, value: int) -> Change:
    return lambda objects: objects.readers.update({(index, sub): lambda: value})


@pytest.mark.parametrize(
    ("index", "note"),
    [
        (0x6502, "has no 6502:00, so its modes are checked when it is enabled"),
        (0x6076, "has no 6076:00: rated torque 0.5 N m is not checked"),
        (0x6072, "has no 6072:00: only this program limits its torque"),
        (0x1018, "no 1018h (not checked: the rig gives no identity)"),
    ],
)
def test_what_is_not_checked_for_want_of_an_object_is_noted(index: int, note: str) -> None:
    def lack(objects: Any) -> None:
        objects.remove(index)
        objects.readers.pop((index, 0), None)

    rig = changed(lack)
    rig.open_and_enable()
    assert [text for text in rig.driver.notes if note in text], rig.driver.notes
    rows, _ = rig.run(5, 0.05)
    assert rows[-1][0].valid
    rig.driver.close()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            lambda objects: objects.set(0x1000, 0, 0x00020191),
            "is not a CiA 402 drive: 1000:00 device type is 0x00020191, .* check the node id",
        ),
        (
            reading(0x1A00, 1, 0x60400010),
            "reads 0x60400010 at 1A00:01 .* after 0x60410010 was written: its PDO mapping may be",
        ),
        (
            reading(0x6041, 0, OPERATION_ENABLED),
            "stays in OPERATION ENABLED .*after disable voltage; cut its power",
        ),
    ],
)
def test_a_drive_that_is_none_or_will_not_be_told_is_refused(change: Change, words: str) -> None:
    sentence = refused(changed(change))
    assert re.match(rf"master\.a1 \(node 1\) {words}", sentence), sentence


def _callbacks(drive: ForeignDrive) -> list[Any]:
    """What the library asks before the drive itself, of an object that is read."""
    found: list[Any] = drive.node._read_callbacks  # type: ignore[attr-defined]
    return found


@pytest.mark.parametrize("code", sorted(NOT_NOW))
def test_an_object_that_cannot_be_read_now_does_not_pass_as_absent(code: int) -> None:
    def refuse(index: int, **rest: Any) -> None:
        if index == 0x607E:
            raise canopen.SdoAbortedError(code)

    rig = foreign({(0x607E, 0): 0x80})
    _callbacks(rig.drive).insert(0, refuse)
    assert rig.refused().startswith(
        f"master.a1 (node 1) does not read 607E:00 polarity: 0x{code:08X}: {ABORT_CODES[code]}"
    )


@pytest.mark.parametrize("index", [0x607E, 0x60B2])
@pytest.mark.parametrize("code", [0x06010001, 0x08000000, 0x05040001, 0x06070010, 0xFF000001])
def test_an_object_that_is_kept_unread_does_not_pass_as_absent(index: int, code: int) -> None:
    """A polarity, or a torque beside the target, that the drive has and does not tell."""

    def refuse(**asked: Any) -> None:
        if asked["index"] == index:
            raise canopen.SdoAbortedError(code)

    rig = foreign({(0x607E, 0): 0, (0x60B2, 0): 300})
    _callbacks(rig.drive).insert(0, refuse)
    said = rig.refused()
    assert f"does not read {index:04X}:00" in said
    assert f"0x{code:08X}" in said
    assert said.endswith("; use firmware that lets it be read, or lacks it")


@pytest.mark.parametrize("code", [0x08000000, 0x06010000, 0xFF000001])
def test_a_drive_may_have_its_own_word_for_what_it_lacks(code: int) -> None:
    """It says the same of an object that no drive has."""

    rig = foreign()
    held = rig.drive.node.get_data

    def get(index: int, subindex: int, **rest: Any) -> Any:
        if (index, subindex) not in rig.drive.values:
            raise canopen.SdoAbortedError(code)
        return held(index, subindex, **rest)

    rig.drive.node.get_data = get  # type: ignore[method-assign]
    rig.enable()
    rig.driver.close()


@pytest.mark.parametrize("at", [0x6072, 0x1016, 0x60FF])
def test_a_drive_that_restarts_while_it_is_set_up_is_not_enabled(at: int) -> None:
    """It has kept its PDOs, but forgotten the limit of its torque and its watchdog."""
    rig = foreign(numbers=(1, 2))
    first, second = rig.bus.drives

    def restart(index: int, **rest: Any) -> None:
        if index == at:
            _callbacks(second).remove(restart)
            first._send(0x701, b"\x00")

    _callbacks(second).insert(0, restart)
    assert rig.refused() == (
        "master.a1 (node 1): it restarted while the drives were set up (boot-up frame), and has "
        "forgotten what was set; check its supply, then run again"
    )


@pytest.mark.parametrize("late_s", [0.25, 0.31, 0.4, 0.44])
def test_a_late_abort_is_of_the_object_that_it_names(late_s: float) -> None:
    """Polarity is read after objects that the drive lacks and aborts too late."""
    rig = foreign({(0x607E, 0): 0x80})
    free_ns = 0

    def one_by_one(can_id: int, data: bytes) -> None:
        nonlocal free_ns
        taken_s = late_s if data[0] == ABORT else 1e-3
        free_ns = max(free_ns, rig.bus.now_ns) + round(taken_s * 1e9)
        rig.bus._push(free_ns, False, can_id, data)

    rig.drive.network._out = one_by_one
    remote = PolledNetwork(rig.bus, rig.clock, lambda *_: None, 0.3).remote(1, "drive")
    for lacking in (o.POSITION_FACTOR, o.GEAR_MOTOR):
        assert remote.find(lacking) is None
        assert remote.find(o.POLARITY) == 0x80
        assert remote.find(o.RATED_TORQUE) == 500
        remote.write(o.MODE, 10)


def test_a_drive_that_produces_sync_stops_or_is_refused() -> None:
    def produce(objects: Any) -> None:
        objects.set(0x1005, 0, PRODUCES_SYNC | 0x80)

    rig = changed(produce)
    rig.driver.open()
    assert rig.devices()[0].objects.number(0x1005) == 0x80
    assert any("1005:00 SYNC COB-ID = 128" in note for note in rig.driver.notes), rig.driver.notes
    rig.driver.close()
    rig = changed(produce)
    refusing(0x1005, 0, WRONG_STATE)(rig.devices()[0].objects)
    assert refused(rig).endswith("; two masters would send SYNC")


def test_pdos_that_somebody_left_on_are_switched_off_or_named() -> None:
    def left(objects: Any) -> None:
        objects.set(0x1401, 1, 0x301)
        objects.set(0x1802, 1, 0x381)

    rig = changed(left)
    rig.driver.open()
    assert "master.a1 (node 1): switched off RPDO2, TPDO3" in rig.driver.notes
    for index in (0x1401, 0x1802):
        assert rig.devices()[0].objects.number(index, 1) & PDO_OFF
    rig.driver.close()
    rig = changed(left)
    refusing(0x1401, 1, WRONG_STATE)(rig.devices()[0].objects)
    rig.driver.open()
    assert any("RPDO2 stays on: " in note for note in rig.driver.notes), rig.driver.notes
    rig.driver.close()


def test_settings_that_a_drive_does_not_store_are_in_force_all_the_same() -> None:
    rig = changed(refusing(0x1010, 1, NOT_STORED), configure=True)
    rig.open_and_enable()
    assert any("does not store its settings: " in note for note in rig.driver.notes)
    assert not any("settings stored" in note for note in rig.driver.notes)
    rig.driver.close()


def test_a_node_that_does_not_become_operational_is_named_with_its_state() -> None:
    rig = quirky({})
    device = rig.devices()[0]
    take = device.receive

    def deaf_to_start(now_ns: int, can_id: int, data: bytes) -> None:
        if (can_id, data[:1]) != (0, NMT_START):
            take(now_ns, can_id, data)

    device.receive = deaf_to_start
    sentence = refused(rig, BusTimeout)
    assert "not NMT operational 1 s after NMT start: master.a1 (node 1) shows pre-op" in sentence


def test_a_drive_without_tpdo_on_sync_is_named_before_it_is_enabled() -> None:
    rig = make(block(node(1), simulator={"faults": {"sync_lost": 1.0}}), ("impedance",))
    assert "sends no TPDO1 (0x181) on SYNC although it is operational" in refused(rig, BusTimeout)


def test_a_drive_too_slow_for_its_share_of_the_period_is_named() -> None:
    sentence = refused(quirky({}, answer_share=0.1), BusTimeout)
    found = re.search(r"responds to SYNC after (\d+) us at best, but only 100 us of a", sentence)
    assert found, sentence
    assert int(found[1]) > 100


def test_a_drive_that_fails_to_home_ends_it_with_its_method() -> None:
    rig = quirky({}, first={"homing": {"method": 35}})
    rig.driver.open()
    device = rig.devices()[0]
    shown = device.objects.readers[0x6041, 0]

    def failing() -> int:
        word = int(shown())
        on = word & 0x6F == OPERATION_ENABLED and device.drive.mode == 6
        return word | FAULT_OF_HOMING if on else word

    device.objects.readers[0x6041, 0] = failing
    with pytest.raises(DeviceFault, match=r"homing error \(statusword bit 13\), method 35"):
        rig.enable(3000)
    rig.driver.close()
