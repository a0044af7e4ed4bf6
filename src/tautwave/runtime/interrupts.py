"""The effect of Ctrl-C, SIGTERM and a closed terminal (SIGHUP) in each phase of a run.

Before anything moves they raise an exception; while the loop runs they request a ramp down; while
the report is made they end the report. After that they are ignored, so that nothing replaces the
exit code of a run that has ended.
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
    """Raised on one of `SIGNALS`; `exit_code` is that of a shell."""

    def __init__(self, number: int) -> None:
        super().__init__(_WORDS[signal.Signals(number)])
        self.exit_code = 128 + number


class Interrupts:
    """Handler of the next signal."""

    def __init__(self) -> None:
        self.hear: Callable[[int], object] = self._raise
        self.number = int(signal.SIGINT)
        """Number of the last signal."""
        self.raised_here = False
        """Whether `Interrupted` was raised where nothing catches it on purpose."""
        self._waiting = False
        self._deaf = False

    def handle(self, number: int, _: object) -> None:
        """Call the handler of this phase of the run; a signal handler."""
        self.number = number
        self.hear(number)

    def ignore_further_signals(self) -> None:
        """Ignore signals until the process has ended, so that its exit code stands."""
        self._deaf = True

    def restore(self, before: Mapping[signal.Signals, Any]) -> None:
        """Restore the previous handler, or none."""
        for number, handler in before.items():
            signal.signal(number, signal.SIG_IGN if self._deaf else handler)

    def _remember(self, _: int) -> None:
        self._waiting = True

    def _raise(self, number: int) -> None:
        self.hear = self._remember  # a second signal must not interrupt the clean-up
        self.raised_here = True
        raise Interrupted(number)

    @contextmanager
    def calling(self, hear: Callable[[], object]) -> Iterator[None]:
        """Call `hear` on each signal inside the block; after it they are kept pending.

        An `Interrupted` that got lost before is raised again: what is raised inside a callback of a
        C library, such as a compiler's, is printed and dropped.
        """
        if self.raised_here:
            raise Interrupted(self.number)
        self.hear = lambda _: hear()
        try:
            yield
        finally:
            self.hear = self._remember

    @contextmanager
    def raised(self) -> Iterator[None]:
        """Raise `Interrupted` on the first signal inside the block, or on a pending one.

        After the block signals are kept for the next such block; if there is none, they are
        ignored.
        """
        self.hear = self._raise
        try:
            if self._waiting:
                self._raise(self.number)
            yield
        finally:
            self.hear = self._remember
            self.raised_here = False  # it is caught where such a block is opened


_outermost: list[Interrupts] = []


@contextmanager
def interrupts() -> Iterator[Interrupts]:
    """Handle the signals inside the block, at first by raising `Interrupted`.

    An error that this causes is replaced by it: a C module whose import is interrupted, for one,
    says that it failed to import.

    Handlers belong to the whole process, so nested blocks share them, and the handler set in the
    inner block stays in effect after it. Outside the main thread, where Python has no signals, this
    does nothing.
    """
    if _outermost:
        yield _outermost[0]
        return
    heard = Interrupts()
    if threading.current_thread() is not threading.main_thread():
        yield heard
        return
    # `nohup` ignores SIGHUP deliberately.
    heeded = [n for n in SIGNALS if n != signal.SIGHUP or signal.getsignal(n) != signal.SIG_IGN]
    before = {number: signal.signal(number, heard.handle) for number in heeded}
    _outermost.append(heard)
    try:
        yield heard
    except Exception as err:
        if heard.raised_here:
            raise Interrupted(heard.number) from err
        raise
    finally:
        _outermost.clear()
        heard.restore(before)
