"""Standard streams that are closed, or that nobody reads any more."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TextIO


def open_streams() -> None:
    """Give a process that was started without some of its standard streams (`>&-`) empty ones.

    Else the next file that is opened, a recording, takes the number of the stream, and what a
    library prints ends in it.
    """
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        try:
            os.fstat(number)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)  # takes the lowest number
        if getattr(sys, name) is None:
            stream = open(number, mode, encoding="utf-8", closefd=False)  # noqa: SIM115
            setattr(sys, name, stream)


@contextmanager
def unheard(stream: TextIO, ignored: type[OSError] = OSError) -> Iterator[None]:
    """Print inside the block; a reader that has gone (a closed terminal, `head`) ends it quietly.

    What a command did, and so its exit code, does not hang on who reads about it.
    """
    try:
        yield
        stream.flush()
    except ignored:
        drop(stream)


def drop(stream: TextIO) -> None:
    """Let what is still to be written go nowhere: Python flushes when it ends, else exits 120."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
