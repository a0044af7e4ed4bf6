"""The master's side of the CiA 402 state machine: statusword in, controlword out, never blocking.

Source: CiA 402-2 v3.0 (IEC 61800-7-201), state diagram and objects 6040h, 6041h, 605Ah, 6061h.

A drive is enabled only after 6061h has shown the mode asked for, and only by this machine: one
found in OPERATION ENABLED is taken out of it first, since nobody knows its target. `commanding` is
what a driver has to obey: while it is False every target (and offset) it sends is the safe one.
"""

from __future__ import annotations

from tautwave_drivers.cia402 import states as s
from tautwave_drivers.cia402.advice import fall_text, hang_text, mode_lost_text, silence_text
from tautwave_drivers.cia402.emergency import error_words
from tautwave_drivers.cia402.modes import CYCLIC_MODES, control_mask
from tautwave_drivers.cia402.reactions import leaves_quick_stop, stays_in_quick_stop
from tautwave_drivers.cia402.states import State
from tautwave_drivers.cia402.terms import Event, Goal, Habits, Way

_NEVER = -1


class Machine:
    """State machine of one drive.

    Parameters
    ----------
    name : str
        How events call the drive: `slave.wrist (node 5)`.
    habits : Habits
        What is particular about the drive.

    Attributes
    ----------
    commanding : bool
        Targets may flow: OPERATION ENABLED by us, mode confirmed, no stop or halt asked.
    done : bool
        The goal is reached.
    failure : str
        Why the goal was given up, else ''. The machine then disables; `enable` starts again.
    mode_wanted : int
        What 6060h has to hold now, 0 for leaving it alone. It follows `enable` only once the drive
        is without torque: nobody changes the mode of an enabled drive.
    state, controlword
        Last state seen, last word returned.
    """

    def __init__(self, name: str, habits: Habits = Habits()) -> None:  # noqa: B008 - immutable
        self.name = name
        self.habits = habits
        self.goal = Goal.DISABLE
        self.mode_wanted = 0
        self._mode = 0
        self._enabling_sent = _NEVER
        self._paused = _NEVER
        self._urged: dict[State, int] = {}
        self.commanding = False
        self.done = False
        self.failure = ""
        self.state = State.UNKNOWN
        self.controlword = s.DISABLE_VOLTAGE
        self._way = Way.COAST
        self._halt = False
        self._enabled = False
        self._armed = False
        self._display: int | None = None
        self._statusword = 0
        self._error_code = 0
        self._heard = _NEVER
        self._entered = _NEVER
        self._begun = _NEVER
        self._resets = 0
        self._reset_high = False
        self._reset_since = 0
        self._given_up = False
        self._events: list[Event] = []

    def enable(self, mode: int) -> None:
        """Work towards OPERATION ENABLED in `mode`; a drive in another mode is disabled first."""
        if self.goal is Goal.ENABLE and self._mode == mode:
            return
        self._aim(Goal.ENABLE)
        self._mode = int(mode)
        self._halt = False
        self.failure = ""
        self._resets = 0
        self._display = None  # what was shown for an earlier goal confirms nothing

    def disable(self, way: Way = Way.COAST) -> None:
        """Work towards SWITCH ON DISABLED; `commanding` is False at once."""
        if self.goal is not Goal.DISABLE or way is not self._way:
            self._aim(Goal.DISABLE)
        self._way = way

    def quick_stop(self) -> None:
        """Stop by 605Ah; `commanding` is False at once. Reached in QUICK STOP ACTIVE or beyond."""
        if self.goal is not Goal.QUICK_STOP:
            self._aim(Goal.QUICK_STOP)

    def halt(self, on: bool) -> None:
        """Set the halt bit while enabled (reaction 605Dh); cleared by a change of mode."""
        self._halt = on
        if on:
            self.commanding = False

    def restarted(self) -> None:
        """Take note of a boot-up message: the drive was reset and has forgotten its mode."""
        self._display = None
        if self._enabled:
            self._give_up(f"{self.name} was reset while enabled; look at its logic supply")

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
        """Take what the drive tells and return the controlword of this cycle.

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
            603Fh or the last EMCY's code, for the words.

        Returns
        -------
        int
            6040h, to be sent together with safe targets unless `commanding`.
        """
        self._begun = now_cycle if self._begun == _NEVER else self._begun
        self._heard = now_cycle if self._heard == _NEVER else self._heard
        if statusword is None:
            return self._be_silent(now_cycle)
        self._heard = now_cycle
        self._error_code = error_code
        state = s.decode(statusword)
        if state is not self.state or self._entered == _NEVER:
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
        word = self._word(state, now_cycle)
        self._armed = word == s.ENABLE_OPERATION
        if self._armed:
            self._enabling_sent = now_cycle
        confirmed = self._armed and self.done and state is State.OPERATION_ENABLED
        self._enabled = confirmed
        self.commanding = confirmed and not self._halt
        if self.commanding:
            word |= mode_bits & control_mask(self._mode)
        elif confirmed:
            word |= s.HALT
        self.controlword = word
        return word

    def _aim(self, goal: Goal) -> None:
        self.goal = goal
        self.done = False
        self.commanding = False
        self._enabled = False
        self._armed = False
        self._given_up = False
        self._urged.clear()
        self._begun = _NEVER
        self._heard = _NEVER
        self._entered = _NEVER  # the time in this state counts from the new goal on

    def _enter(self, state: State, now: int) -> None:
        self.state = state
        self._entered = now
        self._reset_high = False
        self._reset_since = now
        if state is State.NOT_READY:
            self._display = None  # a drive that starts has forgotten its mode

    def _choose_mode(self, state: State, now: int) -> None:
        """Ask for the goal's mode as soon as the drive surely has no torque; keep its own before.

        A drive may be enabled for some cycles before its statusword says so.
        """
        sent = self._enabling_sent
        under_way = sent != _NEVER and now - sent <= 2 * self.habits.patience.edge
        if state not in s.TORQUE_STATES and not under_way:
            self.mode_wanted = self._mode
        elif self.mode_wanted == 0 and self._display is not None:
            self.mode_wanted = self._display

    def _tell(self, text: str, *, fatal: bool) -> None:
        self._events.append(Event(text, fatal))

    def _give_up(self, text: str, goal: Goal = Goal.DISABLE) -> int:
        """Record why, then work towards a drive without torque."""
        self.failure = text
        self._tell(text, fatal=True)
        self._aim(goal)
        self._way = Way.COAST
        return s.QUICK_STOP if goal is Goal.QUICK_STOP else s.DISABLE_VOLTAGE

    def _be_silent(self, now: int) -> int:
        """Go on with the last command, unless something else is asked for since."""
        cycles = now - self._heard
        word = self.controlword
        enabling = word & s.ENABLE_OPERATION == s.ENABLE_OPERATION
        if self.goal is Goal.DISABLE:
            gentle = s.DISABLE_OPERATION if self._way is Way.RAMP else s.SHUTDOWN
            word = gentle if enabling and self._way is not Way.COAST else s.DISABLE_VOLTAGE
        elif enabling and self.goal is Goal.QUICK_STOP:
            word = s.QUICK_STOP
        elif enabling and not self._armed:
            word = s.DISABLE_OPERATION
        elif enabling and self._halt:
            word = s.ENABLE_OPERATION | s.HALT
        if cycles > self.habits.patience.silence and not self._given_up:
            text = silence_text(self.name, self.controlword, cycles)
            word = self._give_up(text) if self.goal is Goal.ENABLE else word
            if self.failure != text:
                self._tell(text, fatal=True)
            self._given_up = True
        self.controlword = word
        return word

    def _watch(self, state: State, statusword: int, now: int) -> None:
        """Compare an enabled drive with what was asked for, and tell what changed by itself."""
        if state is not State.OPERATION_ENABLED:
            stopping = state is State.QUICK_STOP_ACTIVE  # let it finish its own ramp
            text = fall_text(self.name, statusword, self._error_code)
            self._give_up(text, Goal.QUICK_STOP if stopping else Goal.DISABLE)
            self._enter(state, now)
            return
        if self._display != self._mode:
            self._give_up(mode_lost_text(self.name, self._mode, self._display))
            self._enter(state, now)
            return
        risen = statusword & ~self._statusword
        fallen = self._statusword & ~statusword
        if fallen & s.REMOTE:
            self._give_up(f"{self.name} no longer listens to the bus (remote, bit 9, fell)")
            self._enter(state, now)
        if risen & s.WARNING:
            self._tell(f"{self.name} warns: {s.status_words(statusword)}", fatal=False)
        if risen & s.INTERNAL_LIMIT:
            self._tell(f"{self.name}: an internal limit is active (bit 11)", fatal=False)
        if fallen & s.MODE_BIT_12 and self._mode in CYCLIC_MODES:
            self._tell(f"{self.name} no longer follows the command (bit 12)", fatal=False)

    def _word(self, state: State, now: int) -> int:
        if self.goal is Goal.ENABLE:
            return self._enabling(state, now)
        if self.goal is Goal.QUICK_STOP:
            return self._stopping(state, now)
        return self._disabling(state, now)

    def _enabling(self, state: State, now: int) -> int:
        patience = self.habits.patience
        confirmed = self._display == self._mode == self.mode_wanted
        if state is State.OPERATION_ENABLED and self._armed and confirmed:
            # A pause still on its way to the drive would look like a fall: it has to be over.
            quiet = 2 * patience.edge
            self.done = self._paused == _NEVER or now - self._paused > quiet
            return s.ENABLE_OPERATION
        self.done = False
        if state is State.FAULT:
            return self._resetting(now)
        time = now - self._entered
        allowed = patience.transition
        if state is State.NOT_READY:
            allowed = patience.not_ready
        elif state is State.SWITCHED_ON and not confirmed:
            allowed = patience.mode
        elif state is State.FAULT_REACTION_ACTIVE:
            allowed = patience.stop
        elif state is State.QUICK_STOP_ACTIVE:
            allowed = patience.stop + patience.transition
        if time > allowed:
            return self._give_up(self._hang(time))
        whole = now - self._begun
        if whole > patience.total:
            return self._give_up(f"{self._hang(time)} (after {whole} cycles in all)")
        if state is State.SWITCH_ON_DISABLED:
            return self._urge(s.SHUTDOWN, s.DISABLE_VOLTAGE, time, now)
        if state is State.READY:
            return self._urge(s.SWITCH_ON, s.SHUTDOWN, time, now)
        if state is State.SWITCHED_ON:
            if not confirmed:
                return s.SWITCH_ON
            return self._urge(s.ENABLE_OPERATION, s.SWITCH_ON, time, now)
        if state is State.OPERATION_ENABLED:
            return self._urge(s.DISABLE_OPERATION, s.SHUTDOWN, time, now)
        if state is State.QUICK_STOP_ACTIVE:
            return self._leaving_quick_stop(time, confirmed)
        return s.DISABLE_VOLTAGE

    def _urge(self, command: int, pause: int, time: int, now: int) -> int:
        """Return `command`, interrupted by `pause` for drives that need to see it change.

        Once for a state and a goal, else a slow drive would be called back each time.
        """
        patience = self.habits.patience
        begun = self._urged.get(self.state, now)
        if time < patience.transition // 4 and begun == now:
            return command
        self._urged[self.state] = begun
        if now - begun >= patience.edge:
            return command
        self._paused = now
        return pause

    def _leaving_quick_stop(self, time: int, confirmed: bool) -> int:
        """Leave QUICK STOP ACTIVE the way 605Ah wants; `confirmed` allows transition 16."""
        option, patience = self.habits.quick_stop_option, self.habits.patience
        if stays_in_quick_stop(option):
            resumes = self.habits.resume and confirmed and time <= patience.transition
            return s.ENABLE_OPERATION if resumes else s.DISABLE_VOLTAGE
        if leaves_quick_stop(option) and time <= patience.stop:
            return s.QUICK_STOP  # disabling the voltage now would cut its ramp short
        return s.DISABLE_VOLTAGE

    def _resetting(self, now: int) -> int:
        """Give a rising edge of bit 7, take it back, and again, up to the number of resets."""
        patience, most = self.habits.patience, self.habits.fault_resets
        time = now - self._reset_since
        if self._reset_high:
            if time < patience.fault_reset:
                return s.FAULT_RESET
            self._reset_high = False
            self._reset_since = now
            return s.DISABLE_VOLTAGE
        if time < patience.edge:
            return s.DISABLE_VOLTAGE
        if self._resets >= most:
            how = f"after {most} fault resets" if most else "and faults are not to be reset"
            return self._give_up(f"{self._hang(now - self._entered)} ({how})")
        self._resets += 1
        self._reset_high = True
        self._reset_since = now
        code = f", error {error_words(self._error_code)}" if self._error_code else ""
        self._tell(f"{self.name} is in FAULT{code}: reset {self._resets} of {most}", fatal=False)
        return s.FAULT_RESET

    def _stopping(self, state: State, now: int) -> int:
        time = now - self._entered
        if state is State.OPERATION_ENABLED:
            if time > self.habits.patience.transition:
                return self._give_up(f"{self._hang(time)}: it ignores the quick stop")
            self.done = False
            return s.QUICK_STOP
        self.done = state not in (State.UNKNOWN, State.FAULT_REACTION_ACTIVE)
        return s.QUICK_STOP if state is State.QUICK_STOP_ACTIVE else s.DISABLE_VOLTAGE

    def _disabling(self, state: State, now: int) -> int:
        patience = self.habits.patience
        self.done = state in (State.SWITCH_ON_DISABLED, State.FAULT, State.NOT_READY)
        if self.done or state in (State.UNKNOWN, State.FAULT_REACTION_ACTIVE):
            return s.DISABLE_VOLTAGE
        time = now - self._entered
        if state is not State.READY and self._way is not Way.COAST and time <= patience.stop:
            if state is State.QUICK_STOP_ACTIVE:
                return self._leaving_quick_stop(time, confirmed=False)
            gentle = self._way is Way.RAMP and state is State.OPERATION_ENABLED
            return s.DISABLE_OPERATION if gentle else s.SHUTDOWN
        allowed = patience.transition + (0 if self._way is Way.COAST else patience.stop)
        if time > allowed and not self._given_up:
            self._given_up = True
            self._tell(f"{self._hang(time)}: it does not disable; cut its power", fatal=True)
        return s.DISABLE_VOLTAGE

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
