"""What Ctrl-C, SIGTERM and a closed terminal (SIGHUP) mean in each part of a run.

Before anything moves they end the run by an exception; while the loop runs they ask it to ramp
down; while the report is made they end the report. After that nobody listens, so that nothing
replaces the exit code of a run that has ended.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_WORDS = {signal.SIGINT: "Ctrl-C", signal.SIGTERM: "SIGTERM", signal.SIGHUP: "SIGHUP"}


class Interrupted(KeyboardInterrupt):
    """One of `SIGNALS` ended what was being done; `exit_code` is the shell's own for it."""

    def __init__(self, number: int) -> None:
        super().__init__(_WORDS[signal.Signals(number)])
        self.exit_code = 128 + number


class Interrupts:
    """Who hears the next signal."""

    def __init__(self) -> None:
        self.hear: Callable[[int], object] = self._raise
        self.number = int(signal.SIGINT)
        """Of the last signal."""
        self._waiting = False
        self._deaf = False

    def handle(self, number: int, _: object) -> None:
        """Do what this part of the run wants done; a signal handler."""
        self.number = number
        self.hear(number)

    def stay_deaf(self) -> None:
        """Ignore signals until the process has ended: nothing replaces its exit code."""
        self._deaf = True

    def restore(self, before: Mapping[signal.Signals, Any]) -> None:
        """Give the signals back, or nobody."""
        for number, handler in before.items():
            signal.signal(number, signal.SIG_IGN if self._deaf else handler)

    def _remember(self, _: int) -> None:
        self._waiting = True

    def _raise(self, number: int) -> None:
        self.hear = self._remember  # what follows is cleaning up; a second one would tear it
        raise Interrupted(number)

    @contextmanager
    def calling(self, hear: Callable[[], object]) -> Iterator[None]:
        """Call `hear` on each signal inside the block; from its end on they wait."""
        self.hear = lambda _: hear()
        try:
            yield
        finally:
            self.hear = self._remember

    @contextmanager
    def raised(self) -> Iterator[None]:
        """Raise `Interrupted` on the first signal inside the block, or on one that waits for it.

        From its end on signals wait for the next such block; if there is none, they are ignored.
        """
        self.hear = self._raise
        if self._waiting:
            self._raise(self.number)
        try:
            yield
        finally:
            self.hear = self._remember


_outermost: list[Interrupts] = []


@contextmanager
def interrupts() -> Iterator[Interrupts]:
    """Take over the signals inside the block, which begins with raising `Interrupted`.

    Handlers belong to the whole process, so a block inside another one shares what that one has,
    and what comes after the inner block is still heard as the inner block left it. Outside the
    main thread, where Python has no signals, nothing is ever heard.
    """
    if _outermost:
        yield _outermost[0]
        return
    heard = Interrupts()
    if threading.current_thread() is not threading.main_thread():
        yield heard
        return
    # `nohup` has SIGHUP ignored, and means it.
    heeded = [n for n in SIGNALS if n != signal.SIGHUP or signal.getsignal(n) != signal.SIG_IGN]
    before = {number: signal.signal(number, heard.handle) for number in heeded}
    _outermost.append(heard)
    try:
        yield heard
    finally:
        _outermost.clear()
        heard.restore(before)
