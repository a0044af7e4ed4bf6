"""What a person answers to the questions of a guided procedure: typed, or from a file."""

from __future__ import annotations

import math
import os
import re
import select
import termios
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Protocol

from tautwave.errors import ConfigError, SafetyStop
from tautwave.runtime.operate.commands import timed_lines

_THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2},\d{3}")
"""A comma that may stand for a decimal point or between thousands."""
NO, YES = ("n", "no", "q", "quit"), ("", "y", "yes")


class Declined(SafetyStop):
    """A person said no to a question: what it was about does not happen."""


class Misread(ValueError):
    """An answer that cannot be read; the message says what is expected."""


def confirmed(answer: str) -> str:
    """Read the answer to a question that Enter answers: nothing begins on any other word.

    Raises
    ------
    Declined
        It says no.
    Misread
        It says something else.
    """
    _decline(answer)
    if answer.lower() not in YES:
        raise Misread("Enter goes on, no ends this")
    return answer


def number(unit: str, *others: str) -> Callable[[str], float]:
    """Return what reads a finite number, with a decimal comma or point; its unit may follow.

    `others` are further spellings of it. No reading is guessed: `1,000` and `1 000` may be 1 or
    1000, and another unit is another number.
    """
    spelt = {one.replace(" ", "") for one in ("", unit, *others)}

    def read(answer: str) -> float:
        _decline(answer)
        first, *words = answer.split() or [""]
        if _THOUSANDS.fullmatch(first):
            raise Misread("it may be two numbers: type a decimal point, or no comma")
        try:
            value = float(first.replace(",", "."))
        except ValueError:
            value = math.nan
        if not math.isfinite(value) or "".join(words) not in spelt:
            raise Misread(f"type one number in {unit}; no ends this")
        return value

    return read


def one_of(*words: str) -> Callable[[str], str]:
    """Return a reader of one of these words, '' for Enter; `no` declines unless it is one."""

    def read(answer: str) -> str:
        word = answer.lower()
        if word not in words:
            _decline(answer)
            raise Misread(f"type {', '.join(word or 'Enter' for word in words)}")
        return word

    return read


def _decline(answer: str) -> None:
    if answer.lower() in NO:
        raise Declined(f"you answered {answer!r}")


class Answers(Protocol):
    """Where answers come from."""

    def ask(self, now_ns: int) -> None:
        """Take note that a question was asked."""

    def more(self) -> bool:
        """Return whether another question may be answered."""

    def take(self, now_ns: int) -> str | None:
        """Return the answer to it if there is one; never waits.

        Raises
        ------
        ConfigError
            There will never be one.
        """


class Typed:
    """Lines on a descriptor; from a program, those that come before their question are kept for it.

    What a person typed before a question was for another one: it would start what nobody has read.
    """

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._data = b""
        self._ended = False
        self._person = os.isatty(descriptor)

    def ask(self, now_ns: int) -> None:
        """Drop what a person typed before; every line of a program is an answer."""
        if self._person and not self._ended:
            self._data = b""
            with suppress(termios.error):  # it hung up: `take` says so
                termios.tcflush(self._descriptor, termios.TCIFLUSH)

    def more(self) -> bool:
        """Return whether the input has not ended, as far as it was read."""
        return not self._ended or b"\n" in self._data

    def take(self, now_ns: int) -> str | None:
        """Return the next line."""
        if not self._ended and select.select([self._descriptor], [], [], 0)[0]:
            data = os.read(self._descriptor, 4096)
            self._ended = not data
            self._data += data
        line, end, rest = self._data.partition(b"\n")
        if end:
            self._data = rest
            return line.decode("utf-8", "replace").strip()
        if self._ended:
            raise ConfigError(
                "no answer: end of input; answer at a terminal, or give --script FILE"
            )
        return None


class Scripted:
    """Answers of a file, each some time [s] after its question."""

    def __init__(self, answers: Sequence[tuple[float, str]]) -> None:
        self._left = list(answers)
        self._asked_ns = 0
        self._waited_for = False

    def ask(self, now_ns: int) -> None:
        """Start counting; the answer to a question that was cut short is dropped."""
        if self._waited_for:
            self._left.pop(0)
        self._asked_ns, self._waited_for = now_ns, True
        if not self._left:
            raise ConfigError("the script has fewer answers than questions")

    def more(self) -> bool:
        """Return whether an answer is left."""
        return len(self._left) > self._waited_for

    def take(self, now_ns: int) -> str | None:
        """Return the next answer once it is due."""
        if now_ns - self._asked_ns < 1e9 * self._left[0][0]:
            return None
        self._waited_for = False
        return self._left.pop(0)[1]


MANY = 3
"""Wrong lines, and no right one: it is another file."""


def read_answers(text: str, name: str) -> Scripted:
    """Return the answers of a file with lines `SECONDS [ANSWER]`, one a question.

    Raises
    ------
    ConfigError
        A line is wrong; every mistake with its line.
    """
    answers, problems = [], []
    for number, line, seconds, answer in timed_lines(text):
        if not 0.0 <= seconds < 1e4:
            problems.append(
                f"{name}:{number}: write SECONDS ANSWER, the seconds after the question "
                f"(got {line[:40]!r})"
            )
            continue
        answers.append((seconds, answer))
    if len(problems) > MANY and not answers:
        raise ConfigError(f"{name}: contains no line SECONDS ANSWER, such as `1.5 yes`")
    if problems:
        raise ConfigError(problems)
    return Scripted(answers)
