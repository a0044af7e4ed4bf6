"""One drive inside the cycle: its requests, what its responses mean, how it is enabled."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from tautwave.contracts import Clock
from tautwave.types import AxisCommand, Fault, JointState
from tautwave_drivers.cia402.units import to_counts
from tautwave_drivers.modbus.machine402 import Drive402
from tautwave_drivers.modbus.options import Device
from tautwave_drivers.modbus.profile import BITS, Step
from tautwave_drivers.modbus.protocol import frames
from tautwave_drivers.modbus.protocol.frames import Request
from tautwave_drivers.modbus.protocol.registers import Block, Place, to_words
from tautwave_drivers.modbus.protocol.transaction import Transaction
from tautwave_drivers.modbus.sequence import (
    CHECK,
    Procedure,
    RegisterCodec,
    Steps,
    fault_text,
    forgot_text,
    refusal,
)

ROUND = 1 << 16


class Unwrapper:
    """Adds the rounds that a count of 16 bits has made.

    The first value is where the range has room for it; from then on less than half a round lies
    between two values, as long as the axis keeps its velocity limit.

    Parameters
    ----------
    low, high : float
        The axis' range [counts]; less than a round.
    fastest : float
        Its velocity limit [counts/s].
    """

    def __init__(self, low: float, high: float, fastest: float) -> None:
        self._low, self._high = low, high
        self._longest_ns = 1e9 * 0.5 * ROUND / fastest if fastest > 0.0 else math.inf
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        self._last: int | None = None
        self._at_ns = 0

    def take(self, count: int, now_ns: int) -> int | None:
        """Return the position of a count; None where it may be any, for too long has passed."""
        if self._last is None:
            rounds = math.ceil((self._low - count) / ROUND)
            if count + ROUND * rounds > self._high:
                rounds = 0  # beyond its range, wherever it is
            position = count + ROUND * rounds
        elif now_ns - self._at_ns >= self._longest_ns:
            return None
        else:
            position = self._last + (count - self._last + ROUND // 2) % ROUND - ROUND // 2
        self._last, self._at_ns = position, now_ns
        return position


NAN = math.nan
MISSING = JointState(0.0, NAN, NAN, False, 0)
FORGETS_NS = 45_000_000
"""No drive restarts faster."""
REFUSALS = 3
"""Refused commands in a row that end the run."""


class Plan:
    """The requests of a cycle to one drive: blocks that are read, and the command.

    Parameters
    ----------
    device : Device
        The drive.
    codec : RegisterCodec
        Its function codes.
    """

    def __init__(self, device: Device, codec: RegisterCodec) -> None:
        profile = device.profile
        # The block with the position first: function code 23 reads it with the command.
        self.blocks: list[Block] = profile.blocks(device.read_names)
        first = self.blocks[0]
        self.reads = [codec.read_block(one) for one in self.blocks]
        after = [codec.write(step.register_name, step.value) for step in profile.after_command]
        self._profile = profile
        address, zero = device.command.address, (0,) * device.command.words
        self.both: Request | None = None
        if codec.both and first.table == "holding" and not after:
            self.both = frames.read_write(first.address, first.words, address, zero)
            self.command = self.both
            self.requests = [self.both, *self.reads[1:]]
        else:
            several = codec.several
            self.command = frames.write(address, zero) if several else frames.write_one(address, 0)
            self.requests = [self.command, *after, *self.reads]
        self.skip = len(self.requests) - len(self.reads)
        """Responses before that with the position."""
        self.position = self._place(profile.roles["position"])
        self.status = self._place(profile.roles["status"])
        reported = not device.impedance or device.options.report_torque
        self.effort = self._place(profile.roles["effort"]) if reported else None
        sensor = device.options.effort_sensor
        self.sensor = None if sensor is None else self._place(sensor.register_name)

    def _place(self, name: str) -> tuple[int, Callable[[bytes], int]]:
        """Return the block of a register, and what reads its value in that block's response."""
        register = self._profile.registers[name]
        for number, block in enumerate(self.blocks):
            if name in block.names:
                if block.table in BITS:
                    return number, lambda pdu: pdu[2] & 1
                low_first = self._profile.low_first(register)
                place = Place(register.address - block.address, register.type, low_first)
                return number, place.reader()
        raise AssertionError(name)


