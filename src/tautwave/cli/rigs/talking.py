"""How a guided procedure talks to a person: on this terminal, with answers typed or from a file."""

from __future__ import annotations

import sys
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from tautwave.cli.terminal.live import room

if TYPE_CHECKING:
    from tautwave.session.guided.running import Conversation

LARGEST = 1 << 16
"""[bytes] of a file of answers."""


def conversation(script: str | None) -> Conversation:
    """Return how the person is asked: on this terminal, with answers from a file if there is one.

    Raises
    ------
    ConfigError
        The file cannot be read, or is wrong.
    """
    from tautwave.config.guard import read_guarded
    from tautwave.session.guided.answers import Answers, Typed, read_answers
    from tautwave.session.guided.running import Conversation

    answers: Answers
    if script is None:
        answers = Typed(sys.stdin.fileno())
    else:
        answers = read_answers(read_guarded(Path(script), "script", LARGEST), script)
    screen = Screen(sys.stdout)
    pauses = script is None and sys.stdin.isatty()
    return Conversation(answers, screen.say, screen.show, pauses)


class Screen:
    """Sentences below each other, and lines of numbers that newer ones replace.

    On a terminal sentences are wrapped between words; elsewhere each is one line, and there are no
    numbers.
    """

    def __init__(self, out: TextIO) -> None:
        self._out = out
        self._live = out.isatty()
        self._shown = 0

    def say(self, text: str) -> None:
        """Write a sentence; numbers above it stay."""
        self._shown = 0
        if self._live:
            columns, _ = room(self._out.fileno())
            wrapper = textwrap.TextWrapper(
                columns, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False
            )
            text = "\n".join(map(wrapper.fill, text.splitlines()))
            text = f"\r\x1b[K{text}"  # over a bar of progress
        self._out.write(f"{text}\n")
        self._out.flush()

    def show(self, text: str) -> None:
        """Write lines of numbers over those that were shown last."""
        if not self._live:
            return
        columns, most = room(self._out.fileno())
        lines = [line[:columns] for line in text.splitlines()[:most]]
        up = f"\x1b[{self._shown}A\x1b[J" if self._shown else ""
        self._out.write(up + "".join(f"{line}\n" for line in lines))
        self._out.flush()
        self._shown = len(lines)
