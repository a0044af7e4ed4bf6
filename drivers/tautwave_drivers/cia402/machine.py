"""The master's side of the CiA 402 state machine: statusword in, controlword out, never blocking.

Source: CiA 402-2 v3.0 (IEC 61800-7-201), state diagram and objects 6040h, 6041h, 605Ah, 6061h.

Which word is sent in which state is a table, `routes.ROUTES`. A drive is enabled only after 6061h
has shown the mode asked for, and only by this machine: one found in OPERATION ENABLED is taken out
of it first, since its target is unknown. `commanding` is what a driver has to obey: while it is
False every target (and offset) it sends is the safe one.
"""

from __future__ import annotations

from tautwave_drivers.cia402 import states as s
from tautwave_drivers.cia402.advice import fall_text, hang_text, mode_lost_text, silence_text
from tautwave_drivers.cia402.emergency import error_text
from tautwave_drivers.cia402.modes import CYCLIC_MODES, Mode, control_mask
from tautwave_drivers.cia402.reactions import leaves_quick_stop, stays_in_quick_stop
from tautwave_drivers.cia402.routes import AWAIT_MODE, ROUTES, Route
from tautwave_drivers.cia402.states import State
from tautwave_drivers.cia402.terms import DisableMethod, Event, Goal, Quirks, Timeouts

NEVER = -1


class Repeat:
    """Interrupts a command that a drive does not follow, so that it sees the word change.

    Once for a state and a goal, else a slow drive would be called back each time.
    """

    def __init__(self, timeouts: Timeouts) -> None:
        self._timeouts = timeouts
        self._began: dict[State, int] = {}
        self._paused = NEVER

    def clear(self) -> None:
        """Begin anew, for another goal."""
        self._began.clear()

    def word(self, state: State, command: int, pause: int, time: int, now: int) -> int:
        """Return `command`, or `pause` in its place; the drive has been in `state` for `time`."""
        began = self._began.get(state, now)
        if time < self._timeouts.transition // 4 and began == now:
            return command
        self._began[state] = began
        if now - began >= self._timeouts.edge:
            return command
        self._paused = now
        return pause

    def over(self, now: int) -> bool:
        """Return whether no pause can still be on its way; to an enabled drive it is a stop."""
        return self._paused == NEVER or now - self._paused > 2 * self._timeouts.edge


class FaultReset:
    """Gives a rising edge of bit 7, takes it back, and again, `most` times in all."""

    def __init__(self, timeouts: Timeouts, most: int) -> None:
        self._timeouts = timeouts
        self.most = most
        self.count = 0
        self._high = False
        self._since = 0

    def low(self, now: int) -> None:
        """Bit 7 is 0 from now on: the drive is in another state."""
        self._high = False
        self._since = now

    def word(self, now: int) -> int | None:
        """Return the controlword of this cycle, None when all resets were given in vain."""
        time = now - self._since
        if self._high:
            if time < self._timeouts.fault_reset:
                return s.FAULT_RESET
            self.low(now)
            return s.DISABLE_VOLTAGE
        if time < self._timeouts.edge:
            return s.DISABLE_VOLTAGE
        if self.count >= self.most:
            return None
        self.count += 1
        self._high = True
        self._since = now
        return s.FAULT_RESET


