"""Where commands come from: a list with times, keys of a terminal, lines on a descriptor.

All end in the same queue, which the loop looks into without waiting.
"""

from __future__ import annotations

import math
import os
import select
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple, Protocol, runtime_checkable

from tautwave.errors import ConfigError
from tautwave.runtime.operate.states import CLUTCH, COMMANDS, ENGAGE, HOLD, REST, STOP

EPISODE = "episode"
"""Begins an episode, or ends the one that runs; `argument` is its name and task, or `failed`."""

LEAD = "lead"
"""An action for virtual hands that a policy leads; `argument` is `PAIR=POSITION ...`, master."""

PAYLOAD = "payload"
"""Has an arm take up a payload; `argument` is its name, after the side where both have some."""

TAKE_OVER = "take_over"
"""A person leads from now on, not the policy."""

HAND_BACK = "hand_back"
"""The policy leads again."""

WORDS = (*COMMANDS, EPISODE, PAYLOAD, TAKE_OVER, HAND_BACK)
TOGGLE = "toggle"
ENDINGS = ("success", "failed", "again")
"""Words that stand for `episode WORD`: how the one that runs ends, or that the last is repeated."""
KEYS = {
    " ": TOGGLE, "c": CLUTCH, "g": ENGAGE, "p": HOLD, "r": REST, "e": EPISODE, "q": STOP,
    "s": "success", "f": "failed", "b": "again", "t": TAKE_OVER, "h": HAND_BACK,
}  # fmt: skip
"""Keys of the terminal; the space bar engages and disengages."""

LONGEST = 4096


class Order(NamedTuple):
    """One command: its word, what follows it, and where it comes from."""

    word: str
    argument: str = ""
    source: str = "script"


def unknown(word: str) -> str:
    """Return why a command is unknown; actions for hands were taken before."""
    if word == LEAD:
        return (
            "not an action: write PAIR=POSITION, with finite positions of the "
            "pairs that the policy drives"
        )
    return f"unknown; known are {', '.join((*WORDS, *ENDINGS))}"


def in_full(order: Order) -> Order:
    """Return a command as the journal has it: `success` is `episode success`."""
    return Order(EPISODE, order.word, order.source) if order.word in ENDINGS else order


class Source(Protocol):
    """A source of commands."""

    def take(self, now_ns: int) -> Sequence[Order]:
        """Return what has come up to now [ns since the start]; never waits."""


@runtime_checkable
class Watcher(Protocol):
    """A source that sees what it commands."""

    def sees(self, control: Any) -> None:
        """Take the rig's controller."""


class Lamp(Protocol):
    """Something that is on while an episode runs."""

    def shows(self, *, on: bool) -> None:
        """Switch it; never waits."""


class DeadMan(Protocol):
    """Something that a person holds while the rig may be engaged."""

    @property
    def name(self) -> str:
        """What people call it."""

    def held(self) -> bool:
        """Return whether it is held now; never waits."""


class Script:
    """Commands at given times [ns], in order of time."""

    def __init__(self, orders: Sequence[tuple[int, Order]]) -> None:
        self._left = sorted(orders, key=lambda timed: timed[0])[::-1]

    def take(self, now_ns: int) -> Sequence[Order]:
        """Return those that are due."""
        due = []
        while self._left and self._left[-1][0] <= now_ns:
            due.append(self._left.pop()[1])
        return due


class Descriptor:
    """Bytes on a file descriptor: keys of a terminal, or lines of a pipe; `last` at its end.

    `fresh`: of what came before the first look only a stop counts. A key that was pressed while
    the devices were opened must not engage a rig that nobody has seen idle.
    """

    def __init__(
        self,
        descriptor: int,
        read: Callable[[bytes], Sequence[Order]],
        last: Sequence[Order] = (),
        *,
        fresh: bool = False,
    ) -> None:
        self._descriptor = descriptor
        self._read = read
        self._last = last
        self._stale = fresh
        self._open = True

    def take(self, now_ns: int) -> Sequence[Order]:
        """Return what has been typed or sent; a descriptor that fails is not looked at again."""
        stale, self._stale = self._stale, False
        if not self._open:
            return ()
        try:
            if not select.select([self._descriptor], [], [], 0)[0]:
                return ()
            data = os.read(self._descriptor, LONGEST)
        except (OSError, ValueError):
            data = b""
        self._open = bool(data)
        if not data:
            return list(self._last)
        orders = self._read(data)
        return [order for order in orders if order.word == STOP] if stale else orders


def read_keys(data: bytes) -> Sequence[Order]:
    """Return the commands of typed keys; other keys are ignored."""
    return [Order(KEYS[key], "", "key") for key in data.decode("ascii", "ignore") if key in KEYS]


class Lines:
    """Turns bytes into commands, one a line, such as `episode pick red`; unknown words stay.

    Without a `source` each line begins with its own, such as `page episode pick red`.
    """

    def __init__(self, source: str = "") -> None:
        self._source = source
        self._rest = b""

    def __call__(self, data: bytes) -> Sequence[Order]:
        """Return the commands of complete lines."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        self._rest = self._rest[-LONGEST:]
        orders = []
        for line in lines:
            text = line.decode("utf-8", "replace").strip()
            source = self._source
            if not source:
                source, _, text = text.partition(" ")
            word, _, argument = text.strip().partition(" ")
            if word:
                orders.append(Order(word, argument.strip(), source[:16]))
        return orders


def timed_lines(text: str) -> Iterator[tuple[int, str, float, str]]:
    """Yield the lines `SECONDS REST` of a script: number, line, seconds (NaN if it is none), rest.

    What follows a # is a comment; lines of nothing else are left out.
    """
    for number, line in enumerate(text.splitlines(), 1):
        line = line.partition("#")[0].strip()
        if not line:
            continue
        word, _, rest = line.partition(" ")
        try:
            seconds = float(word)
        except ValueError:
            seconds = math.nan
        yield number, line, seconds, rest.strip()


def read_script(text: str, name: str) -> list[tuple[int, Order]]:
    """Return the commands of a file with lines `TIME COMMAND [TEXT]`, TIME in s.

    Raises
    ------
    ConfigError
        A line is wrong; every mistake with its line.
    """
    orders, problems = [], []
    for number, line, seconds, rest in timed_lines(text):
        word, _, argument = rest.partition(" ")
        if not 0.0 <= seconds < 1e6 or word not in (*WORDS, *ENDINGS, LEAD):
            problems.append(
                f"{name}:{number}: write TIME COMMAND, such as `1.5 engage`; commands are "
                f"{', '.join((*WORDS, *ENDINGS))} (got {line[:40]!r})"
            )
            continue
        orders.append((round(seconds * 1e9), Order(word, argument.strip(), "script")))
    if len(problems) > 1 and not orders:  # another kind of file
        number, line, *_ = next(timed_lines(text))
        raise ConfigError(
            f"{name}: contains no line TIME COMMAND, such as `1.5 engage` (line {number} is "
            f"{line[:40]!r})"
        )
    if problems:
        raise ConfigError(problems)
    return orders
