"""Reading in a running loop whether a servo is still as it was set, where it may not be.

Its alert bit is set, it was away or the host was silent for long enough to have forgotten: its
state is read at the end of the cycle, in the time left before the deadline. If none was left in two
cycles, the third reads it instead of the samples. What comes from a servo that may have forgotten
is not used before.
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
from tautwave_drivers.dynamixel.protocol.messages import status_text
from tautwave_drivers.dynamixel.protocol.registers import Register
from tautwave_drivers.dynamixel.state import FORGETS_NS, TORQUE, torque_fault, watchdog_fault

MAX_DEFERRED = 2
TRIES = 5


class Watch:
    """Registers to read of servos in between, and the faults that they show.

    `requests` are those still to read; when `urgent`, the next cycle is given up for them. Samples
    of `unseen` servos are not to be used, `failed` ones have a fault. `armed` has each servo's bus
    watchdog, None without one.
    """

    def __init__(
        self,
        line: PacketLine,
        clock: Clock,
        servos: Sequence[Servo],
        bus: BusSpec,
        options: DynamixelOptions,
        armed: Sequence[int | None],
    ) -> None:
        self._line = line
        self._clock = clock
        self._servos = servos
        self._bus = bus
        self._status_block = options.status_block
        self._watchdog_ns = round(options.watchdog_s * 1e9)
        self._armed = armed
        self._expected = [(1, 0, one or 0) for one in armed]
        response_s = options.return_delay_s + options.latency_s
        self._read_ns = line.read_ns(TORQUE.size) + round(response_s * 1e9) + 50_000
        self.requests: deque[tuple[int, Register]] = deque()
        self.unseen: set[int] = set()
        self._silent: set[int] = set()
        self.failed: set[int] = set()
        self._deferred = 0
        self._tries = 0
        self._gap_ns = 0

    @property
    def urgent(self) -> bool:
        """Whether the last cycles left no time to read them."""
        return self._deferred > MAX_DEFERRED

    def note_silence(self, gap_ns: int) -> None:
        """Note how long the host was silent: every servo may have forgotten meanwhile."""
        for index in range(len(self._servos)):
            self.note_gap(index, gap_ns)

    def note_returned(self, returned: Sequence[tuple[int, int]]) -> None:
        """Note which servos are back, and after how many cycles."""
        for index, missed in returned:
            self.note_gap(index, (missed + 1) * self._bus.period_ns)

    def note_gap(self, index: int, gap_ns: int) -> None:
        """Note for how long nothing was heard of a servo."""
        if gap_ns <= FORGETS_NS or self._status_block:
            return
        self.unseen.add(index)
        self._want(index, TORQUE)
        if gap_ns > self._watchdog_ns and self._armed[index] is not None:
            self._gap_ns = gap_ns
            self._want(index, reg.BUS_WATCHDOG)

    def alerts(self, values: Sequence[Values | None], refusals: Mapping[int, int]) -> None:
        """Note which servos have their alert bit set, or respond without data."""
        self._silent = {
            index for index, one in enumerate(values) if one is None and index not in refusals
        }
        for index, one in enumerate(values):
            error = refusals.get(index, 0) if one is None else one[0]
            if error and (one is None or not self._status_block):
                self._want(index, TORQUE)

    def read_pending(self, deadline_ns: int, faults: list[Fault]) -> None:
        """Read as many as fit before the deadline, and append what they mean to `faults`.

        Servos that were silent in this cycle are asked once they are back.
        """
        waiting = [key for key in self.requests if key[0] in self._silent]
        self.requests = deque(key for key in self.requests if key[0] not in self._silent)
        self._read(deadline_ns, faults)
        self.requests.extend(waiting)

    def _read(self, deadline_ns: int, faults: list[Fault]) -> None:
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
                self._fail(index, f"{register.name} cannot be read: {why}", faults)
            self.requests.popleft()
            self._tries = self._deferred = 0
            if response is not None and not response.number:
                self._judge(index, register, response.data, faults)

    def status(self, values: Sequence[Values | None], faults: list[Fault]) -> None:
        """Take the state that came with the samples; one that has forgotten is unseen."""
        for index, one in enumerate(values):
            if one is None or one[4:] == self._expected[index]:
                continue
            torque, error, watchdog = one[4:]
            armed = self._armed[index]
            forgot = "" if armed is None else watchdog_fault(watchdog, armed)
            text = torque_fault(torque, error) or forgot
            if torque != 1 or forgot:
                self.unseen.add(index)
            if text:
                self._fail(index, text, faults)

    def _want(self, index: int, register: Register) -> None:
        key = (index, register)
        if key not in self.requests and index not in self.failed:
            self.requests.append(key)

    def _judge(self, index: int, register: Register, data: bytes, faults: list[Fault]) -> None:
        armed = self._armed[index]
        if register is TORQUE:
            text = torque_fault(data[0], data[-1])
        else:
            assert armed is not None
            silence = f" after {self._gap_ns * 1e-6:.0f} ms without a packet"
            text = watchdog_fault(register.decode(data), armed, silence)
        if text:
            self._fail(index, text, faults)
        elif not any(index == other for other, _ in self.requests):
            self.unseen.discard(index)

    def _fail(self, index: int, text: str, faults: list[Fault]) -> None:
        """Report a servo, once; what is not known of it is not asked again."""
        if index not in self.failed:
            self.failed.add(index)
            servo = self._servos[index]
            faults.append(Fault(servo.axis.name, f"servo {servo.options.id}: {text}", fatal=True))
