"""Inertia off the hand: what is felt of it, and whether the account stops who wants more."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tautwave.bench.result import Goal, Table, Value
from tautwave.config import Axis, Rig
from tautwave.contracts import CoupledAxis
from tautwave.controller.inertia import close_inertia, lighten, start_inertia
from tautwave.controller.records import AxisParams, AxisState
from tautwave.laws.limit import NO_LIMITS
from tautwave.laws.site import SiteParams
from tautwave.laws.wall import NO_WALL
from tautwave.rig.support import inertia_params
from tautwave.simulation import simulate
from tests.lab.port.rigs import IMPOSED, bench_rig, fastest

LAWS = {
    "position": "{law: position, pairs: {lever: {stiffness: 25.4, damping: 0.121}}}",
    "wave": "{law: wave, pairs: {lever: {wave_impedance: 0.06, wave_filter_hz: 200, "
    "pole_master: 0.5, pole_slave: 0.5}}}",
}
LOWER = 1.1e-3
"""[kg m^2] Of 1.584e-3, what the levers of `bench.port.rigs` surely have."""

SECONDS, BEGUN_S, FREQUENCY, AMPLITUDE = 3.0, 1.0, 1.0, 0.2
PERIOD, STEPS = 1e-3, 400
INF = math.inf


class Felt(NamedTuple):
    """What a hand feels that moves the pair freely, and the most that the account gave [J]."""

    inertia: float
    damping: float
    given: float


def lightened_rig(law: str, keys: dict[str, float] | None, noise: float, seconds: float) -> Rig:
    """Return the bench with what the motors take off on both sides, moved at 1 Hz."""
    hand = f"{{type: multisine, ramp_s: 0.3, components: [[{FREQUENCY}, {AMPLITUDE}, 0.0]]}}"
    rig = bench_rig(LAWS[law], hand, "{type: free}", noise=noise, seconds=seconds, grip=IMPOSED)
    sides = {}
    for side in ("master", "slave"):
        whole = getattr(rig, side)
        axis = whole.axes["lever"]
        friction = {"value": 0.025, "lower": 0.02, "source": "identified"}
        model = {**axis.model_dump(), "coulomb": friction, "compensation": keys}
        own = type(axis).model_validate(model)
        sides[side] = whole.model_copy(update={"axes": {"lever": own}})
    return rig.model_copy(update=sides)


def felt(
    law: str,
    keys: dict[str, float] | None,
    noise: float,
    seconds: float = SECONDS,
    engine: str | None = None,
) -> Felt:
    """Return what is felt: effort on the hand over its motion, at the motion's frequency."""
    rig = lightened_rig(law, keys, noise, seconds)
    run = simulate(rig, engine=engine or fastest(rig))
    moving = run["time_s"] > BEGUN_S
    turn = 2.0 * math.pi * FREQUENCY
    time = run["time_s"][moving]
    waves = np.stack(
        [np.cos(turn * time), np.sin(turn * time), np.cos(3.0 * turn * time),
         np.sin(3.0 * turn * time), np.ones_like(time)], axis=1,
    )  # fmt: skip
    fits = [
        np.linalg.lstsq(waves, run[f"true.master.lever.{what}"][moving], rcond=None)[0]
        for what in ("hand_effort", "position")
    ]
    effort, position = (complex(fit[0], -fit[1]) for fit in fits)
    stiffness = effort / position
    given = sum(
        max(0.0, -float(np.min(run[f"lever.inertia_{side}.absorbed"]))) if keys else 0.0
        for side in ("master", "slave")
    )
    return Felt(-stiffness.real / turn**2, stiffness.imag / turn, given)


class Attack(NamedTuple):
    """One adversary: what it got beyond friction, and what is claimed [J]."""

    given: float
    claimed: float