class Station:
    """One drive.

    Parameters
    ----------
    device : Device
        Its options and profile.
    rate_hz : float
        Exchanges a second.
    clock : Clock
        Time.
    """

    def __init__(self, device: Device, rate_hz: float, clock: Clock) -> None:
        self.device = device
        self.label = device.label
        self.transaction = Transaction(device.unit)
        self.codec = RegisterCodec(device.profile, device.functions)
        self.plan = Plan(device, self.codec)
        self._clock = clock
        self._low_first = device.profile.low_first(device.command)
        self._kind = device.command.type
        self._short = device.command.words == 1
        self._impedance = device.impedance
        self._quantum, self._most = device.quantum, device.most
        self._sign = device.scale.direction
        sign = device.scale.direction
        self._position_step = sign * device.scale.position
        # The drive measures its motor; what the world does to the axis is the opposite.
        self._effort_step = -sign * device.scale.effort
        self._sensor = device.options.effort_sensor
        self.motor_effort = NAN
        self.machine: Drive402 | None = None
        if device.profile.machine == "cia402":
            mode = device.profile.modes["effort" if device.impedance else "velocity"]
            self.machine = Drive402(self.label, self.codec, mode, rate_hz, clock)
        self.arming: tuple[Step, ...] = ()
        """Steps that switch its comm-loss watchdog on."""
        self.checks: tuple[Step, ...] = ()
        """Registers that a power cycle resets, as they were set: read once it is enabled, and again
        after it was not heard for as long as a restart takes."""
        self._forgets_ns = max(FORGETS_NS, 2.5e9 / rate_hz)
        self._unwrapper: Unwrapper | None = None
        if device.profile.registers[device.profile.roles["position"]].words == 1:
            ends = sorted(one / self._position_step for one in device.axis.position_range)
            fastest = device.axis.velocity_limit / device.scale.position
            self._unwrapper = Unwrapper(ends[0], ends[1], fastest)
        self.procedure: Procedure | None = None
        self.reset()

    def reset(self) -> None:
        """Forget everything heard so far; the command is the safe one."""
        self.on = False
        self.failed = False
        self.resumed = False
        self.procedure = None
        self._checking = False
        self._heard_ns = 0
        self._doubtful: list[Step] = []
        self._turn = -1
        self._staged: tuple[int, ...] = ()
        if self._unwrapper is not None:
            self._unwrapper.forget()
        self.faults: list[Fault] = []
        self._refused = 0
        self._last_status = -1
        self._code_wanted = False
        self._writes: list[tuple[str, int]] = []
        self._reported: set[str] = set()
        if self.machine is not None:
            self.machine.reset()
        self.stage(0)

    # -- enabling -----------------------------------------------------------------------------

    def begin_enabling(self) -> None:
        """Begin to enable it."""
        if self.machine is not None:
            self.machine.enable()
            self.procedure = self.machine
            return
        steps = (*self.arming, *self.device.profile.enable)
        self.procedure = Steps(self.label, "enable", self.codec, steps, self._clock)

    def enabling(self) -> bool:
        """Take the last responses; return whether it is enabled. Raises on failure."""
        if self.on or self.procedure is None:
            return self.on
        self.procedure.take(self.transaction.responses if self.transaction.complete else ())
        if self.machine is not None:
            self._collect_events()
        if self.procedure.done and self.checks and not self._checking:
            self._checking = True
            self.procedure = Steps(self.label, CHECK, self.codec, self.checks, self._clock)
        self.on = self.procedure.done
        return self.on

    # -- the cycle ----------------------------------------------------------------------------

    def stage(self, counts: int) -> None:
        """Set the command of the next exchange."""
        if self._short:
            self._staged = (counts & 0xFFFF,)
        else:
            self._staged = to_words(counts, self._kind, self._low_first)
        self.plan.command.put(self._staged)

    def command(self, command: AxisCommand) -> None:
        """Stage a command; zero where it is not finite or the drive is not enabled."""
        if not self.on or self.failed:
            self.stage(0)
            return
        value = command.effort if self._impedance else command.velocity
        self.stage(self._sign * to_counts(value, self._quantum, self._most))

    def exchange(self) -> Sequence[Request]:
        """Return the requests of this cycle: command, state, and a fault's code if any."""
        machine = self.machine
        if not self.on:
            return self.plan.reads
        if self._doubtful:
            return self._recheck()
        if machine is None and not self._code_wanted:
            return self.plan.requests
        requests = list(self.plan.requests)
        self._writes = machine.writes() if machine is not None else []
        requests += [self.codec.write(name, value) for name, value in self._writes]
        if self._code_wanted:
            requests.append(self.codec.read(self.device.profile.roles["fault"]))
        return requests

    def settle(self, now_ns: int) -> JointState:
        """Return the measured state; not valid where no sample came."""
        transaction, plan = self.transaction, self.plan
        responses = transaction.responses
        if self._doubtful and self.on:
            self._compare(responses)
            return self._unseen()
        skip = plan.skip if self.on else 0
        end = skip + len(plan.blocks)
        if len(responses) < end:
            return self._unseen()
        for number in range(end):
            if responses[number][0] & frames.REFUSED:
                self._refuse(responses[number])
                if number >= skip or any(one[0] & frames.REFUSED for one in responses[skip:end]):
                    return MISSING
                break
        else:
            self._refused = 0
        if self.on and not self.failed:
            silence_ns = now_ns - self._heard_ns if self._heard_ns else 0
            self._heard_ns = now_ns
            number, read = plan.status
            # Its status shows a restart, unless it enables itself: then what was set is gone.
            if (silence_ns > self._forgets_ns or self.resumed) and self._shows_on(
                read(responses[skip + number])
            ):
                self.resumed = False
                self._doubtful = [step for step in (*self.arming, *self.checks) if step.wait]
                if self._doubtful:
                    return self._unseen()
        number, read = plan.position
        count = read(responses[skip + number])
        if self._unwrapper is not None:
            unwrapped = self._unwrapper.take(count, now_ns)
            if unwrapped is None:
                self.fail(
                    "was not heard for so long that its position of 16 bits may have come round; "
                    "run again"
                )
                return MISSING
            count = unwrapped
        position = count * self._position_step
        effort = NAN
        if plan.effort is not None:
            number, read = plan.effort
            effort = read(responses[skip + number]) * self._effort_step
            if self._impedance:
                self.motor_effort, effort = -effort, NAN
        if plan.sensor is not None and self._sensor is not None:
            number, read = plan.sensor
            effort = (read(responses[skip + number]) - self._sensor.zero) * self._sensor.effort
        if self.on:
            number, read = plan.status
            self._watch(read(responses[skip + number]), responses[end:])
        return JointState(position, NAN, effort, True, now_ns - transaction.sent_ns[skip])

    def _shows_on(self, status: int) -> bool:
        if self.machine is not None:
            return self.machine.is_on(status)
        states = self.device.profile.states
        return states is not None and states.enabled.fits(status)

    def _unseen(self) -> JointState:
        """Advance the state machine by a cycle without a sample; return a missing state."""
        if self.machine is not None and self.on:
            self.machine.step(None, None)
            self._collect_events()
        return MISSING

    def _recheck(self) -> Sequence[Request]:
        """Return the command, and in place of the state a register that it may have forgotten."""
        name = self._doubtful[0].register_name
        read = self.codec.read(name)
        if self.plan.both is None or read.function != 3:
            return (*self.plan.requests[: self.plan.skip or 1], read)
        register, command = self.device.profile.registers[name], self.device.command
        return (frames.read_write(register.address, register.words, command.address, self._staged),)

    def _compare(self, responses: Sequence[bytes]) -> None:
        """Take a register that was read again; what differs has been forgotten."""
        if not responses or len(responses) < len(self.transaction.requests):
            return
        pdu = responses[-1]
        if pdu[0] & frames.REFUSED:
            self._refuse(pdu)
            return
        self._refused = 0
        self.checked(self._doubtful[0], pdu)
        self._heard_ns = self._clock.now_ns()
        del self._doubtful[0]

    def next_check(self) -> Step | None:
        """Return the next of what it may have forgotten unseen; None where it is not seen to be on.

        One after the other, and from the first again.
        """
        steps = [step for step in (*self.arming, *self.checks) if step.wait]
        if not steps or not self.on or self.failed or self._doubtful:
            return None
        self._turn = (self._turn + 1) % len(steps)
        return steps[self._turn]

    def checked(self, step: Step, pdu: bytes) -> None:
        """Take what a register was read to hold; b'' and a refusal say nothing."""
        if not pdu or pdu[0] & frames.REFUSED:
            return
        value = self.codec.decode(step.register_name, pdu)
        if value & step.mask != step.value & step.mask:
            self.fail(forgot_text(step, value))

    def _watch(self, status: int, more: Sequence[bytes]) -> None:
        """Take the status and the additional responses."""
        if not more and status == self._last_status and self.machine is None:
            return  # as in the cycle before
        code: int | None = None
        if self._code_wanted and len(more) == len(self._writes) + 1:
            self._code_wanted = False
            code = 0 if refusal(more[-1]) else self.codec.decode(self._fault_name, more[-1])
        if self.machine is not None:
            self._watch_machine(self.machine, status, code, more)
        elif not self.failed:
            self._watch_status(status, code)
            self._last_status = -1 if self._code_wanted else status

    @property
    def _fault_name(self) -> str:
        return self.device.profile.roles.get("fault", "")

    def _watch_machine(
        self, machine: Drive402, status: int, code: int | None, more: Sequence[bytes]
    ) -> None:
        for (name, value), pdu in zip(self._writes, more, strict=False):
            if not refusal(pdu):
                machine.written(name, value)
        self._writes = []
        if machine.in_fault(status) and code is None and self._fault_name and not self.failed:
            self._code_wanted = True  # the machine steps once the code is known
            return
        machine.step(status, None, code or 0)
        self._collect_events()
        if not machine.machine.commanding:
            self.stage(0)

    def _collect_events(self) -> None:
        assert self.machine is not None
        for event in self.machine.take_events():
            self.failed = self.failed or event.fatal
            self.faults.append(Fault(self.device.axis.name, event.text, event.fatal))

    def _watch_status(self, status: int, code: int | None) -> None:
        states = self.device.profile.states
        assert states is not None
        limited = states.limit is not None and states.limit.fits(status)
        if states.fault.fits(status):
            if code is None and self._fault_name:
                self._code_wanted = True
                return
            self.fail(f"is in fault: {self.fault_text(code)}")
        elif not states.enabled.fits(status) and not limited:
            again = " since the connection came back" if self.resumed else ""
            self.fail(f"switched itself off{again} (status {status:#x}); run again")
        if limited:
            self.report(f"a limit or a warning is active (status {status:#x})")

    def fault_text(self, code: int | None) -> str:
        """Return a fault's code as text."""
        return fault_text(self.device.profile, code)

    def _refuse(self, pdu: bytes) -> None:
        self._refused += 1
        if self._refused >= REFUSALS and not self.failed:
            self.fail(f"{refusal(pdu)}, {self._refused} times in a row")
        else:
            self.report(refusal(pdu))

    def report(self, text: str) -> None:
        """Report something that does not stop the run, once."""
        if text not in self._reported:
            self._reported.add(text)
            self.faults.append(
                Fault(self.device.axis.name, f"unit {self.device.unit}: {text}", False)
            )

    def fail(self, text: str) -> None:
        """Report why this axis failed, once; its command is the safe one from now on."""
        if not self.failed:
            self.failed = True
            self.stage(0)
            self.faults.append(
                Fault(self.device.axis.name, f"unit {self.device.unit} {text}", True)
            )
