"""Both ends of a spring clip what they send at one constant, and a wall has a share of its own."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from tautwave import Stepper, simulate
from tautwave.config import Rig
from tautwave.laws.limit import LimitParams
from tautwave.laws.site import SiteParams, clip_coupling, render_wall
from tautwave.laws.wall import WallParams
from tautwave.rig import build_rig
from tautwave.rig.tuning import knobs_of
from tests.rigs.running import rig_of, tree

Array = npt.NDArray[np.float64]
INF = math.inf
FREE = LimitParams(effort=10.0)
WALL = WallParams(0.0, 1.0, 1000.0, 0.0, controlled=False)
SITE = SiteParams(1e-3, 1e-3, WALL, FREE, 1.0, 0.0, has_wall=True)


def spring_rig(*changes: dict[str, Any], **pair: Any) -> Rig:
    """A spring of 1000 N/m between motors of 20 N and 3 N."""
    keys = {"stiffness": 1000.0, "damping": 0.0, **pair}
    return rig_of(
        tree(
            {
                "coupling.law": "position",
                "coupling.pairs.a": keys,
                "master.axes.a.effort_limit": 20.0,
                "slave.axes.a.effort_limit": 3.0,
                "master.axes.a.damping": 5.0,
                "slave.axes.a.damping": 5.0,
            },
            *changes,
        )
    )


def moved(rig: Rig, master: Sequence[float], slave: Sequence[float]) -> dict[str, Array]:
    """Move both ends; return what is recorded."""
    with Stepper(rig, outside=("master", "slave"), duration_s=10.0) as one:
        for places in zip(master, slave, strict=True):
            one.step(dict(zip(("master.a", "slave.a"), places, strict=True)))
        return {name: np.asarray(one.rows[name]) for name in one.rows.columns}


PULLED = np.concatenate([np.zeros(5), np.linspace(0.0, 0.02, 40), np.full(10, 0.02)])
STILL = np.zeros(len(PULLED))


@pytest.mark.parametrize("force_scale", [1.0, 2.0])
def test_both_ends_send_no_more_than_the_weaker_one_can(force_scale: float) -> None:
    rows = moved(spring_rig(force_scale=force_scale), PULLED, STILL)
    assert rows["master.a.port_effort"].max() == 3.0 / force_scale
    assert rows["slave.a.port_effort"].min() == -3.0
    assert np.array_equal(rows["slave.a.port_effort"], -force_scale * rows["master.a.port_effort"])


def test_the_engage_ramp_raises_both_clips_alike() -> None:
    """Not each end's own ceiling, which are unlike."""
    rows = moved(spring_rig({"coupling.engage_ramp_s": 0.1}), PULLED, STILL)
    sent = rows["master.a.port_effort"]
    assert 0.5 < sent.max() < 2.0
    assert np.allclose(rows["slave.a.port_effort"], -sent, rtol=0.0, atol=1e-12)


def test_a_wall_takes_nothing_from_the_coupling() -> None:
    """Half the motor each: pressed into the wall, the coupling still sends its share."""
    walled = spring_rig(wall_slave={"position": 0.0, "stiffness": 1000.0})
    rows = moved(walled, -PULLED, PULLED)
    assert rows["slave.a.wall_effort"].max() == 1.5
    assert rows["slave.a.port_effort"].max() == 1.5
    assert rows["master.a.port_effort"].min() == -1.5
    given = spring_rig(wall_slave={"position": 0.0, "stiffness": 1000.0, "effort_limit": 1.0})
    rows = moved(given, -PULLED, PULLED)
    assert (rows["slave.a.wall_effort"].max(), rows["slave.a.port_effort"].max()) == (1.0, 2.0)


def test_a_walls_share_holds_beside_waves_too() -> None:
    waves = tree(
        {
            "coupling.pairs.a.wall_slave": {
                "position": 0.0, "stiffness": 1000.0, "effort_limit": 1.0
            },
            "slave.axes.a.damping": 5.0,
        }
    )  # fmt: skip
    rows = moved(rig_of(waves), STILL, PULLED)
    assert rows["slave.a.wall_effort"].max() == 1.0


