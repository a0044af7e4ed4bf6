"""Every quirk of the foreign drive: what it ends in, what is said, and that no torque is left."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import pytest

from tautwave.errors import DriverError
from tests.drivers.canopen.foreign import Foreign, foreign

SECOND = "master.a2 (node 2)"


class Start(NamedTuple):
    """A quirk at the start of the second drive, and what the start is refused with, '' if not."""

    quirk: Callable[[Foreign], object]
    said: str = ""
    notes: tuple[str, ...] = ()


class Running(NamedTuple):
    """A quirk while both run: sentences that end it (fatal), or are noted; samples that it costs.

    `reached`: the drive can still be told to be off.
    """

    quirk: Callable[[Foreign], object]
    fatal: str = ""
    noted: str = ""
    misses: bool = False
    reached: bool = True


def second(**attributes: object) -> Callable[[Foreign], object]:
    def give(rig: Foreign) -> None:
        for name, value in attributes.items():
            setattr(rig.bus.drives[1], name, value)

    return give


def controller(can_id: int, status: int = 0) -> Callable[[Foreign], object]:
    return lambda rig: rig.bus.controller_says(can_id, bytes([0, status, 0, 0, 0, 0, 0, 0]))


STARTS = {
    "nothing": Start(lambda rig: None),
    "fault at start": Start(second(state="fault"), notes=("is in FAULT: reset 1 of 3",)),
    "two resets": Start(
        second(state="fault", needs_resets=2), notes=("reset 1 of 3", "reset 2 of 3")
    ),
    "nine resets": Start(second(state="fault", needs_resets=9), "(after 3 fault resets)"),
    "no remote bit": Start(second(hides=0x0200)),
    "no voltage bit": Start(second(hides=0x0010)),
    "no bit 12": Start(second(hides=0x1000)),
    "stays in SWITCHED ON": Start(
        second(stays_on=True), "check STO, the brake (60FEh may hold it), commutation"
    ),
    "no remote and stuck": Start(second(stays_on=True, hides=0x0200), "check for local control"),
    "no voltage and stuck": Start(
        second(stays_on=True, hides=0x0010), "no main supply voltage (bit 4)"
    ),
    "EMCY while enabling": Start(
        second(warns_of=0x8611), f"{SECOND}: EMCY 0x8611: following error"
    ),
    "its own EMCY": Start(second(warns_of=0xFF01), "add 0xFF01 to tolerated_emergencies"),
    "deaf to SYNC": Start(second(deaf_to_sync=True), "sends no TPDO1 (0x182) on SYNC"),
    "no heartbeat": Start(second(beats_not=True), f"{SECOND} shows no heartbeat yet"),
    "silent": Start(second(silent=True), f"{SECOND} does not respond"),
    "boots late": Start(lambda rig: rig.bus.drives[1].reboot(0.0, 0.5)),
    "boots too late": Start(
        lambda rig: rig.bus.drives[1].reboot(0.0, 9.0), "or raise sdo_timeout_s"
    ),
    "bus-off": Start(controller(0x40), "bus-off: the controller has left the bus"),
}

WHILE_RUNNING = {
    "nothing": Running(lambda rig: None),
    "a fault": Running(lambda rig: rig.bus.drives[1].fail(0x2310), f"{SECOND}: EMCY 0x2310"),
    "an EMCY": Running(lambda rig: rig.bus.drives[1].emergency(0xFF01), f"{SECOND}: EMCY 0xFF01"),
    "falls to SWITCH ON DISABLED": Running(
        second(state="disabled"), f"{SECOND} left OPERATION ENABLED on its own", reached=True
    ),
    "a quick stop of its own": Running(second(state="stopping"), "quick stop by the drive itself"),
    "restarts": Running(
        lambda rig: rig.bus.drives[1].reboot(rig.bus.now_ns * 1e-9, 0.02),
        f"{SECOND}: the drive restarted during the run (boot-up frame)",
        misses=True,
    ),
    "silent": Running(
        second(silent=True), f"{SECOND}: heartbeat lost", misses=True, reached=False
    ),
    "no heartbeat": Running(second(beats_not=True), f"{SECOND}: heartbeat lost: none for"),
    "deaf to SYNC": Running(second(deaf_to_sync=True), misses=True),
    "loses remote": Running(second(hides=0x0200), "no longer follows the bus (remote, bit 9"),
    "loses bit 12": Running(second(hides=0x1000), noted="no longer follows the command (bit 12)"),
    "bus-off": Running(controller(0x40), "bus-off: the controller has left", misses=True,
                       reached=False),
    "error passive": Running(controller(0x04, 0x20), noted="error passive (transmitting)"),
    "no acknowledge": Running(controller(0x20), noted="no acknowledge: no other node"),
}  # fmt: skip


@pytest.mark.parametrize("name", STARTS)
def test_a_quirk_at_the_start(name: str) -> None:
    case = STARTS[name]
    rig = foreign(numbers=(1, 2))
    case.quirk(rig)
    refused = ""
    try:
        rig.enable(1500)
    except DriverError as err:
        refused = str(err)
    assert bool(refused) == bool(case.said), refused
    assert case.said in refused
    said = [fault.text for fault in rig.driver.faults()]
    for note in case.notes:
        assert any(note in one for one in said), said
    rig.driver.close()
    for drive in rig.bus.drives:
        assert drive.state != "enabled"
        assert drive.torque == 0.0


@pytest.mark.parametrize("name", WHILE_RUNNING)
def test_a_quirk_while_running(name: str) -> None:
    case = WHILE_RUNNING[name]
    rig = foreign(numbers=(1, 2))
    rig.enable()
    for _ in range(10):
        rig.cycle(0.05)
    rig.driver.faults()
    case.quirk(rig)
    fatal, noted, missed = [], [], 0
    for _ in range(60):
        missed += any(not state.valid for state in rig.cycle(0.05))
        for fault in rig.driver.faults():
            (fatal if fault.fatal else noted).append(fault.text)
        if fatal:
            break
    assert bool(fatal) == bool(case.fatal), (fatal, noted)
    assert all(case.fatal in text for text in fatal[:1]), fatal
    assert any(case.noted in text for text in noted) == bool(case.noted), noted
    assert bool(missed) >= case.misses
    rig.driver.close()
    rig.clock.sleep_until(rig.clock.now_ns() + 200_000_000)
    rig.bus.advance(rig.clock.now_ns())
    for drive in rig.bus.drives:
        drive.silent = False
        assert drive.state != "enabled", "its own watchdog"
        assert drive.torque == 0.0
    if not case.reached:
        assert rig.driver.unconfirmed
