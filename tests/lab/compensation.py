"""Friction and inertia off the hand: how much lighter it gets, and whether more is ever given."""

from __future__ import annotations

import functools
import hashlib
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tautwave.bench.result import Goal, Suite, Table, Value
from tautwave.controller import inertia as inertia_laws
from tautwave.laws import account as account_laws
from tautwave.laws import compensation as compensation_laws
from tautwave.laws.compensation import CompensationParams, compensation_effort
from tautwave.models import plant
from tautwave.models.plant import plant_step
from tautwave.models.plant_params import PlantParams, plant_cache
from tautwave.simulation import simulate
from tautwave.sweep.pool import Piece
from tests.lab import inertia as inertia_bench
from tests.lab.inertia import Attacks, attacks_of, inertia_tables
from tests.lab.pieces import Work, run_pieces
from tests.lab.port.rigs import IMPOSED, bench_rig, fastest

Tell = Callable[[str], None]

LAW = "{law: position, pairs: {lever: {stiffness: 25.4, damping: 0.121}}}"
HAND = "{type: multisine, ramp_s: 0.1, components: [[0.7, 0.3, 0.0]]}"
SHARES = (0.0, 0.4, 0.8, 1.0)
CERTAIN, TRUE = 0.02, 0.025
"""Coulomb friction that the levers are guaranteed to have, and what they have [N m]."""

SECONDS, BEGUN_S = 6.0, 1.0
PERIOD, STEPS = 1e-3, 200
KINDS = ("law", "law, late", "helping", "late", "random sign")
PIECE = 250
"""Runs of a piece."""

ROUNDING = 1e-12
"""[J] Energies of some millijoules are summed to that."""


class Free(NamedTuple):
    """Free motion: effort on the hand over its way [N m], error over it [rad], what was given."""

    drag: float
    error: float
    given: float


def free_motion(share: float, seconds: float = SECONDS, engine: str | None = None) -> Free:
    """Move the bench freely with `share` of the guaranteed Coulomb friction compensated."""
    rig = bench_rig(
        LAW, HAND, "{type: free}", noise=1.5e-5, seconds=seconds, grip=IMPOSED, coulomb=TRUE
    )
    belief = rig.axes["master.lever"].coulomb.model_copy(update={"value": TRUE, "lower": CERTAIN})
    sides = {}
    for side in ("master", "slave"):
        whole = getattr(rig, side)
        axis = whole.axes["lever"]
        keys = type(axis).model_validate(
            {**axis.model_dump(), "coulomb": belief.model_dump(),
             "compensation": {"coulomb": share} if share else None}
        )  # fmt: skip
        sides[side] = whole.model_copy(update={"axes": {"lever": keys}})
    rig = rig.model_copy(update=sides)
    run = simulate(rig, engine=engine or fastest(rig))
    moving = run["time_s"] > BEGUN_S
    steps = np.diff(run["true.master.lever.position"][moving])
    way = float(np.sum(np.abs(steps)))
    drag = float(np.sum(run["true.master.lever.hand_effort"][moving][:-1] * steps)) / way
    error = float(np.sum(run["lever.position_error"][moving][:-1] * steps)) / way
    given = sum(
        -float(run[f"lever.compensation_{side}.absorbed"][-1]) if share else 0.0
        for side in ("master", "slave")
    )
    return Free(drag, error, given)


