"""The state machine of a drive, seen from inside it (CiA 402-2 v3.0, 8.3; IEC 61800-7-201).

Written from the standard's table of transitions, and on purpose not shared with the driver's.
"""

from __future__ import annotations

from enum import IntEnum


class State(IntEnum):
    """The statusword's state bits (0, 1, 2, 3, 5, 6)."""

    NOT_READY = 0x00
    SWITCH_ON_DISABLED = 0x40
    READY = 0x21
    SWITCHED_ON = 0x23
    ENABLED = 0x27
    QUICK_STOP = 0x07
    FAULT_REACTION = 0x0F
    FAULT = 0x08


HALT = 0x100
RESET = 0x80
STAYING_OPTIONS = (5, 6, 7, 8)
"""605Ah: options that stay in quick stop active."""

POWERED = (State.ENABLED, State.QUICK_STOP, State.FAULT_REACTION)


class StateMachine:
    """From controlwords to states.

    A state that the drive has to stop for is reached in two steps: `braking` names how it stops
    and `next_state` where it goes once it is at rest; `come_to_rest` ends that.

    Parameters
    ----------
    delay_ns : int
        Time that each transition takes.
    resets : int
        Edges of fault reset that a fault needs.
    """

    def __init__(self, delay_ns: int = 0, resets: int = 1) -> None:
        self._delay_ns = delay_ns
        self._resets = resets
        self._edges = 0
        self._word = 0
        self._due_ns: int | None = None
        self.state = State.SWITCH_ON_DISABLED
        self.next_state: State | None = None
        self.braking = ""
        self.transitions: list[int] = []
        """Numbers of the transitions gone through, as in the standard's figure."""
        self.quick_stop_option = 2
        self.shutdown_option = 0
        self.disable_option = 1
        self.fault_option = 2

    def restart(self) -> None:
        """Begin as after power-on: transitions 0 and 1."""
        self.state = State.SWITCH_ON_DISABLED
        self.next_state, self.braking, self._due_ns = None, "", None
        self._word = self._edges = 0
        self.transitions += [0, 1]

    def next_event_ns(self) -> int | None:
        """Return when a slow transition is over."""
        return self._due_ns

    def run(self, now_ns: int) -> None:
        """Let a slow transition end; then the last controlword counts again."""
        if self._due_ns is not None and now_ns >= self._due_ns:
            self._due_ns = None
            self._arrive()
            self.control(self._word, now_ns)

    def control(self, word: int, now_ns: int) -> None:
        """Take a controlword."""
        edge = bool(word & RESET) and not self._word & RESET
        self._word = word
        if self.next_state is not None and (word & 2 or self.state is State.FAULT_REACTION):
            return  # under way already; only disable voltage is quicker
        if self.state is State.FAULT:
            if edge:
                self._edges += 1
                if self._edges >= self._resets:
                    self._edges = 0
                    self._go(15, State.SWITCH_ON_DISABLED, now_ns)
            return
        self._command(word, now_ns)

    def _command(self, word: int, now_ns: int) -> None:
        state = self.state
        if not word & 0x02:  # disable voltage
            number = {
                State.READY: 7,
                State.ENABLED: 9,
                State.SWITCHED_ON: 10,
                State.QUICK_STOP: 12,
            }.get(state)
            if number is not None:
                self._go(number, State.SWITCH_ON_DISABLED, now_ns)
        elif not word & 0x04:  # quick stop
            if state is State.ENABLED:
                self._quick_stop(now_ns)
            elif state in (State.READY, State.SWITCHED_ON):
                number = 7 if state is State.READY else 10
                self._go(number, State.SWITCH_ON_DISABLED, now_ns)
        elif not word & 0x01:  # shutdown
            if state is State.SWITCH_ON_DISABLED:
                self._go(2, State.READY, now_ns)
            elif state is State.SWITCHED_ON:
                self._go(6, State.READY, now_ns)
            elif state is State.ENABLED:
                self._go(8, State.READY, now_ns, "ramp" if self.shutdown_option else "")
        elif state is State.READY:  # switch on, with or without enabling
            self._go(3, State.SWITCHED_ON, now_ns)
            if self.state is State.SWITCHED_ON and word & 0x08:
                self._command(word, now_ns)
        elif word & 0x08:  # enable operation
            if state is State.SWITCHED_ON:
                self._go(4, State.ENABLED, now_ns)
            elif state is State.QUICK_STOP and self.quick_stop_option in STAYING_OPTIONS:
                self._go(16, State.ENABLED, now_ns)
        elif state is State.ENABLED:  # disable operation
            self._go(5, State.SWITCHED_ON, now_ns, "ramp" if self.disable_option else "")

    def _quick_stop(self, now_ns: int) -> None:
        option = self.quick_stop_option
        self.transitions.append(11)
        self.state = State.QUICK_STOP
        if option == 0:
            self._go(12, State.SWITCH_ON_DISABLED, now_ns)
            return
        self.braking = "ramp" if option in (1, 5) else "quick"
        self.next_state = None if option in STAYING_OPTIONS else State.SWITCH_ON_DISABLED

    def fault(self, option: int | None = None) -> None:
        """Go into fault, with the reaction of 605Eh or the given one (transition 13)."""
        if self.state in (State.FAULT, State.FAULT_REACTION):
            return
        was_on = self.state in POWERED
        self._due_ns = None
        self._edges = 0
        self.transitions.append(13)
        option = self.fault_option if option is None else option
        self.state, self.next_state = State.FAULT_REACTION, State.FAULT
        self.braking = ("", "ramp", "quick")[option] if was_on else ""
        if not self.braking:
            self.come_to_rest()

    def drop(self) -> None:
        """Lose the voltage of the power stage: immediately, in any state."""
        if self.state in (State.FAULT, State.FAULT_REACTION):
            return
        if self.state is not State.SWITCH_ON_DISABLED:
            numbers = {State.READY: 7, State.ENABLED: 9, State.SWITCHED_ON: 10}
            self.transitions.append(numbers.get(self.state, 12))
        self.state, self.next_state = State.SWITCH_ON_DISABLED, None
        self.braking, self._due_ns = "", None

    def stop(self, now_ns: int) -> None:
        """Quick stop from inside the drive (6007h = 3)."""
        if self.state is State.ENABLED and self.next_state is None:
            self._quick_stop(now_ns)
        elif self.state in (State.READY, State.SWITCHED_ON):
            self.drop()

    def come_to_rest(self) -> None:
        """The motor is at rest: take the transition that waited for it."""
        self.braking = ""
        if self.next_state is not None:
            if self.state is State.FAULT_REACTION:
                self.transitions.append(14)
            elif self.state is State.QUICK_STOP:
                self.transitions.append(12)
            self._arrive()

    def _go(self, number: int, next_state: State, now_ns: int, braking: str = "") -> None:
        self.transitions.append(number)
        self.next_state, self.braking = next_state, braking
        if braking:
            return
        if self._delay_ns > 0:
            self._due_ns = now_ns + self._delay_ns
            return
        self._arrive()

    def _arrive(self) -> None:
        if self.next_state is not None:
            self.state, self.next_state = self.next_state, None
        self.braking = ""
