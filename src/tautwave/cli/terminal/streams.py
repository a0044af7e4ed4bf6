"""Standard streams that are closed, or whose reader has gone."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TextIO
from unicodedata import category

import click

UNSEEN = ("Cc", "Cf", "Cs")
"""Categories of characters that are none to read: control, format, half ones."""


def open_streams() -> None:
    """Open empty streams for a process that was started without standard ones (`>&-`).

    Otherwise the next opened file, a recording, would get the stream's number, and a library's
    output would end up in it.
    """
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        try:
            os.fstat(number)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)  # gets the lowest number
        if getattr(sys, name) is None:
            stream = open(number, mode, encoding="utf-8", closefd=False)  # noqa: SIM115
            setattr(sys, name, stream)


@contextmanager
def suppress_output_errors(stream: TextIO, ignored: type[OSError] = OSError) -> Iterator[None]:
    """Print inside the block; a reader that has gone (a closed terminal, `head`) ends it quietly.

    The exit code of a command does not depend on the reader of its output.
    """
    try:
        yield
        stream.flush()
    except ignored:
        drop(stream)


def warn(sentence: str) -> None:
    """Say what a user has to know before anything moves, also where the rest is quiet."""
    with suppress_output_errors(sys.stderr):
        click.echo(escaped(sentence), err=True)


def escaped(text: str) -> str:
    """Return text in which nothing is left that a terminal obeys or that turns its order.

    A name in a file, the head of a table or what a device says of itself may hold anything.
    """
    if text.isascii() and text.isprintable():
        return text
    return "".join(
        one if one in "\n\t" or category(one) not in UNSEEN else _escape(one) for one in text
    )


def _escape(letter: str) -> str:
    return letter.encode("unicode_escape", "surrogatepass").decode()


def drop(stream: TextIO) -> None:
    """Discard the remaining output: Python flushes at exit, and would end with 120."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
