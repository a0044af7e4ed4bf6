"""A machine and a reference drive coupled cycle by cycle, with what may never happen asserted."""

from __future__ import annotations

from collections.abc import Callable

from tautwave_drivers.cia402.machine import Machine
from tautwave_drivers.cia402.states import State, decode
from tautwave_drivers.cia402.terms import Event, Quirks, Timeouts
from tests.drivers.cia402.reference_drive import Drive

QUICK = Timeouts(
    transition=60,
    not_ready=300,
    mode=60,
    stop=40,
    fault_reset=10,
    silence=10,
    edge=4,
    total=900,
)


class Bench:
    """`cycle` runs one cycle; the drive sees the word of the last one."""

    def __init__(self, drive: Drive, quirks: Quirks | None = None) -> None:
        self.drive = drive
        self.machine = Machine("axis (node 5)", quirks or Quirks(timeouts=QUICK))
        self.now = 0
        self.words: list[int] = []
        self.events: list[Event] = []

    def cycle(self, *, heard: bool = True, mode_bits: int = 0) -> int:
        drive, machine = self.drive, self.machine
        status = drive.statusword if heard else None
        display = drive.display if heard else None
        word = machine.step(status, display, self.now, mode_bits)
        self.now += 1
        self.words.append(word)
        self.events += machine.take_events()
        if word & 0x8F == 0x0F and heard:
            assert machine.mode_wanted == drive.display, "enabled before the mode was confirmed"
            assert machine.goal.value == "enable"
        if machine.commanding and heard:
            assert decode(drive.statusword) is State.OPERATION_ENABLED
            assert machine.mode_wanted == drive.display
        if not machine.commanding:
            assert word & 0x70 == 0, "bits of the mode belong to a commanding machine"
        drive.cycle(word, machine.mode_wanted)
        assert not drive.changed_with_torque, "mode changed while the drive had torque"
        return word

    def until(self, met: Callable[[], bool], most: int = 2000) -> int:
        for count in range(most):
            if met():
                return count
            self.cycle()
        raise AssertionError(f"not within {most} cycles: {self.drive}, {self.events}")

    def come_up(self, mode: int = 10, most: int = 2000) -> int:
        self.machine.enable(mode)
        return self.until(lambda: self.machine.commanding, most)
