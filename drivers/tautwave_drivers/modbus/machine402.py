"""A CiA 402 drive over Modbus: its state machine is stepped by statuswords that are read."""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.contracts import Clock
from tautwave.errors import DeviceFault
from tautwave_drivers.cia402.machine import Machine
from tautwave_drivers.cia402.states import State, decode
from tautwave_drivers.cia402.terms import Event, Quirks, Timeouts
from tautwave_drivers.modbus.protocol.frames import Request
from tautwave_drivers.modbus.sequence import RegisterCodec, behind_gateway, is_busy, refusal

RESETS = 3


class Drive402:
    """The state machine of one drive and the requests it needs.

    Parameters
    ----------
    label : str
        Of the drive.
    codec : RegisterCodec
        Makes its requests.
    mode : int
        Of 6060h, that the axis needs.
    rate_hz : float
        Exchanges a second.
    clock : Clock
        Time.
    """

    def __init__(
        self, label: str, codec: RegisterCodec, mode: int, rate_hz: float, clock: Clock
    ) -> None:
        self._label = label
        self._codec = codec
        self._mode = mode
        self._rate_hz = rate_hz
        self._clock = clock
        roles = codec.profile.roles
        self._control, self._status = roles["control"], roles["status"]
        self._mode_name, self._display = roles["mode"], roles["mode_display"]
        self._code = roles.get("fault", "")
        self._asked: list[str] = []
        self.reset()

    def reset(self) -> None:
        """Start over: nothing is known of the drive."""
        quirks = Quirks(fault_resets=RESETS, timeouts=Timeouts.at_rate(self._rate_hz))
        self.machine = Machine(self._label, quirks)
        self._control_sent: int | None = None
        self._mode_sent = 0
        self._error_code: int | None = None

    @property
    def done(self) -> bool:
        """Whether it is enabled or disabled as requested."""
        machine = self.machine
        return machine.commanding or (machine.goal.value == "disable" and machine.done)

    def enable(self) -> None:
        """Work towards OPERATION ENABLED."""
        self.machine.enable(self._mode)

    def disable(self) -> None:
        """Work towards a drive without torque."""
        self.machine.disable()

    def writes(self) -> list[tuple[str, int]]:
        """Return the registers that the machine wants written, and their values."""
        machine = self.machine
        writes = []
        if machine.mode_wanted and machine.mode_wanted != self._mode_sent:
            writes.append((self._mode_name, machine.mode_wanted))
        if machine.controlword != self._control_sent:
            writes.append((self._control, machine.controlword))
        return writes

    def written(self, name: str, value: int) -> None:
        """Note that a register was written."""
        if name == self._mode_name:
            self._mode_sent = value
        else:
            self._control_sent = value

    def requests(self) -> Sequence[Request]:
        """Return writes of mode and controlword where they change, then reads of the state."""
        self._writes = self.writes()
        self._asked = [self._status, self._display]
        if self._code:
            self._asked.append(self._code)
        requests = [self._codec.write(name, value) for name, value in self._writes]
        return requests + [self._codec.read(name) for name in self._asked]

    def take(self, responses: Sequence[bytes]) -> None:
        """Step the machine by the state that was read.

        Raises
        ------
        DeviceFault
            It cannot be enabled; the message has its state and its error.
        """
        if not responses or any(is_busy(pdu) for pdu in responses):
            return
        count = len(self._writes)
        for (name, value), pdu in zip(self._writes, responses[:count], strict=True):
            if refused := refusal(pdu):
                raise DeviceFault(
                    f"{self._label}: {name} = {value:#x}: {refused}{behind_gateway(pdu)}"
                )
            self.written(name, value)
        reported = {}
        for name, pdu in zip(self._asked, responses[count:], strict=True):
            if refused := refusal(pdu):
                raise DeviceFault(f"{self._label}: {name}: {refused}{behind_gateway(pdu)}")
            reported[name] = self._codec.decode(name, pdu)
        code = reported.get(self._code, 0)
        self.step(reported[self._status], reported[self._display], code)
        if self.machine.failure:
            raise DeviceFault(self.machine.failure)

    def step(self, status: int | None, display: int | None, code: int = 0) -> None:
        """Step the machine."""
        cycle = int(self._clock.now_ns() * 1e-9 * self._rate_hz)
        self.machine.step(status, display, cycle, error_code=code)

    def in_fault(self, status: int) -> bool:
        """Return whether a statusword shows a fault, so that its code is worth reading."""
        return decode(status) in (State.FAULT, State.FAULT_REACTION_ACTIVE)

    def is_on(self, status: int) -> bool:
        """Return whether a statusword shows an enabled drive."""
        return decode(status) is State.OPERATION_ENABLED

    def take_events(self) -> tuple[Event, ...]:
        """Return what happened since the last call."""
        return self.machine.take_events()