def surplus(seed: int, gain: float) -> float:
    """Return the most that a held effort gave beyond what friction took [J], in a random run.

    The lever has exactly the friction that is certain. Outside pushes at random; the effort is
    `gain` times what may be, of the law or of somebody who knows the true velocity.
    """
    draw = np.random.default_rng((seed, 15))
    coulomb, viscous = float(draw.uniform(0.005, 0.05)), float(draw.uniform(0.0, 0.02))
    inertia = float(np.exp(draw.uniform(np.log(3e-4), np.log(1e-2))))
    grip = float(draw.choice((0.0, 3.0)))
    p = PlantParams(
        inertia, viscous, coulomb, grip, 0.02 * grip, 0.0, 0.0,
        float(draw.choice((0.0, 50.0))), 0.0, 0.05, 1.0,
    )  # fmt: skip
    cache = plant_cache(p, PERIOD)
    kind = KINDS[int(draw.integers(len(KINDS)))]
    late = 0 if kind in ("law", "helping") else int(draw.integers(1, 6))
    noise = float(draw.choice((0.0, 1.0)) * draw.uniform(0.0, 0.3))
    # A viscous effort on noise is no function of the motion: what it takes or gives is the noise's.
    law = CompensationParams(
        coulomb, viscous if noise == 0.0 else 0.0, float(draw.uniform(1e-3, 0.3))
    )
    filtered = float(draw.uniform(0.05, 1.0))
    pushes = np.repeat(draw.normal(0.0, 6.0 * coulomb, STEPS // 10 + 1), 10).tolist()
    noises = draw.standard_normal(STEPS).tolist()
    signs = draw.choice((-1.0, 1.0), STEPS).tolist()
    x, v, mode, read = 0.0, 0.0, 0, 0.0
    queue = [0.0] * (late + 1)
    given = taken = most = 0.0
    for k in range(STEPS):
        read += filtered * (v + noise * noises[k] - read)
        effort = -coulomb if v > 0.0 else coulomb
        if kind == "random sign":
            effort = coulomb * signs[k]
        elif kind.startswith("law"):
            effort = compensation_effort(law, read)
        queue = [*queue[1:], gain * effort]
        before = x
        x, v, mode, _, _, lost, rubbed, _ = plant_step(
            p, cache, x, v, mode, pushes[k] - queue[0], 0.0, 0.0, PERIOD
        )
        given -= queue[0] * (x - before)
        taken += lost + rubbed
        most = max(most, given - taken)
    return most


class Surpluses(NamedTuple):
    """Of many runs: how many had a surplus, and the greatest [J]."""

    beyond: int = 0
    most: float = 0.0

    def with_other(self, other: Surpluses) -> Surpluses:
        """Return the tally of both."""
        return Surpluses(self.beyond + other.beyond, max(self.most, other.most))


class Found(NamedTuple):
    """Of some seeds: surpluses of held efforts, adversaries of the inertia's account.

    Of all that may be and of 1.2 times that; with the account and without it.
    """

    held: Surpluses = Surpluses()
    over: Surpluses = Surpluses()
    kept: Attacks = Attacks()
    open: Attacks = Attacks()


def run_piece(piece: Piece) -> Found:
    """Run the seeds of a piece."""
    seeds = range(*piece)
    held, over = (
        functools.reduce(
            Surpluses.with_other,
            (Surpluses(int(it > ROUNDING), it) for it in (surplus(seed, g) for seed in seeds)),
        )
        for g in (1.0, 1.2)
    )
    return Found(held, over, attacks_of(seeds, account=True), attacks_of(seeds, account=False))


def _worker() -> Callable[[Piece], Found]:
    return run_piece


def run_many(runs: int, first: int, jobs: int, keep: Path | None, tell: Tell) -> Found:
    """Return the tallies of many seeds; see `pieces.run_pieces`."""
    sources = (compensation_laws, inertia_laws, account_laws, plant, inertia_bench)
    text = b"".join(inspect.getsource(it).encode() for it in (*sources, surplus))
    same = {"laws": hashlib.sha256(text).hexdigest()[:16]}
    work = Work("python -m tests.lab compensation", "random runs", PIECE, _worker, same)
    found = Found()
    for piece in run_pieces(work, first, runs, jobs=jobs, keep=keep, tell=tell):
        held, over, kept, open_ = piece
        found = Found(
            found.held.with_other(Surpluses(*held)),
            found.over.with_other(Surpluses(*over)),
            found.kept.with_other(Attacks(*kept)),
            found.open.with_other(Attacks(*open_)),
        )
    return found


def compensation(
    *, runs: int, first: int, tell: Tell, jobs: int = 1, keep: Path | None = None
) -> Suite:
    """Measure the compensation: free motion by share, random runs against friction and account.

    Parameters
    ----------
    runs, first : int
        How many random runs, and the seed of the first.
    jobs : int
        Processes for them.
    keep : Path, optional
        File of those that are done, from which an interrupted run goes on.
    tell : callable
        Called with the name of each measurement as it starts.
    """
    tell("free motion")
    found = {share: free_motion(share) for share in SHARES}
    bare = found[0.0]
    rows: list[list[Value]] = []
    for share, one in found.items():
        stated = 2.0 * share * CERTAIN
        rows.append(
            [share, 1e3 * one.drag, 1e3 * stated, 1e3 * (bare.drag - one.drag),
             1e3 * one.error, 1e3 * 0.5 * stated / 25.4, 1e3 * (bare.error - one.error),
             1e3 * one.given]
        )  # fmt: skip
    many = run_many(runs, first, jobs, keep, tell)
    random: list[list[Value]] = [
        [name, runs, made.beyond, 1e6 * made.most]
        for name, made in zip(
            ("all of c.lower", "1.2 times c.lower"), (many.held, many.over), strict=True
        )
    ]
    stated = 2.0 * 0.8 * CERTAIN
    fallen = (bare.drag - found[0.8].drag) / stated
    closer = (bare.error - found[0.8].error) / (0.5 * stated / 25.4)
    tell("inertia")
    lighter, goals = inertia_tables(runs, (many.kept, many.open))
    return Suite(
        "compensation",
        [
            Table(
                "Free motion by share",
                "The 1-DoF bench with 25 mN m of Coulomb friction on each side, of which 20 are "
                "certain, law position, the master moved at 0.7 Hz. Effort on the hand and error "
                "over the way, how much less is stated, and how much less there is.",
                ("share", "drag_mNm", "less, stated", "less", "error_mrad", "less, stated_mrad",
                 "less_mrad", "given_mJ"),
                rows,
            ),
            Table(
                "Random runs",
                "A lever with exactly the friction that is certain, pushed at random, in a grip or "
                "at a wall. The effort is the law's on a filtered, late velocity (with noise: "
                "Coulomb only), or of one who knows the true one: helping, late, random signs.",
                ("effort", "runs", "with a surplus", "greatest_uJ"),
                random,
            ),
            *lighter,
        ],
        [
            Goal("runs with a surplus", 0.0, "", float(many.held.beyond)),
            Goal("runs with a surplus at 1.2 times", 1, "", float(many.over.beyond), at_least=True),
            Goal("drag: less over stated, off 1, at 0.8", 0.1, "", abs(fallen - 1.0)),
            Goal("error: less over stated, off 1, at 0.8", 0.1, "", abs(closer - 1.0)),
            *goals,
        ],
    )  # fmt: skip
