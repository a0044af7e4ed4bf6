"""Many random patterns, in several processes, saved piece by piece: an interrupted run resumes."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from tautwave.bench.lines import pair, rejected
from tautwave.bench.lines import patterns as patterns_module
from tautwave.bench.lines.patterns import (
    RECEIVERS,
    Outcome,
    clean_of,
    draw_pattern,
    is_free,
    run_pattern,
)
from tautwave.config.guard import parse_json, read_guarded
from tautwave.errors import ConfigError
from tautwave.link import network, receiver
from tautwave.simulation.kernel.compiled import source_hash
from tautwave.sweep.pool import Piece, ProcessPool, in_process

OURS = ("play-out", "auto depth", "newest")
CLEAN = "play-out, clean lines"
MOST = 1000
"""Patterns that show what the other receivers do, and clean lines."""
PIECE = 250
"""Patterns of a piece."""
LARGEST = 1 << 28
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


def run_piece(most: int, piece: Piece) -> tuple[int, dict[str, Tally]]:
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
    return piece[0], found


def _worker(most: int) -> Callable[[Piece], tuple[int, dict[str, Tally]]]:
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
    end = first + patterns
    pieces = [(at, min(at + PIECE, end)) for at in range(first, end, PIECE)]
    run_pattern(draw_pattern(first)._replace(rest=0.1, end=0.1))  # compiled before there are others
    most = first + MOST
    laws = source_hash(more=(rejected, pair, patterns_module, receiver, network))
    done = _read(keep, laws, most) if keep is not None else {}
    left = [piece for piece in pieces if piece not in done]
    work = (ProcessPool(min(jobs, len(left))) if jobs > 1 and len(left) > 1 else in_process)(
        functools.partial(_worker, most), left
    )
    ends = dict(pieces)
    tenth = max(1, len(pieces) // 10)
    try:
        for count, (at, found) in enumerate(work):
            if count % tenth == 0:
                tell(f"random patterns, {len(left) - count} pieces of {PIECE} left")
            done[at, ends[at]] = found
            if keep is not None:
                _append(keep, {"laws": laws, "most": most, "piece": (at, ends[at]), "found": found})
    finally:
        work.close()
    return {name: _sum(done[piece][name] for piece in pieces) for name in (*RECEIVERS, CLEAN)}


def _sum(tallies: Iterable[Tally]) -> Tally:
    return functools.reduce(together, tallies, Tally())


def _append(keep: Path, line: Mapping[str, object]) -> None:
    try:
        with keep.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")
    except OSError as err:
        raise ConfigError(f"{keep}: cannot be written: {err.strerror}") from err


def _read(keep: Path, laws: str, most: int) -> dict[Piece, dict[str, Tally]]:
    """Return the pieces that a file has of these laws; a last line that was cut off is left out."""
    found: dict[Piece, dict[str, Tally]] = {}
    for number, line in _lines(keep):
        try:
            one = parse_json(line)
            if (one["laws"], one["most"]) != (laws, most):
                continue
            first, end = one["piece"]
            tallies = {name: Tally(*values) for name, values in one["found"].items()}
            found[first, end] = {
                name: tally._replace(rest=tuple(tally.rest)) for name, tally in tallies.items()
            }
        except (ValueError, KeyError, TypeError) as err:
            raise ConfigError(
                f"{keep}:{number}: no piece of `tautwave bench network --keep`; name another file"
            ) from err
    return found


def _lines(keep: Path) -> Iterator[tuple[int, str]]:
    if not keep.exists():
        return
    text = read_guarded(keep, "file of patterns that are done", LARGEST)
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        keep.write_text(whole, encoding="utf-8")
    yield from enumerate(whole.splitlines(), 1)
