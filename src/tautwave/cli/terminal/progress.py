"""Progress of a run, shown by a small separate process.

The loop must not wait for a terminal: a stopped one (Ctrl-S) or a full pipe would block it with
motors on. So the loop writes a short line into a non-blocking pipe, drops it if the pipe is full,
and `progress_bar.py` at the other end draws: on a terminal a bar, or the pairs of the run in
`directory` while it moves (through the recording's shared memory); elsewhere a line every 10 %.
"""

from __future__ import annotations

import os
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Self

_CHILD = Path(__file__).with_name("progress_bar.py")


class Progress:
    """Callable that takes the fraction done (0 to 1) and the current activity in a word or two."""

    def __init__(self, title: str, directory: Path | None = None) -> None:
        self._fraction = -1.0
        self._text = ""
        # -P: the directory of the script holds modules named `run` and `check`.
        self._child = subprocess.Popen(
            [sys.executable, "-P", str(_CHILD), title, *([str(directory)] if directory else [])],
            stdin=subprocess.PIPE,
        )
        assert self._child.stdin is not None
        self._pipe = self._child.stdin
        os.set_blocking(self._pipe.fileno(), False)

    def __call__(self, fraction: float, text: str) -> None:
        """Show progress; costs a comparison, and some microseconds every half percent."""
        if text == self._text and -0.005 < fraction - self._fraction < 0.005:
            return
        self._fraction, self._text = fraction, text
        with suppress(OSError):  # full or closed: a lagging bar is better than a waiting loop
            os.write(self._pipe.fileno(), f"{fraction:.4f}\t{text}\n".encode())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self._pipe.close()
        try:
            self._child.wait(timeout=2.0)
        except subprocess.TimeoutExpired:
            self._child.kill()  # its terminal is stopped
            self._child.wait()
