"""Many rigs drawn at random, bare and in an account, against the bound of their certificates."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

from tautwave.config import Rig
from tautwave.rig import coupling_law
from tautwave.simulation.kernel.compiled import source_hash
from tautwave.sweep.pool import Piece
from tests.lab.couplings import measure, rigs
from tests.lab.couplings.measure import run_coupling, stated_bound
from tests.lab.couplings.rigs import drawn_rig, without_account
from tests.lab.pieces import Work, run_pieces

PIECE = 50
"""Rigs of a piece."""

BARE_TOO = 20
"""Seeds among which every law is drawn, bare and in an account."""


class Tally(NamedTuple):
    """Of many rigs: how many, how many gave more than the bound, and how many ended early.

    `made` is the most that one gave [J], `share` the greatest share of a bound.
    """

    rigs: int = 0
    beyond: int = 0
    made: float = 0.0
    share: float = 0.0
    early: int = 0

    def with_other(self, other: Tally) -> Tally:
        """Return the tally of both."""
        return Tally(
            self.rigs + other.rigs,
            self.beyond + other.beyond,
            max(self.made, other.made),
            max(self.share, other.share),
            self.early + other.early,
        )


def run_piece(engine: str, piece: Piece) -> list[Tally]:
    """Run the rigs of some seeds; in an account, and bare."""
    found = [Tally(), Tally()]
    for seed in range(*piece):
        rig = drawn_rig(seed, account=True)
        bound = stated_bound(rig)
        for bare, drawn in enumerate((rig, without_account(rig))):
            one = run_coupling(drawn, bound=bound, engine=engine)
            new = Tally(1, int(one.excess > 0.0), one.made, one.made / bound, int(one.stopped))
            found[bare] = found[bare].with_other(new)
    return found


def _worker(engine: str) -> Callable[[Piece], list[Tally]]:
    return functools.partial(run_piece, engine)


def laws_now() -> str:
    """Return a short name of the sources of all laws that are drawn, in accounts."""
    laws = {law.name: law for law in map(coupling_law, _first_rigs())}
    more = (measure, rigs)
    return "-".join(source_hash(laws[name], more)[:8] for name in sorted(laws))


def _first_rigs() -> Iterable[Rig]:
    return (drawn_rig(seed, account=True) for seed in range(BARE_TOO))


def run_many(
    first: int,
    count: int,
    engine: str,
    *,
    jobs: int,
    keep: Path | None,
    tell: Callable[[str], None],
) -> list[Tally]:
    """Return the tallies of rigs in an account, and bare; see `pieces.run_pieces`."""
    same = {"laws": "" if keep is None else laws_now(), "engine": engine}
    begin = functools.partial(_worker, engine)
    work = Work("python -m tests.lab couplings", "rigs drawn at random", PIECE, begin, same)
    found = [Tally(), Tally()]
    for piece in run_pieces(work, first, count, jobs=jobs, keep=keep, tell=tell):
        found = [sum_.with_other(Tally(*new)) for sum_, new in zip(found, piece, strict=True)]
    return found