def attack(seed: int, *, account: bool = True) -> Attack:
    """Let somebody strong shake a lever so as to get as much as there is; seed by seed.

    The lever moves as imposed, mostly at the frequency where the observer is late by a quarter.
    """
    draw = np.random.default_rng((seed, 33))
    inertia = float(np.exp(draw.uniform(np.log(3e-4), np.log(1e-2))))
    late, noise = int(draw.integers(0, 4)), float(draw.choice((0.0, 1e-4)))
    limit = 20.0
    axis = Axis.model_validate(
        {"bus": "b", "id": 1, "kind": "rotary", "effort_limit": 1.0, "velocity_limit": limit,
         "inertia": {"value": inertia, "lower": float(draw.uniform(0.5, 1.0)) * inertia,
                     "source": "drawn"},
         "coulomb": float(draw.choice((0.0, 0.02))), "position_noise": noise,
         "compensation": {"inertia": float(draw.uniform(0.1, 0.9)), "inertia_coulomb": 1.0,
                          "inertia_hz": float(draw.uniform(5.0, 60.0)),
                          "inertia_reserve": float(draw.uniform(1e-4, 1e-3))}}
    )  # fmt: skip
    assert axis.inertia is not None
    known = CoupledAxis(
        PERIOD, 1.0, axis.inertia.lower, 0.0, noise, late, 0.0, velocity_limit=limit
    )
    taken = axis.compensation.inertia if axis.compensation else 0.0
    own = inertia_params(axis, known, taken, axis.coulomb.value)
    funds = own.account.reserve + own.account.debt
    if not account:
        own = own._replace(account=own.account._replace(reserve=INF, capacity=INF))
    half = 0.5 * PERIOD / axis.inertia.lower
    free = NO_LIMITS
    site = SiteParams(
        PERIOD, half, NO_WALL, free, 1.0, 0.0, has_wall=False, inertia=own, compensates_inertia=True
    )
    p = AxisParams(site, 0.5 * PERIOD, 0.0, INF, 1.0, late, 0, True, 1, 0.5 * PERIOD, None)
    assert axis.compensation is not None
    swing = 2.0 * math.pi * axis.compensation.inertia_hz * float(draw.choice((0.2, 0.5, 1.0, 2.0)))
    size = float(draw.uniform(0.05, 0.9)) * limit / swing
    noises = (noise * draw.standard_normal(STEPS + 1)).tolist()
    s = AxisState(position=noises[0])
    start_inertia(s, p)
    under_way = [0.0] * (late + 1)
    given = most = path = before = 0.0
    read = s.position
    for k in range(1, STEPS + 1):
        at = size * math.sin(swing * PERIOD * k)
        s.inertia.sum = under_way[0]
        given -= under_way[0] * (at - before)
        path += abs(at - before)
        moved = at + noises[k] - read
        before, read = at, at + noises[k]
        s.position = read
        close_inertia(s, p, moved, 1.0)
        under_way = [*under_way[1:], lighten(s, p, moved / PERIOD, INF)]
        most = max(most, given - axis.coulomb.lower * path)
    unseen = own.most * (1 + late) * (limit * PERIOD + 10.0 * noise) + 10.0 * noise * own.most
    drawn = 5.0 * noise * own.most * math.sqrt(STEPS)
    return Attack(most, funds + unseen + drawn)


class Attacks(NamedTuple):
    """Of many adversaries: how many got more than the claim, and the greatest share of it."""

    over: int = 0
    share: float = 0.0

    def with_other(self, other: Attacks) -> Attacks:
        """Return the tally of both."""
        return Attacks(self.over + other.over, max(self.share, other.share))


def attacks_of(seeds: range, *, account: bool) -> Attacks:
    """Return what some adversaries got."""
    found = Attacks()
    for seed in seeds:
        one = attack(seed, account=account)
        found = found.with_other(Attacks(int(one.given > one.claimed), one.given / one.claimed))
    return found


def inertia_tables(runs: int, made: Sequence[Attacks]) -> tuple[list[Table], list[Goal]]:
    """Return what is felt, and how often an adversary got more than is claimed, with goals.

    `made` of so many `runs` with the account, and without it.
    """
    rows: list[list[Value]] = []
    off = 0.0
    for name in LAWS:
        for noise in (1.5e-5, 9e-5):
            bare = felt(name, None, noise)
            rows.append([name, 1e5 * noise, 0.0, 1e3 * bare.inertia, 0.0, 0.0, 1e3 * bare.damping,
                         0.0])  # fmt: skip
            for share in (0.4, 0.8):
                one = felt(name, {"inertia": share, "inertia_coulomb": 0.2}, noise)
                stated = 2.0 * share * LOWER
                less = bare.inertia - one.inertia
                rows.append([name, 1e5 * noise, share, 1e3 * one.inertia, 1e3 * stated, 1e3 * less,
                             1e3 * one.damping, 1e3 * one.given])  # fmt: skip
                off = max(off, abs(less / stated - 1.0))
    attacks: list[list[Value]] = [
        [name, runs, one.over, one.share]
        for name, one in zip(("with its account", "without"), made, strict=True)
    ]
    tables = [
        Table(
            "Inertia in free motion, by share",
            "The same bench moved at 1 Hz, 0.2 of its friction paying: inertia and damping that "
            "the hand feels of both levers, how much less is stated, and how much less there is.",
            ("law", "noise_1e-5", "share", "felt_g m2", "less, stated", "less", "damping_mNms",
             "given_mJ"),
            rows,
        ),
        Table(
            "Adversaries of the inertia's account",
            "A lever that somebody strong shakes where the observer is late: small reserves, any "
            "delay, noise; friction that pays or none.",
            ("effort", "runs", "over the claim", "greatest over the claim"),
            attacks,
        ),
    ]  # fmt: skip
    goals = [
        Goal("inertia: less over stated, off 1", 0.1, "", off),
        Goal("adversaries over the claim", 0.0, "", float(made[0].over)),
        Goal("adversaries over it without the account", 1, "", float(made[1].over), at_least=True),
    ]
    return tables, goals