class Machine:
    """State machine of one drive.

    Parameters
    ----------
    name : str
        What events call the drive: `slave.wrist (node 5)`.
    quirks : Quirks
        What is particular about the drive.

    Attributes
    ----------
    commanding : bool
        Targets may flow: OPERATION ENABLED by us, mode confirmed, no stop or halt asked for.
    done : bool
        The goal is reached.
    failure : str
        Why the goal was given up, else ''. The machine then disables; `enable` starts again.
    mode_wanted : int
        What 6060h has to hold now, 0 for leaving it alone. It follows `enable` only once the drive
        is without torque: the mode of an enabled drive is never changed.
    state, controlword
        Last state seen, last word returned.
    """

    def __init__(self, name: str, quirks: Quirks = Quirks()) -> None:  # noqa: B008 - immutable
        self.name = name
        self.quirks = quirks
        self.goal = Goal.DISABLE
        self.mode_wanted = int(Mode.NONE)
        self.commanding = False
        self.done = False
        self.failure = ""
        self.state = State.UNKNOWN
        self.controlword = s.DISABLE_VOLTAGE
        self._route: Route = DisableMethod.COAST
        self._mode = int(Mode.NONE)
        self._halt = False
        self._enabled = False
        self._armed = False  # the last word was ENABLE OPERATION, for this goal
        self._given_up = False
        self._display: int | None = None
        self._statusword = 0
        self._error_code = 0
        self._aimed = self._entered = self._heard = self._enabling_sent = NEVER  # cycles
        self._repeat = Repeat(quirks.timeouts)
        self._fault_reset = FaultReset(quirks.timeouts, quirks.fault_resets)
        self._events: list[Event] = []

    def enable(self, mode: int) -> None:
        """Work towards OPERATION ENABLED in `mode`; a drive in another mode is disabled first."""
        if self.goal is Goal.ENABLE and self._mode == mode:
            return
        self._set_goal(Goal.ENABLE)
        self._mode = int(mode)
        self._halt = False
        self.failure = ""
        self._fault_reset.count = 0
        self._display = None  # what was shown for an earlier goal confirms nothing

    def disable(self, method: DisableMethod = DisableMethod.COAST) -> None:
        """Work towards SWITCH ON DISABLED; `commanding` is False at once."""
        if method is not self._route:
            self._set_goal(Goal.DISABLE, method)

    def quick_stop(self) -> None:
        """Stop by 605Ah; `commanding` is False at once. Reached in QUICK STOP ACTIVE or beyond."""
        if self.goal is not Goal.QUICK_STOP:
            self._set_goal(Goal.QUICK_STOP)

    def halt(self, on: bool) -> None:
        """Set the halt bit while enabled (reaction 605Dh); cleared by a change of mode."""
        self._halt = on
        if on:
            self.commanding = False

    def take_events(self) -> tuple[Event, ...]:
        """Return what happened since the last call."""
        if not self._events:
            return ()
        events = tuple(self._events)
        self._events.clear()
        return events

    def step(
        self,
        statusword: int | None,
        mode_display: int | None,
        now_cycle: int,
        mode_bits: int = 0,
        error_code: int = 0,
    ) -> int:
        """Take what the drive reports and return the controlword of this cycle.

        Parameters
        ----------
        statusword : int or None
            6041h; None if nothing fresh came in this cycle.
        mode_display : int or None
            6061h; None unless it was read after `mode_wanted` had been written.
        now_cycle : int
            The caller's count of cycles; skipped ones count.
        mode_bits : int
            Controlword bits of the mode (`modes.control_mask`); sent only while `commanding`.
        error_code : int
            603Fh or the last EMCY's code, for the messages.

        Returns
        -------
        int
            6040h, to be sent together with safe targets unless `commanding`.
        """
        self._aimed = now_cycle if self._aimed == NEVER else self._aimed
        self._heard = now_cycle if self._heard == NEVER else self._heard
        if statusword is None:
            self.controlword = self._word_in_silence(now_cycle)
            return self.controlword
        self._heard = now_cycle
        self._error_code = error_code
        state = s.decode(statusword)
        if state is not self.state or self._entered == NEVER:
            self._enter(state, now_cycle)
        if mode_display is not None:
            if mode_display != self._display and state is State.SWITCHED_ON:
                self._entered = now_cycle  # waiting for the mode took none of the next step's time
            self._display = mode_display
        if self._enabled:
            self._watch(state, statusword, now_cycle)
        if self.mode_wanted != self._mode:
            self._choose_mode(state, now_cycle)
        self._statusword = statusword
        word = self._next_word(state, now_cycle)
        self._armed = word == s.ENABLE_OPERATION
        if self._armed:
            self._enabling_sent = now_cycle
        self._enabled = self._armed and self.done and state is State.OPERATION_ENABLED
        self.commanding = self._enabled and not self._halt
        if self.commanding:
            word |= mode_bits & control_mask(self._mode)
        elif self._enabled:
            word |= s.HALT
        self.controlword = word
        return word

    def _set_goal(self, goal: Goal, method: DisableMethod = DisableMethod.COAST) -> None:
        self.goal = goal
        self._route = method if goal is Goal.DISABLE else goal
        self.done = False
        self.commanding = False
        self._enabled = False
        self._armed = False
        self._given_up = False
        self._repeat.clear()
        self._aimed = self._heard = NEVER
        self._entered = NEVER  # the time in this state counts from the new goal on

    def _enter(self, state: State, now: int) -> None:
        self.state = state
        self._entered = now
        self._fault_reset.low(now)
        if state is State.NOT_READY:
            self._display = None  # a drive that starts has forgotten its mode

    def _choose_mode(self, state: State, now: int) -> None:
        """Ask for the goal's mode as soon as the drive surely has no torque; keep its own before.

        A drive may be enabled for some cycles before its statusword says so.
        """
        sent = self._enabling_sent
        under_way = sent != NEVER and now - sent <= 2 * self.quirks.timeouts.edge
        if state not in s.TORQUE_STATES and not under_way:
            self.mode_wanted = self._mode
        elif self.mode_wanted == Mode.NONE and self._display is not None:
            self.mode_wanted = self._display

    def _report(self, text: str, *, fatal: bool) -> None:
        self._events.append(Event(text, fatal))

    def _give_up(self, text: str, goal: Goal = Goal.DISABLE) -> int:
        """Record why, then work towards a drive without torque."""
        self.failure = text
        self._report(text, fatal=True)
        self._set_goal(goal)
        return s.QUICK_STOP if goal is Goal.QUICK_STOP else s.DISABLE_VOLTAGE

    def _word_in_silence(self, now: int) -> int:
        """Go on with the last command, unless something else was asked for since."""
        word = self.controlword
        enabling = word & s.ENABLE_OPERATION == s.ENABLE_OPERATION
        if enabling and not self._armed:
            word = ROUTES[self._route][State.OPERATION_ENABLED].command
        elif enabling and self._halt:
            word = s.ENABLE_OPERATION | s.HALT
        elif self.goal is Goal.DISABLE:
            word = s.DISABLE_VOLTAGE
        cycles = now - self._heard
        if cycles > self.quirks.timeouts.silence and not self._given_up:
            text = silence_text(self.name, self.controlword, cycles)
            word = self._give_up(text) if self.goal is Goal.ENABLE else word
            if self.failure != text:
                self._report(text, fatal=True)
            self._given_up = True
        return word

    def _watch(self, state: State, statusword: int, now: int) -> None:
        """Compare an enabled drive with what was asked for, and report what changed by itself."""
        goal = self.goal
        if state is not State.OPERATION_ENABLED:
            stopping = state is State.QUICK_STOP_ACTIVE  # let it finish its own ramp
            text = fall_text(self.name, statusword, self._error_code)
            self._give_up(text, Goal.QUICK_STOP if stopping else Goal.DISABLE)
        elif self._display != self._mode:
            self._give_up(mode_lost_text(self.name, self._mode, self._display))
        else:
            risen = statusword & ~self._statusword
            fallen = self._statusword & ~statusword
            if fallen & s.REMOTE:
                self._give_up(f"{self.name} no longer follows the bus (remote, bit 9, was cleared)")
            if risen & s.WARNING:
                self._report(f"{self.name} warns: {s.status_text(statusword)}", fatal=False)
            if risen & s.INTERNAL_LIMIT:
                self._report(f"{self.name}: an internal limit is active (bit 11)", fatal=False)
            if fallen & s.MODE_BIT_12 and self._mode in CYCLIC_MODES:
                self._report(f"{self.name} no longer follows the command (bit 12)", fatal=False)
        if self.goal is not goal:
            self._enter(state, now)

    def _next_word(self, state: State, now: int) -> int:
        """Return what `ROUTES` sends in this state, within its time."""
        confirmed = False
        if self.goal is Goal.ENABLE:
            confirmed = self._display == self._mode == self.mode_wanted
            if confirmed and self._armed and state is State.OPERATION_ENABLED:
                self.done = self._repeat.over(now)
                return s.ENABLE_OPERATION
            if self._may_show_late(state):
                return self._await_display(now)
        step = ROUTES[self._route][state]
        if step.transition == 4 and not confirmed and not self._may_enable_unshown():
            step = AWAIT_MODE
        timeouts, time = self.quirks.timeouts, now - self._entered
        self.done = step.reached
        if step.command == s.FAULT_RESET:
            return self._reset_fault(now)
        if step.timeouts and time > sum(getattr(timeouts, name) for name in step.timeouts):
            return self._overdue(self._hang(time))
        if self.goal is Goal.ENABLE and now - self._aimed > timeouts.total:
            whole = now - self._aimed
            return self._give_up(f"{self._hang(time)} (after {whole} cycles in all)")
        if self.goal is Goal.DISABLE and time > timeouts.stop:
            return s.DISABLE_VOLTAGE
        if step.transition == 12 and self._route is not DisableMethod.COAST:
            return self._word_in_quick_stop(time, confirmed)
        if step.pause is not None:
            return self._repeat.word(state, step.command, step.pause, time, now)
        return step.command

    def _may_enable_unshown(self) -> bool:
        """Whether a drive that shows no mode before may be enabled, with the mode written."""
        shown = self._display in (None, int(Mode.NONE))
        return self.quirks.mode_when_enabled and shown and self.mode_wanted == self._mode

    def _may_show_late(self, state: State) -> bool:
        return self._armed and state is State.OPERATION_ENABLED and self._may_enable_unshown()

    def _await_display(self, now: int) -> int:
        """Stay enabled, with safe targets, until 6061h shows the mode or its time is over."""
        self.done = False
        if now - self._entered > self.quirks.timeouts.mode:
            return self._give_up(self._hang(now - self._entered))
        return s.ENABLE_OPERATION

    def _overdue(self, hang: str) -> int:
        """Take the consequence of a state that lasts too long; `hang` says which."""
        if self.goal is Goal.ENABLE:
            return self._give_up(hang)
        if self.goal is Goal.QUICK_STOP:
            return self._give_up(f"{hang}: it ignores the quick stop")
        if not self._given_up:
            self._given_up = True
            self._report(f"{hang}: it cannot be disabled; cut its power", fatal=True)
        return s.DISABLE_VOLTAGE

    def _word_in_quick_stop(self, time: int, confirmed: bool) -> int:
        """Leave QUICK STOP ACTIVE the way 605Ah wants; `confirmed` allows transition 16."""
        option, timeouts = self.quirks.quick_stop_option, self.quirks.timeouts
        if stays_in_quick_stop(option):
            resumes = self.quirks.resume and confirmed and time <= timeouts.transition
            return s.ENABLE_OPERATION if resumes else s.DISABLE_VOLTAGE
        if leaves_quick_stop(option) and time <= timeouts.stop:
            return s.QUICK_STOP  # disabling the voltage now would cut its ramp short
        return s.DISABLE_VOLTAGE

    def _reset_fault(self, now: int) -> int:
        reset = self._fault_reset
        given = reset.count
        word = reset.word(now)
        if word is None:
            how = f"after {given} fault resets" if reset.most else "and fault reset is off"
            return self._give_up(f"{self._hang(now - self._entered)} ({how})")
        if reset.count > given:
            code = f", error {error_text(self._error_code)}" if self._error_code else ""
            which = f"reset {reset.count} of {reset.most}"
            self._report(f"{self.name} is in FAULT{code}: {which}", fatal=False)
        return word

    def _hang(self, cycles: int) -> str:
        return hang_text(
            self.name,
            self._statusword,
            self.controlword,
            cycles,
            mode=self._mode,
            display=self._display,
            error_code=self._error_code,
        )
