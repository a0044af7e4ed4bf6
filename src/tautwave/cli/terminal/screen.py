"""What fits on one screen: names of alike joints as one, texts in two lines, numbers as a range."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Sequence

from tautwave.cli.terminal.show import plain_lines
from tautwave.tables import Table

LINES, COLUMNS = 24, 80
"""Of a terminal as it opens."""

SHORT = 26
"""Letters of several names that are still written out."""

_COUNTED = re.compile(r"(.*?)(\d+)")


def line_count(sections: Iterable[Table]) -> int:
    """Return how many lines `show` prints of sections."""
    filled = [section for at, section in enumerate(sections) if section.rows or at == 0]
    return sum(len(list(plain_lines(section))) for section in filled) + len(filled) - 1


def spanned(names: Sequence[str]) -> str:
    """Return names as one: `j1-j6` where they are counted, else the first and the last of many."""
    matches = [_COUNTED.fullmatch(name) for name in names]
    counted = [one for one in matches if one is not None]
    if len(names) > 1 and len(counted) == len(names):
        numbers = [int(one[2]) for one in counted]
        if len({one[1] for one in counted}) == 1 and numbers == list(
            range(numbers[0], numbers[0] + len(numbers))
        ):
            return f"{names[0]}-{names[-1]}"
    written = ", ".join(names)
    if len(names) <= 2 or len(written) <= SHORT:
        return written
    return f"{names[0]} to {names[-1]} ({len(names)})"


def axes_named(names: Sequence[str]) -> str:
    """Return full names of axes as one, by side: `master.j1-j6`, or `j1-j6, both sides`."""
    sides: dict[str, list[str]] = {}
    for name in names:
        side, _, leaf = name.rpartition(".")
        sides.setdefault(side, []).append(leaf)
    if len(sides) == 2 and len({tuple(leaves) for leaves in sides.values()}) == 1:
        return f"{spanned(next(iter(sides.values())))}, both sides"
    return ", ".join(f"{side}.{spanned(leaves)}" for side, leaves in sides.items())


def folded(label: str, text: str, room: int, lines: int = 2) -> str:
    """Return a text wrapped beside a label of `room` letters, cut after so many lines."""
    wrapped = textwrap.wrap(
        text, COLUMNS - 4 - room, break_long_words=False, break_on_hyphens=False
    )
    if len(wrapped) > lines:
        last = f"{wrapped[lines - 1]} {wrapped[lines]}"
        wrapped = [
            *wrapped[: lines - 1],
            textwrap.shorten(last, COLUMNS - 4 - room, placeholder=" ..."),
        ]
    return "\n".join(wrapped)


def folded_rows(rows: Sequence[tuple[str, str]], lines: int = 2) -> list[tuple[str, str]]:
    """Return rows of label and text, each text in at most so many lines of a screen."""
    room = max((len(label) for label, _ in rows), default=0)
    return [(label, folded(label, text, room, lines)) for label, text in rows]


NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")


def as_one(texts: Sequence[str]) -> str:
    """Return texts that differ in numbers only as one, with `least to most` where they do."""
    columns = zip(*(NUMBER.findall(text) for text in texts), strict=True)
    pieces = NUMBER.split(texts[0])
    merged = pieces[0]
    for values, after in zip(columns, pieces[1:], strict=True):
        least, most = min(values, key=float), max(values, key=float)
        merged += (least if float(least) == float(most) else f"{least} to {most}") + after
    return merged
