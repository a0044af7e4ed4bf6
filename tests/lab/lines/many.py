"""Many random patterns, in several processes, saved piece by piece: an interrupted run resumes."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

from tautwave.link import network, receiver
from tautwave.simulation.kernel.compiled import source_hash
from tautwave.sweep.pool import Piece
from tests.lab.lines import pair, rejected
from tests.lab.lines import patterns as patterns_module
from tests.lab.lines.patterns import (
    RECEIVERS,
    Outcome,
    clean_of,
    draw_pattern,
    is_free,
    run_pattern,
)
from tests.lab.pieces import Work, run_pieces

OURS = ("play-out", "auto depth", "newest")
CLEAN = "play-out, clean lines"
MOST = 1000
"""Patterns that show what the other receivers do, and clean lines."""
PIECE = 250
"""Patterns of a piece."""
MADE = 1e-9
"""Energy [J] from which on a receiver counts as having made some."""


class Tally(NamedTuple):
    """What became of patterns with one receiver.

    How many; ticks on which the integers were false; patterns that made energy; most energy that
    came out beyond what was sent and the reserve, and most that both ports gave [J]; errors at rest
    of those that are free [rad].
    """

    patterns: int = 0
    violations: int = 0
    makers: int = 0
    excess: float = -1.0
    made: float = -1.0
    rest: tuple[float, ...] = ()


def with_outcome(t: Tally, o: Outcome, free: bool) -> Tally:
    """Return a tally with one pattern more."""
    return Tally(
        t.patterns + 1,
        t.violations + o.violations,
        t.makers + (o.excess > MADE),
        max(t.excess, o.excess),
        max(t.made, o.made),
        (*t.rest, o.rest) if free else t.rest,
    )


def together(one: Tally, two: Tally) -> Tally:
    """Return the tally of both."""
    return Tally(
        one.patterns + two.patterns,
        one.violations + two.violations,
        one.makers + two.makers,
        max(one.excess, two.excess),
        max(one.made, two.made),
        (*one.rest, *two.rest),
    )


def run_piece(most: int, piece: Piece) -> dict[str, Tally]:
    """Run the patterns of some seeds; those from `most` on with our receivers only."""
    found = {name: Tally() for name in (*RECEIVERS, CLEAN)}
    for seed in range(*piece):
        x = draw_pattern(seed)
        free = is_free(x)
        for name in RECEIVERS:
            if name in OURS or seed < most:
                found[name] = with_outcome(found[name], run_pattern(x, name)[0], free)
        if free and seed < most:
            found[CLEAN] = with_outcome(found[CLEAN], run_pattern(clean_of(x))[0], free)
    return found


def _worker(most: int) -> Callable[[Piece], dict[str, Tally]]:
    return functools.partial(run_piece, most)


def run_many(
    first: int,
    patterns: int,
    *,
    jobs: int = 1,
    keep: Path | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> dict[str, Tally]:
    """Run patterns, and return the tally of each receiver.

    Parameters
    ----------
    first, patterns : int
        First seed, and how many.
    jobs : int
        Processes.
    keep : Path, optional
        File of the pieces that are done: what it has of the same sources is not run again.
    tell : callable
        Called with how far it is, ten times or so.

    Raises
    ------
    ConfigError
        The file is something else, or cannot be written.
    """
    run_pattern(draw_pattern(first)._replace(rest=0.1, end=0.1))  # compiled before there are others
    most = first + MOST
    laws = source_hash(more=(rejected, pair, patterns_module, receiver, network))
    same = {"laws": laws, "most": most}
    begin = functools.partial(_worker, most)
    work = Work("python -m tests.lab network", "random patterns", PIECE, begin, same)
    found = list(run_pieces(work, first, patterns, jobs=jobs, keep=keep, tell=tell))
    names = (*RECEIVERS, CLEAN)
    return {name: _sum(_tally(piece[name]) for piece in found) for name in names}


def _tally(values: Iterable[Any]) -> Tally:
    """Return a tally, also one that was kept."""
    tally = Tally(*values)
    return tally._replace(rest=tuple(tally.rest))


def _sum(tallies: Iterable[Tally]) -> Tally:
    return functools.reduce(together, tallies, Tally())
