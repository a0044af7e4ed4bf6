"""Reading in a running loop what a servo's alert bit means, and whether its watchdog tripped.

A sync read shows only the bit: the register behind it is read at the end of the cycle, in the time
left before the deadline. If none was left in two cycles, the third reads it instead of the samples.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence

from tautwave.contracts import BusSpec, Clock
from tautwave.types import Fault
from tautwave_drivers.dynamixel.fast_path import Values
from tautwave_drivers.dynamixel.line.transactions import PacketLine
from tautwave_drivers.dynamixel.options import DynamixelOptions, Servo
from tautwave_drivers.dynamixel.protocol import registers as reg
from tautwave_drivers.dynamixel.protocol.messages import hardware_text, status_text
from tautwave_drivers.dynamixel.protocol.registers import Register

MAX_DEFERRED = 2
TRIES = 5


class Watch:
    """Registers to read from servos in between, and the faults they report.

    `requests` are those still to read; when `urgent`, the next cycle is given up for them.
    """

    def __init__(
        self,
        line: PacketLine,
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
        response_s = options.return_delay_s + options.latency_s
        # With the shutdown byte: error status, and what the servo did about it.
        self._read_ns = line.read_ns(8) + round(response_s * 1e9) + 50_000
        self.requests: deque[tuple[int, Register]] = deque()
        self._reported: set[tuple[int, Register]] = set()
        self._deferred = 0
        self._tries = 0
        self._gap_ns = 0

    @property
    def urgent(self) -> bool:
        """Whether the last cycles left no time to read them."""
        return self._deferred > MAX_DEFERRED

    def note_silence(self, gap_ns: int) -> None:
        """Note that no packet went out for longer than the watchdogs allow."""
        self._gap_ns = gap_ns
        if not self._status_block:
            for index in range(len(self._servos)):
                self._want(index, reg.BUS_WATCHDOG)

    def note_returned(self, returned: Sequence[tuple[int, int]], watchdog_ns: int) -> None:
        """Note which servos were absent so long that their watchdog may have tripped."""
        for index, missed in returned:
            away_ns = (missed + 1) * self._bus.period_ns
            if away_ns > watchdog_ns and not self._status_block:
                self._gap_ns = away_ns
                self._want(index, reg.BUS_WATCHDOG)

    def alerts(self, values: Sequence[Values | None], refusals: Mapping[int, int]) -> None:
        """Note which servos have their alert bit set, or respond without data."""
        for index, one in enumerate(values):
            error = refusals.get(index, 0) if one is None else one[0]
            if error and (one is None or not self._status_block):
                self._want(index, reg.HARDWARE_ERROR)

    def read_pending(self, deadline_ns: int, faults: list[Fault]) -> None:
        """Read as many as fit before the deadline, and append what they mean to `faults`."""
        while self.requests:
            if self._clock.now_ns() + self._read_ns > deadline_ns:
                self._deferred += 1
                return
            index, register = self.requests[0]
            servo = self._servos[index]
            response = self._line.read(
                servo.options.id, register.address, register.size, limit_ns=deadline_ns
            )
            if response is None or response.number:
                self._tries += 1
                if self._tries < TRIES:
                    self._deferred += 1
                    return
                why = "no response" if response is None else status_text(response.error)
                text = f"alert: {register.name} cannot be read: {why}"
                faults.append(Fault(servo.axis.name, text, fatal=True))
            elif register is reg.HARDWARE_ERROR:
                self._hardware(index, response.data[0], faults)
            else:
                self._watchdog(index, register.decode(response.data), faults)
            self.requests.popleft()
            self._tries = self._deferred = 0

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
            self.requests.append((index, register))

    def _once(self, index: int, register: Register) -> bool:
        key = (index, register)
        if key in self._reported:
            return False
        self._reported.add(key)
        return True

    def _hardware(self, index: int, error: int, faults: list[Fault]) -> None:
        servo = self._servos[index]
        text = (
            f"servo {servo.options.id}: {hardware_text(error)} (hardware error status "
            f"{error:#04x}); the run stops; its torque may stay off until it is power-cycled"
        )
        faults.append(Fault(servo.axis.name, text, fatal=True))

    def _watchdog(self, index: int, value: int, faults: list[Fault]) -> None:
        servo = self._servos[index]
        if value != reg.WATCHDOG_TRIPPED:
            self._reported.discard((index, reg.BUS_WATCHDOG))
            return
        silence = f" after {self._gap_ns * 1e-6:.0f} ms without a packet" if self._gap_ns else ""
        text = (
            f"servo {servo.options.id}: its bus watchdog tripped{silence}: it has stopped and "
            "ignores goals; the run stops; the next run rearms it"
        )
        faults.append(Fault(servo.axis.name, text, fatal=True))
