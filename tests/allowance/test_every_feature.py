"""Shares with every combination of features, of allowance and controller, against a rig's keys."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping

import pytest

from tautwave.config import Rig
from tautwave.errors import ConfigError
from tautwave.rig import axis_allowance, command_delays
from tautwave.rig.carrying import side_loads
from tautwave.rig.controller import axis_params
from tautwave.rig.operated.brakes import brake_params
from tests.rigs.running import Tree, rig_of, tree

SPRING = {"stiffness": 100.0, "damping": 0.05}
FEATURES: Mapping[str, Mapping[str, Tree]] = {
    "law": {
        "position": {"coupling.law": "position", "coupling.pairs.a": SPRING},
        "pd_damping": {"coupling.law": "pd_damping", "coupling.pairs.a": SPRING},
        "account": {"coupling.law": "position", "coupling.pairs.a": SPRING, "coupling.account": {}},
        "mediated": {"coupling.law": "mediated", "coupling.pairs.a": {}, "coupling.account": {}},
        "wave": {},
    },
    "load": {"none": {}, "carried": {"master.axes.a.load": {"constant": 4.0}}},
    "wall": {
        "none": {},
        "stiff": {"coupling.pairs.a.wall_master": {"position": 0.1, "stiffness": 900.0}},
        "limited": {
            "coupling.pairs.a.wall_master": {
                "position": 0.1, "stiffness": 900.0, "damping": 0.1, "effort_limit": 2.5}},
        "controlled": {
            "coupling.pairs.a.wall_master": {
                "position": 0.1, "stiffness": 4e4, "passivity_control": True}},
    },
    "compensation": {
        "none": {},
        "friction": {"master.axes.a.compensation": {"coulomb": 0.5, "viscous": 0.4}},
        "inertia": {"master.axes.a.compensation": {"inertia": 0.3, "inertia_coulomb": 0.4}},
        "both": {"master.axes.a.compensation": {
            "coulomb": 0.5, "viscous": 0.4, "inertia": 0.3, "inertia_coulomb": 0.4}},
    },
    "rate": {"none": {}, "limited": {"master.axes.a.effort_rate_limit": 800.0}},
    "steps": {"none": {}, "coarse": {"master.axes.a.effort_quantum": 0.01}},
    "late": {"none": {}, "a period": {"buses.hand.options": {"command_delay_s": 0.001}}},
    "brake": {"none": {}, "held": {"operate": {"hold_effort_share": 0.5}}},
    "stall": {"none": {}, "bounded": {"master.axes.a.stall_energy_j": 0.05}},
}  # fmt: skip
"""What an axis may be asked for at once, each in every way."""

ALWAYS: Tree = {
    "duration_s": 1.0,
    **{f"{side}.axes.a.effort_limit": 10.0 for side in ("master", "slave")},
    **{f"{side}.axes.a.velocity_limit": 2.0 for side in ("master", "slave")},
    **{f"{side}.axes.a.position_range": [-1.0, 1.0] for side in ("master", "slave")},
    **{f"{side}.axes.a.damping": 0.9 for side in ("master", "slave")},
    **{f"{side}.axes.a.coulomb": 0.3 for side in ("master", "slave")},
    "slave.axes.a.effort_rate_limit": 2000.0,
}


def combinations() -> Iterator[tuple[str, ...]]:
    yield from itertools.product(*(ways for ways in FEATURES.values()))


def rig_with(chosen: tuple[str, ...]) -> Rig | None:
    """Return a rig with features in the ways that were chosen; None where they cannot be at once.

    What cannot is said by a rig's own checks.
    """
    changes = [ways[way] for ways, way in zip(FEATURES.values(), chosen, strict=True)]
    data = tree(ALWAYS, *changes)
    try:
        return rig_of(data)
    except ConfigError as error:
        if "stall_energy_j" in str(error) or "effort_rate_limit" in str(error):
            return None
        raise


def add_up(rig: Rig) -> None:
    """Add up what all who act at an axis may send, against what the rig says that it has."""
    axis, delay = rig.axes["master.a"], command_delays(rig)["master.a"]
    has = axis_allowance(rig, "master.a", delay)
    rate = math.inf if axis.effort_rate_limit is None else axis.effort_rate_limit
    most = axis.effort_limit * (1.0 + 1e-12)
    assert has.load_effort + has.wall_effort + has.compensation_effort + has.coupling_effort <= most
    assert has.load_rate + has.wall_rate + has.compensation_rate + has.coupling_rate <= rate * (
        1.0 + 1e-12
    )
    spent = has.compensated_damping + has.load_damping + has.wall_damping
    assert has.coupling_damping == 0.0 or spent + has.coupling_damping <= axis.damping.lower + 1e-12
    spent = has.compensated_coulomb + has.paying_coulomb + has.load_coulomb
    assert has.coupling_coulomb == 0.0 or spent + has.coupling_coulomb <= axis.coulomb.lower + 1e-12

    site = axis_params(rig, "master.a", delay, 0).site
    loads, _ = side_loads(rig, command_delays(rig))
    carried = [one for load in loads for one in load.axes if one.name == "master.a"]
    beside = sum(one.reserve for one in carried)
    assert beside + site.limit.effort <= most
    step = site.limit.effort_step + sum(one.step for one in carried)
    assert step <= rate * rig.period_s * (1.0 + 1e-12)
    if math.isfinite(site.clip):  # a spring relies on its share: the others' beside it fit, too
        lift = site.inertia.most if site.compensates_inertia else 0.0
        wall = site.wall_clip if site.has_wall else 0.0
        assert site.clip + wall + lift + beside <= most
    assert site.limit.stop_damping + has.load_damping <= axis.damping.lower * (1.0 + 1e-12)
    paid = site.compensation.viscous + has.load_damping
    assert paid <= axis.damping.lower
    if rig.operate is not None:
        brake = brake_params(rig, "master.a", delay)
        assert brake is not None
        assert brake.stiffness * brake.slip + beside <= most


def tried(every: int) -> tuple[int, set[tuple[str, str]]]:
    """Add up every so many-th combination; return how many there were, and what they were of."""
    count, seen = 0, set()
    for at, chosen in enumerate(combinations()):
        if at % every:
            continue
        rig = rig_with(chosen)
        if rig is None:
            continue
        try:
            add_up(rig)
        except ConfigError as error:
            if "nothing is left for its coupling" in str(error):
                continue
            raise
        count += 1
        seen |= set(zip(FEATURES, chosen, strict=True))
    return count, seen


EVERY = {(name, way) for name, ways in FEATURES.items() for way in ways}


def test_shares_of_some_combinations_add_up_and_every_feature_is_among_them() -> None:
    """131 is no divisor of what there is of any feature."""
    count, seen = tried(131)
    assert count > 15
    assert seen == EVERY


@pytest.mark.slow
def test_shares_of_every_combination_add_up() -> None:
    count, seen = tried(11)
    assert count > 200
    assert seen == EVERY
