"""Reading in a running loop whether a servo is still as it was set, where it may not be.

Its alert bit is set, it was away or the host was silent for long enough to have forgotten: what was
set in it is read back block by block at the end of the cycles, in the time left before the
deadline. If none was left in two cycles, the third reads a block instead of the samples. What comes
from a servo that may have forgotten is not used before.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Mapping, Sequence

from tautwave.contracts import BusSpec, Clock
from tautwave.types import Fault
from tautwave_drivers.dynamixel.fast_path import Values
from tautwave_drivers.dynamixel.line.transactions import PacketLine
from tautwave_drivers.dynamixel.options import DynamixelOptions, Servo
from tautwave_drivers.dynamixel.protocol import registers as reg
from tautwave_drivers.dynamixel.protocol.messages import hardware_text, status_text
from tautwave_drivers.dynamixel.protocol.registers import Register
from tautwave_drivers.dynamixel.state import (
    FORGETS_NS,
    TORQUE,
    Errors,
    Remembered,
    memory_fault,
    torque_fault,
    watchdog_fault,
)

MARGIN_NS = 1_000_000
"""Least time that a slow bus leaves beyond that of its reads: the host may wake late."""

LOOK_NS = 100_000_000
"""How often an alert that stays, of an error that is tolerated, is looked into."""

MAX_DEFERRED = 2
TRIES = 5


class Watch:
    """Registers to read of servos in between, and the faults that they show.

    `requests` are those still to read; when `urgent`, the next cycle is given up for them. Samples
    of `unseen` servos are not to be used, `failed` ones have a fault. `armed` has each servo's bus
    watchdog, None without one; `held` what it held when it was enabled; `errors` what it does about
    hardware errors.
    """

    def __init__(
        self,
        line: PacketLine,
        clock: Clock,
        servos: Sequence[Servo],
        bus: BusSpec,
        options: DynamixelOptions,
        armed: Sequence[int | None],
        held: Sequence[Remembered],
        errors: Sequence[Errors],
    ) -> None:
        self._held = held
        self._errors = errors
        self._tolerated_ns: dict[int, int] = {}
        self._blocking: set[tuple[int, Register]] = set()
        """Requests without whose response a servo is not seen."""
        self._told: set[tuple[int, int]] = set()
        self._line = line
        self._clock = clock
        self._servos = servos
        self._bus = bus
        self._status_block = options.status_block
        self._watchdog_ns = round(options.watchdog_s * 1e9)
        self._armed = armed
        self._expected = [(1, 0, one or 0) for one in armed]
        response_s = options.return_delay_s + options.latency_s
        self._slack_ns = round(response_s * 1e9) + 50_000
        self.requests: deque[tuple[int, Register]] = deque()
        self.unseen: set[int] = set()
        self._silent: set[int] = set()
        self.failed: set[int] = set()
        self._deferred = 0
        self._tries: Counter[int] = Counter()
        self._slow = 2 * bus.period_ns >= FORGETS_NS
        self._gap_ns = 0

    @property
    def urgent(self) -> bool:
        """Whether the last cycles left no time to read them."""
        return self._deferred > (0 if self.unseen else MAX_DEFERRED)

    def samples_until(self, due_ns: int, deadline_ns: int) -> int:
        """Return until when samples may be waited for, so that time is left for reading.

        On a slow bus every servo may have restarted between two cycles, and none is seen before it
        is read: waiting for one that is gone would cost the samples of all others.
        """
        if not self.unseen or not self._slow:
            return deadline_ns
        reads_ns = sum(
            self._line.read_ns(register.size) + self._slack_ns
            for index, register in self.requests
            if index not in self._silent
        )
        return min(deadline_ns, max(due_ns, deadline_ns - reads_ns - max(reads_ns, MARGIN_NS)))

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
        if gap_ns > 3 * self._bus.period_ns // 2:  # more than a period of a slow bus
            self._want_all(index, blocking=True)

    def _want_all(self, index: int, *, blocking: bool) -> None:
        for block in self._held[index]:
            self._want(index, block, blocking=blocking)

    def alerts(self, values: Sequence[Values | None], refusals: Mapping[int, int]) -> None:
        """Note which servos have their alert bit set, or respond without data."""
        self._silent = {
            index for index, one in enumerate(values) if one is None and index not in refusals
        }
        for index, one in enumerate(values):
            error = refusals.get(index, 0) if one is None else one[0]
            if not error or index in self.failed or (one is not None and self._status_block):
                continue
            last = self._tolerated_ns.get(index)
            if last is None:
                self.unseen.add(index)
                self._want(index, TORQUE)
                # Torque that is on shows that it lost no setting: the rest is read as time allows.
                self._want_all(index, blocking=False)
            elif self._clock.now_ns() - last > LOOK_NS:  # another may have come to it
                self._want(index, TORQUE, blocking=False)

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
            index, register = self.requests[0]
            read_ns = self._line.read_ns(register.size) + self._slack_ns
            if self._clock.now_ns() + read_ns > deadline_ns:
                self._deferred += 1
                return
            servo = self._servos[index]
            response = self._line.read(
                servo.options.id, register.address, register.size, limit_ns=deadline_ns
            )
            if response is None or response.number:
                self._tries[index] += 1
                if self._tries[index] < TRIES:
                    if self._slow and response is None:  # it may be gone: the others come first
                        self.requests.rotate(-1)
                    else:
                        self._deferred += 1
                    return
                why = "no response" if response is None else status_text(response.error)
                self._fail(index, f"{register.name} cannot be read: {why}", faults)
            else:
                self.requests.popleft()
            self._tries[index] = self._deferred = 0
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
            text = torque_fault(torque, error, self._errors[index]) or forgot
            if error and not text:
                self._tell(index, error, faults)
            if torque != 1 or forgot:
                self.unseen.add(index)
            if text:
                self._fail(index, text, faults)

    def _want(self, index: int, register: Register, *, blocking: bool = True) -> None:
        key = (index, register)
        if index in self.failed:
            return
        if key not in self.requests:
            self.requests.append(key)
        if blocking:
            self._blocking.add(key)

    def _judge(self, index: int, register: Register, data: bytes, faults: list[Fault]) -> None:
        armed = self._armed[index]
        if register is TORQUE:
            text = torque_fault(data[0], data[-1], self._errors[index])
            if data[-1] and not text:
                self._tolerated_ns[index] = self._clock.now_ns()
                self._tell(index, data[-1], faults)
        elif register in self._held[index]:
            text = memory_fault(register, data, self._held[index][register])
        else:
            assert armed is not None
            silence = f" after {self._gap_ns * 1e-6:.0f} ms without a packet"
            text = watchdog_fault(register.decode(data), armed, silence)
        self._blocking.discard((index, register))
        if text:
            self._fail(index, text, faults)
            if register is TORQUE and data[-1]:  # an error, but it has forgotten nothing
                self.unseen.discard(index)
        elif not any(index == other for other, _ in self._blocking):
            self.unseen.discard(index)

    def _tell(self, index: int, error: int, faults: list[Fault]) -> None:
        """Report hardware errors that are tolerated, each once."""
        if (index, error) not in self._told:
            self._told.add((index, error))
            servo = self._servos[index]
            text = hardware_text(error, self._errors[index].shutdown)
            text = f"servo {servo.options.id}: {text}; tolerated_errors names it"
            faults.append(Fault(servo.axis.name, text, fatal=False))

    def _fail(self, index: int, text: str, faults: list[Fault]) -> None:
        """Report a servo, once; what is not known of it is not asked again."""
        if index not in self.failed:
            self.failed.add(index)
            self.requests = deque(key for key in self.requests if key[0] != index)
            self._blocking = {key for key in self._blocking if key[0] != index}
            servo = self._servos[index]
            faults.append(Fault(servo.axis.name, f"servo {servo.options.id}: {text}", fatal=True))
