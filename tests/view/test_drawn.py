"""Arms as a page draws them: points of their chains, forces on their tips, walls in space."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from tautwave.config import load_rig
from tautwave.view.drawn import Drawn

CONFIGS = Path(__file__).parents[2] / "configs"
ANGLES = {
    "joints.master.shoulder.position": 0.6,
    "joints.master.elbow.position": 1.2,
    "joints.slave.shoulder.position": -0.3,
    "joints.slave.elbow.position": 1.6,
}
FORCES = {
    "master.x.port_effort": 2.0,
    "master.y.port_effort": -1.0,
    "space.hand.disc.fx": 3.0,
    "space.hand.disc.fy": 4.0,
    "space.hand.disc.fz": 0.0,
}


def planar(columns: list[str]) -> Drawn:
    return Drawn(columns, load_rig(CONFIGS / "arms" / "planar.yaml"))


def tip(links: tuple[float, float], one: float, two: float) -> tuple[float, float]:
    a, b = links
    return (
        a * math.cos(one) + b * math.cos(one + two),
        a * math.sin(one) + b * math.sin(one + two),
    )


def test_two_flat_arms_stand_where_their_joints_are_with_the_forces_on_their_tips() -> None:
    row = {**ANGLES, **FORCES}
    drawing = planar(list(row))
    master, slave = drawing.pose(list(row.values()))
    assert master["points"][-1][:2] == pytest.approx(tip((0.18, 0.16), 0.6, 1.2))
    assert slave["points"][-1][:2] == pytest.approx(tip((0.30, 0.25), -0.3, 1.6))
    assert master["points"][0] == (0.0, 0.0, 0.0)
    assert master["forces"]["coupling"] == [-2.0, 1.0, 0.0]  # what resists a hand pushes it back
    assert master["forces"]["disc"] == [3.0, 4.0, 0.0]
    facts = drawing.facts()
    assert [(arm["side"], arm["flat"]) for arm in facts] == [("master", True), ("slave", True)]
    assert [arm["reach"] for arm in facts] == pytest.approx([0.34, 0.55])
    lines = facts[0]["walls"]["disc"]["lines"]
    assert {round(math.dist(p, (0.12, 0.34, p[2])), 9) for line in lines for p in line} == {0.06}
    (patch,) = facts[1]["walls"]["fence"]["patches"]
    assert {round(x, 9) for x, _, _ in patch} == {0.36}


def test_an_arm_without_a_sample_stays_and_one_of_another_site_is_not_drawn() -> None:
    mine = {name: angle for name, angle in ANGLES.items() if ".slave." in name}
    drawing = planar(["time_s", *mine])
    (before,) = drawing.pose([0.0, *mine.values()])
    (after,) = drawing.pose([0.1, math.nan, 0.0])
    assert before["points"] == after["points"]
    assert [arm["side"] for arm in drawing.facts()] == ["slave"]


def test_axes_of_a_side_are_an_arm_in_space_and_a_rig_without_chains_has_none() -> None:
    rig = load_rig(CONFIGS / "arms" / "koch.yaml")
    names = [f"{side}.{name}.position" for side in ("master", "slave")
             for name in getattr(rig, side).axes]  # fmt: skip
    drawing = Drawn(names, rig)
    assert [arm["flat"] for arm in drawing.facts()] == [False, False]
    assert [len(arm["points"]) for arm in drawing.pose([0.1] * len(names))] == [8, 8]
    bench = load_rig(CONFIGS / "bench-1dof-loopback.yaml")
    assert Drawn(["master.lever.position"], bench).facts() == []
