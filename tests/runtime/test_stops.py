"""What a stop says: the axis, the limit it passed and what it measured; when a scene runs away."""

from __future__ import annotations

import math
from array import array
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace

import pytest

from tautwave.config import load_rig
from tautwave.controller.stops import guard_sentence, overrun_sentence, unarmed_sentence
from tautwave.laws.limit import RUNAWAY, LimitParams
from tautwave.rig import build_rig
from tautwave_scenes.runtime.axes import SceneRun

CONFIGS = Path(__file__).parents[2] / "configs"

LIMIT = LimitParams(2.0, 0.1, 0.0, 0.5, -math.inf, 0.25, 1.0)


@pytest.mark.parametrize(
    ("code", "passed"),
    [
        (1, "left its position range of -inf to 0.25 m at 1.500 s"),
        (2, "exceeded its velocity limit of 0.5 m/s at 1.500 s"),
        (3, "is not finite at 1.500 s"),
        (RUNAWAY, "over a million times its limit of 2 N at 1.500 s"),
    ],
)
def test_a_guard_names_its_limit_with_units(code: int, passed: str) -> None:
    reported = guard_sentence("slave.a", code, "m", LIMIT, 0.3, -0.75, 1.5)
    assert reported.startswith("slave.a ")
    assert reported.endswith(f"{passed}: position 0.3 m, velocity -0.75 m/s")


def test_what_keeps_pairs_from_engaging_is_measured_against_named_limits() -> None:
    reported = unarmed_sentence([("master.a", "rad", LIMIT), ("slave.a", "m", LIMIT)])
    assert "10% of its effort limit (master.a 2 N m, slave.a 2 N) at rest" in reported


def test_an_overrun_says_what_was_allowed() -> None:
    reported = overrun_sentence(60, 50, 1e-3, 2.25)
    assert reported.startswith("60 slots of 1 ms were missed in a row at 2.250 s")
    assert "(loop.overrun_limit: 50)" in reported


def scene_with(pulls: list[float], handed: list[list[float]], *more: str) -> SceneRun:
    """Return a scene of one port whose network pulls as given; `handed`: what pushed it."""
    built = build_rig(load_rig(CONFIGS / "scene-resonator.yaml", more), clock="fake")
    scene = built.control.scene
    assert scene is not None

    def advance(_: Sequence[float], forces: Sequence[float]) -> list[float]:
        handed.append(list(forces))
        if math.isinf(pulls[0]):
            raise OverflowError
        return [pulls.pop(0)]

    scene.model = SimpleNamespace(advance=advance)  # type: ignore[assignment]
    scene.account = None
    return scene


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("beyond", [math.nextafter(4e7, math.inf), math.inf, math.nan])
def test_a_scene_that_asks_for_over_a_million_times_the_limit_runs_away(
    sign: float, beyond: float
) -> None:
    """20 N through a scale of 0.5: a pull of 40 MN is just endured, and the last effort kept."""
    pulls = [sign * 4e7, sign * beyond, 1.0]
    scene = scene_with(pulls, [], "scene.ports.stylus.position_scale=0.5")
    (axis,) = scene.axes
    scene.think(0, 1.0)
    assert (scene.ended, scene.efforts, axis.guard) == (0, [sign * 2e7], 0)
    scene.think(0, 1.0)
    assert (scene.ended, scene.efforts, axis.guard) == (RUNAWAY, [sign * 2e7], RUNAWAY)
    left = len(pulls)
    scene.think(0, 1.0)
    assert (scene.ended, scene.efforts, len(pulls)) == (RUNAWAY, [sign * 2e7], left)


def test_a_scene_steps_over_slots_that_were_missed_with_their_own_forces() -> None:
    handed: list[list[float]] = []
    scene = scene_with([1.0] * 10, handed)
    scene.forces[:5] = memoryview(array("d", (3.0, 4.0, 5.0, 6.0, 0.0)))
    scene.pushed = 4
    for skipped in (0, 2, 1):
        scene.think(skipped, 1.0)
    assert handed == [[3.0], [4.0], [5.0], [6.0], [0.0], [0.0]]
    assert scene.slot == 6