def test_what_does_not_bind_changes_no_bit() -> None:
    """Within its clip a coupling is what it is without one."""
    assert clip_coupling(SITE, 3.7, 10.0, 10.0) == 3.7
    clipped = SITE._replace(clip=4.0, wall_clip=2.0)
    for asked in (3.7, -4.0, -0.0):
        sent = clip_coupling(clipped, asked, 10.0, 10.0)
        assert (sent, math.copysign(1.0, sent)) == (asked, math.copysign(1.0, asked))
    assert clip_coupling(clipped, 5.0, 10.0, 10.0) == 4.0
    assert clip_coupling(clipped, -5.0, 2.5, 10.0) == -1.0


@pytest.mark.parametrize(
    ("depth", "ceiling", "sent"), [(1e-3, 10.0, 1.0), (5e-3, 10.0, 2.0), (5e-3, 5.0, 1.0)]
)
def test_a_wall_is_clipped_at_its_share_of_the_ramp(
    depth: float, ceiling: float, sent: float
) -> None:
    clipped = SITE._replace(clip=4.0, wall_clip=2.0)
    assert render_wall(clipped, 0.0, False, depth, 0.0, 0.0, ceiling) == pytest.approx(sent)
    assert render_wall(SITE, 0.0, False, depth, 0.0, 0.0, ceiling) == pytest.approx(
        min(1e3 * depth, ceiling)
    )


def test_a_limit_that_is_tuned_clips_both_ends_from_the_same_period_on() -> None:
    """The lower of both ceilings, as a share of its limit; it rises while neither is clipped."""
    rig = spring_rig()
    control = build_rig(rig, clock="fake").control
    knobs = {knob.path: knob.turning for knob in knobs_of(rig, control)}
    master, slave = (knobs[f"{side}.axes.a.effort_limit"] for side in ("master", "slave"))

    def clips() -> list[float]:
        return [p.site.clip for p in control.params]

    assert clips() == [3.0, 3.0]
    slave.turn(1.5)
    assert clips() == [1.5, 1.5]
    master.turn(5.0)
    assert clips() == [0.75, 0.75]
    assert [p.ceiling for p in control.params] == [5.0, 1.5]
    assert master.ready(20.0)
    for at, asked in ((0, 0.8), (1, -0.8)):
        control.axes[at].asked = asked
        assert not master.ready(20.0)
        assert not slave.ready(3.0)
        assert slave.ready(1.0)
        control.axes[at].asked = 0.0
    control.axes[1].depth = 1e-3
    assert not master.ready(20.0)
    control.axes[1].depth = 0.0
    slave.turn(3.0)
    assert clips() == [0.75, 0.75]
    master.turn(20.0)
    assert clips() == [3.0, 3.0]


def test_a_limit_of_a_law_with_ports_clips_its_own_axis_alone() -> None:
    rig = rig_of(tree())
    control = build_rig(rig, clock="fake").control
    knobs = {knob.path: knob.turning for knob in knobs_of(rig, control)}
    knobs["slave.axes.a.effort_limit"].turn(1.5)
    assert [p.site.clip for p in control.params] == [INF, INF]
    assert sorted(p.ceiling for p in control.params) == [1.5, 1000.0]
    assert dataclasses.is_dataclass(control.axes[0])


@pytest.mark.slow
@pytest.mark.timeout(300)  # it compiles a law
def test_compiled_code_clips_to_the_bit_alike() -> None:
    pytest.importorskip("numba")
    hand = {"mass": 0.05, "damping": 1.0, "stiffness": 3e3, "reference": {
        "type": "minimum_jerk", "waypoints": [[0.1, 0.0], [0.3, 0.05], [0.6, -0.05]]}}  # fmt: skip
    rig = spring_rig(
        {
            "simulation.hand.a": hand,
            "simulation.environment.a": {"type": "spring", "position": 0.0, "stiffness": 500.0},
            "coupling.engage_ramp_s": 0.05,
        },
        wall_slave={"position": 0.002, "stiffness": 1000.0},
    )
    both = [simulate(rig, duration_s=0.8, engine=engine) for engine in ("compiled", "python")]
    assert np.array_equal(both[0].data, both[1].data, equal_nan=True)
    assert np.abs(both[0]["master.a.port_effort"]).max() == 1.5
