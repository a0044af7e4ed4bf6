"""Commands given more than once: fault resets, and words that a drive may have missed."""

from __future__ import annotations

from tautwave_drivers.cia402 import states as s
from tautwave_drivers.cia402.states import State
from tautwave_drivers.cia402.terms import Timeouts

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
