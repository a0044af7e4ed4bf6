"""Finding out in a running loop what a servo's alert bit means, and whether its watchdog tripped.

A sync read tells only that there is something: the register behind it is read at the end of the
cycle, in the time that is left before the deadline. Where none is left for two cycles, the third
asks this instead of the samples.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence

from tautwave.contracts import BusSpec, Clock
from tautwave.types import Fault
from tautwave_drivers.dynamixel import registers as reg
from tautwave_drivers.dynamixel.line import OwnLine
from tautwave_drivers.dynamixel.options import DynamixelOptions, Servo
from tautwave_drivers.dynamixel.registers import Register
from tautwave_drivers.dynamixel.usual import Values
from tautwave_drivers.dynamixel.words import hardware_words, status_words

PATIENT_CYCLES = 2
TRIES = 5


class Watch:
    """What is to be asked of whom, and what came out of it.

    `questions` are what is still to be asked; `urgent`: the next cycle has to be given up for it.
    """

    def __init__(
        self,
        line: OwnLine,
        clock: Clock,
        servos: Sequence[Servo],
        bus: BusSpec,
        options: DynamixelOptions,
    ) -> None:
        self._line = line
        self._clock = clock
        self._servos = servos
        self._bus = bus
        self._status_block = options.status_block
        answer_s = options.return_delay_s + options.latency_s
        # The shutdown byte is read along: error status and what the servo did about it.
        self._ask_ns = line.read_ns(8) + round(answer_s * 1e9) + 50_000
        self.questions: deque[tuple[int, Register]] = deque()
        self._told: set[tuple[int, Register]] = set()
        self._put_off = 0
        self._tries = 0
        self._gap_ns = 0

    @property
    def urgent(self) -> bool:
        """Whether there was no time to ask them in the last cycles."""
        return self._put_off > PATIENT_CYCLES

    def silence(self, gap_ns: int) -> None:
        """Note that no packet went out for longer than the watchdogs wait."""
        self._gap_ns = gap_ns
        if not self._status_block:
            for index in range(len(self._servos)):
                self._want(index, reg.BUS_WATCHDOG)

    def back(self, returned: Sequence[tuple[int, int]], watchdog_ns: int) -> None:
        """Note who was away for so many cycles that its watchdog may have tripped meanwhile."""
        for index, missed in returned:
            away_ns = (missed + 1) * self._bus.period_ns
            if away_ns > watchdog_ns and not self._status_block:
                self._gap_ns = away_ns
                self._want(index, reg.BUS_WATCHDOG)

    def alerts(self, values: Sequence[Values | None], refusals: Mapping[int, int]) -> None:
        """Note which servos have their alert bit set, or answer without data."""
        for index, one in enumerate(values):
            error = refusals.get(index, 0) if one is None else one[0]
            if error and (one is None or not self._status_block):
                self._want(index, reg.HARDWARE_ERROR)

    def ask(self, deadline_ns: int, faults: list[Fault]) -> None:
        """Ask as much as fits before the deadline, and append what it means to `faults`."""
        while self.questions:
            if self._clock.now_ns() + self._ask_ns > deadline_ns:
                self._put_off += 1
                return
            index, register = self.questions[0]
            servo = self._servos[index]
            answer = self._line.read(
                servo.options.id, register.address, register.size, limit_ns=deadline_ns
            )
            if answer is None or answer.number:
                self._tries += 1
                if self._tries < TRIES:
                    self._put_off += 1
                    return
                why = "it does not answer" if answer is None else status_words(answer.error)
                text = f"alert: {register.name} cannot be read, {why}"
                faults.append(Fault(servo.axis.name, text, fatal=True))
            elif register is reg.HARDWARE_ERROR:
                self._hardware(index, answer.data[0], faults)
            else:
                self._watchdog(index, register.decode(answer.data), faults)
            self.questions.popleft()
            self._tries = self._put_off = 0

    def status(self, values: Sequence[Values | None], faults: list[Fault]) -> None:
        """Take the status bytes that came with the samples."""
        for index, one in enumerate(values):
            if one is None:
                continue
            *_, error, watchdog = one
            if error and self._once(index, reg.HARDWARE_ERROR):
                self._hardware(index, error, faults)
            if watchdog == reg.WATCHDOG_TRIPPED and self._once(index, reg.BUS_WATCHDOG):
                self._watchdog(index, watchdog, faults)

    def _want(self, index: int, register: Register) -> None:
        if self._once(index, register):
            self.questions.append((index, register))

    def _once(self, index: int, register: Register) -> bool:
        key = (index, register)
        if key in self._told:
            return False
        self._told.add(key)
        return True

    def _hardware(self, index: int, error: int, faults: list[Fault]) -> None:
        servo = self._servos[index]
        text = (
            f"servo {servo.options.id}: {hardware_words(error)} (hardware error status "
            f"{error:#04x}); the run stops; its torque may be off until it is switched off and on"
        )
        faults.append(Fault(servo.axis.name, text, fatal=True))

    def _watchdog(self, index: int, value: int, faults: list[Fault]) -> None:
        servo = self._servos[index]
        if value != reg.WATCHDOG_TRIPPED:
            self._told.discard((index, reg.BUS_WATCHDOG))
            return
        silence = f" after {self._gap_ns * 1e-6:.0f} ms without a packet" if self._gap_ns else ""
        text = (
            f"servo {servo.options.id}: its bus watchdog tripped{silence}, it has stopped and "
            "takes no goals; the run stops; the next run arms it again"
        )
        faults.append(Fault(servo.axis.name, text, fatal=True))
