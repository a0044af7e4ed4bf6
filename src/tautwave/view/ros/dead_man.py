"""A dead-man on a topic: a Bool, repeated for as long as somebody holds it.

DDS has no sessions, so one that is held looks as one that was forgotten. The rig therefore engages
only on a `true` that follows a `false`, and after a silence a new `false` is needed. The run
itself times what it receives: it lets go in half a second if this process is killed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from tautwave.runtime.operate.mailbox import HELD, LOOSE
from tautwave.runtime.operate.states import ENGAGE

TOPIC = "/tautwave/engage"
STALE_NS = 500_000_000
"""Between two `true` that count as held."""

LATE_NS = 100_000_000
"""Between two looks at the topic: what has come in a longer one is not of now."""


class DeadMan:
    """What a topic's Bools come to.

    Parameters
    ----------
    send : callable
        Gives the run a line.
    """

    def __init__(self, send: Callable[[str], None]) -> None:
        self._send = send
        self._ready = False
        self._held_ns: int | None = None
        self._looked_ns: int | None = None

    @property
    def state(self) -> str:
        """What it is, for people."""
        if self._held_ns is not None:
            return "held"
        return "loose" if self._ready else "waits for a false"

    def hear(self, values: Sequence[bool], now_ns: int) -> None:
        """Take what has come since the last look, oldest first."""
        late = self._looked_ns is not None and now_ns - self._looked_ns > LATE_NS
        self._looked_ns = now_ns
        if late:
            self._let_go()
            return
        for value in values:
            if not value:
                self._let_go()
                self._ready = True
            elif self._held_ns is not None or self._ready:
                self._send(HELD)
                if self._held_ns is None:
                    self._send(ENGAGE)
                self._ready, self._held_ns = False, now_ns
        if self._held_ns is not None and now_ns - self._held_ns > STALE_NS:
            self._let_go()

    def _let_go(self) -> None:
        if self._held_ns is not None:
            self._send(LOOSE)
        self._ready, self._held_ns = False, None
