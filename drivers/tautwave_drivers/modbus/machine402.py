"""A CiA 402 drive over Modbus: its state machine is stepped by statuswords that are read."""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.contracts import Clock
from tautwave.errors import DeviceFault
from tautwave_drivers.cia402.machine import Machine
from tautwave_drivers.cia402.states import State, decode
from tautwave_drivers.cia402.terms import Event, Habits, Patience
from tautwave_drivers.modbus.frames import Question
from tautwave_drivers.modbus.sequence import Speech, is_busy, refusal

RESETS = 3


class Drive402:
    """The state machine of one drive and what it makes the bus ask.

    Parameters
    ----------
    label : str
        Of the drive.
    speech : Speech
        How it is spoken to.
    mode : int
        Of 6060h, that the axis needs.
    rate_hz : float
        Exchanges a second.
    clock : Clock
        Time.
    """

    def __init__(self, label: str, speech: Speech, mode: int, rate_hz: float, clock: Clock) -> None:
        self._label = label
        self._speech = speech
        self._mode = mode
        self._rate_hz = rate_hz
        self._clock = clock
        roles = speech.profile.roles
        self._control, self._status = roles["control"], roles["status"]
        self._mode_name, self._display = roles["mode"], roles["mode_display"]
        self._code = roles.get("fault", "")
        self._asked: list[str] = []
        self.reset()

    def reset(self) -> None:
        """Begin anew: nothing is known of the drive."""
        habits = Habits(fault_resets=RESETS, patience=Patience.at_rate(self._rate_hz))
        self.machine = Machine(self._label, habits)
        self._control_sent: int | None = None
        self._mode_sent = 0
        self._error_code: int | None = None

    @property
    def done(self) -> bool:
        """Whether what was asked of it is reached."""
        machine = self.machine
        return machine.commanding or (machine.goal.value == "disable" and machine.done)

    def enable(self) -> None:
        """Work towards OPERATION ENABLED."""
        self.machine.enable(self._mode)

    def disable(self) -> None:
        """Work towards a drive without torque."""
        self.machine.disable()

    def orders(self) -> list[tuple[str, int]]:
        """Return the registers to write because the machine says so, and their values."""
        machine = self.machine
        orders = []
        if machine.mode_wanted and machine.mode_wanted != self._mode_sent:
            orders.append((self._mode_name, machine.mode_wanted))
        if machine.controlword != self._control_sent:
            orders.append((self._control, machine.controlword))
        return orders

    def ordered(self, name: str, value: int) -> None:
        """Note that a register was written."""
        if name == self._mode_name:
            self._mode_sent = value
        else:
            self._control_sent = value

    def questions(self) -> Sequence[Question]:
        """Return mode and controlword where they change, then what the drive tells."""
        self._orders = self.orders()
        self._asked = [self._status, self._display]
        if self._code:
            self._asked.append(self._code)
        questions = [self._speech.write(name, value) for name, value in self._orders]
        return questions + [self._speech.read(name) for name in self._asked]

    def take(self, answers: Sequence[bytes]) -> None:
        """Step the machine by what was told.

        Raises
        ------
        DeviceFault
            It cannot be enabled; the sentence has its state and its error.
        """
        if not answers or any(is_busy(pdu) for pdu in answers):
            return
        count = len(self._orders)
        for (name, value), pdu in zip(self._orders, answers[:count], strict=True):
            if refused := refusal(pdu):
                raise DeviceFault(f"{self._label}: {name} = {value:#x}: {refused}")
            self.ordered(name, value)
        told = {}
        for name, pdu in zip(self._asked, answers[count:], strict=True):
            if refused := refusal(pdu):
                raise DeviceFault(f"{self._label}: {name}: {refused}")
            told[name] = self._speech.decode(name, pdu)
        code = told.get(self._code, 0)
        self.step(told[self._status], told[self._display], code)
        if self.machine.failure:
            raise DeviceFault(self.machine.failure)

    def step(self, status: int | None, display: int | None, code: int = 0) -> None:
        """Step the machine."""
        cycle = int(self._clock.now_ns() * 1e-9 * self._rate_hz)
        self.machine.step(status, display, cycle, error_code=code)

    def in_fault(self, status: int) -> bool:
        """Return whether a statusword tells of a fault whose code is worth reading."""
        return decode(status) in (State.FAULT, State.FAULT_REACTION_ACTIVE)

    def take_events(self) -> tuple[Event, ...]:
        """Return what happened since the last call."""
        return self.machine.take_events()
