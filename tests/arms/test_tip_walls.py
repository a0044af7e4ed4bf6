"""A wall at the tip of an arm: its account in the joints' work, guards, noise, late commands."""

from __future__ import annotations

import math
import random
from typing import Any

import pytest
from pydantic import ValidationError

from tautwave_drivers.arm.parts import Effort, TipWall
from tautwave_drivers.arm.walls import ArmWall

MASS, PERIOD = 0.1, 1e-3
SLIDES = [1.0 if i == j else 0.0 for j in range(3) for i in range(6)]
"""Derivatives of a tip that three sliding joints move along x, y and z."""
PATH = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
ROD: dict[str, Any] = {"shape": "cylinder", "radius": 0.2, "axis": (0.0, 0.0, 1.0)}


def bounce(
    delay: int, speed: float, missing: float = 0.0, seed: int = 0, **keys: Any
) -> tuple[float, TipWall]:
    """Throw a mass down at a floor; return its speed afterwards over that before.

    `missing` is the share of samples that do not come.
    """
    rng = random.Random(seed)
    wall = ArmWall(shape="plane", normal=(0.0, 0.0, 1.0), stiffness=1000.0, **keys)
    tip = TipWall("floor", wall, [0.0] * 3, Effort(3, delay, 0.0), [1.0 / MASS] * 3, PERIOD)
    x, v = [0.0, 0.0, 0.0133], [0.4 * speed, 0.0, -speed]
    seen, stride = list(x), [0.0] * 3
    waiting = [[0.0] * 3 for _ in range(delay)]
    touched = False
    for _ in range(3000):
        waiting.append(tip.push(seen, SLIDES, stride))
        force = waiting.pop(0)
        touched = touched or any(force)
        if touched and not any(any(sent) for sent in (force, *waiting)) and v[2] > 0.0:
            break
        moved = [w * PERIOD + 0.5 * f / MASS * PERIOD**2 for w, f in zip(v, force, strict=True)]
        v = [w + f / MASS * PERIOD for w, f in zip(v, force, strict=True)]
        x = [a + b for a, b in zip(x, moved, strict=True)]
        tip.effort.pass_slots(1)
        if rng.random() >= missing:
            moved = [a - b for a, b in zip(x, seen, strict=True)]
            stride = [step / tip.effort.slots for step in moved]
            seen = x
            tip.close(moved)
            tip.effort.begin()
    assert touched
    return math.hypot(*v) / math.hypot(0.4 * speed, speed), tip


@pytest.mark.parametrize("seed", range(20))
def test_a_host_that_stalls_gives_no_more_than_check_states_of_each_skipped_period(
    seed: int,
) -> None:
    """A skipped period holds the force on: force limit times the greatest speed, no more."""
    rng = random.Random(seed)
    limit, speed = 30.0, 1.5
    wall = ArmWall(shape="plane", normal=(0.0, 0.0, 1.0), stiffness=1000.0, force_limit=limit)
    tip = TipWall("floor", wall, [0.0] * 3, Effort(3, 0, 0.0), [1.0 / MASS] * 3, PERIOD)
    x, v, moved = 0.005, -speed, 0.0
    skipped = 0
    for _ in range(300):
        force = tip.push([0.0, 0.0, x], SLIDES, [0.0, 0.0, moved])[2]
        slots = 1 + rng.choice((0, 0, 0, 1, 4))
        skipped += slots - 1 if force else 0
        before = x
        for _ in range(slots):
            x += v * PERIOD + 0.5 * force / MASS * PERIOD**2
            v += force / MASS * PERIOD
        tip.effort.pass_slots(slots)
        tip.close([0.0, 0.0, x - before])
        tip.effort.begin()
        moved = (x - before) / slots
        assert -tip._absorbed <= skipped * limit * max(speed, abs(v)) * PERIOD + 1e-12
    assert v > 0.0


@pytest.mark.parametrize("speed", [0.3, 1.0, 3.0])
def test_a_mass_comes_back_no_faster(speed: float) -> None:
    ratio, tip = bounce(0, speed, force_limit=1e6)
    assert 0.8 < ratio <= 1.0 + 1e-9
    assert tip._absorbed >= -1e-12
    ratio, _ = bounce(0, speed, force_limit=1e6, friction=0.5)
    assert ratio <= 1.0 + 1e-9


def test_late_commands_are_paid_from_what_is_left() -> None:
    ratio, _ = bounce(2, 1.0, force_limit=1e6)
    assert ratio <= 1.0 + 1e-9


@pytest.mark.parametrize(("delay", "most"), [(0, 1.0 + 1e-9), (2, 1.03)])
def test_a_wall_does_not_push_for_longer_than_it_foresaw(delay: int, most: float) -> None:
    """Its force would act on while samples are missing; of late commands only those under way."""
    ratios = [bounce(delay, 1.0, 0.3, seed, force_limit=1e6)[0] for seed in range(40)]
    assert max(ratios) <= most


def test_what_a_wall_owes_the_next_contact_pays() -> None:
    wall = ArmWall(shape="plane", normal=(0.0, 0.0, 1.0), stiffness=1000.0)
    tip = TipWall("floor", wall, [0.0] * 3, Effort(3, 0, 0.0), [10.0] * 3, PERIOD)
    tip._account = -1e-3  # a stall of the host: its force acted on
    tip.push([0.0, 0.0, 0.01], SLIDES, [0.0] * 3)
    tip.push([0.0, 0.0, -0.01], SLIDES, [0.0, 0.0, 1e-4])
    assert tip._force == [0.0] * 3
    assert tip._account == -1e-3


def test_nothing_bounces_off_a_guard() -> None:
    ratio, _ = bounce(0, 1.0, force_limit=1e6, guard=True)
    loose, _ = bounce(0, 1.0, force_limit=1e6)
    assert ratio < 0.5 < loose


def test_a_force_stays_below_its_limit() -> None:
    _, tip = bounce(0, 3.0, force_limit=5.0)
    tip.push([0.0, 0.0, -0.1], SLIDES, [0.0, 0.0, -1e-3])
    assert tip._force[2] == pytest.approx(5.0)


def test_what_noise_costs_a_held_force_is_put_back_and_booked() -> None:
    wall = ArmWall(shape="plane", normal=(0.0, 0.0, 1.0), stiffness=1000.0)
    tip = TipWall("floor", wall, [1e-8] * 3, Effort(3, 0, 0.0), [10.0] * 3, PERIOD)
    for _ in range(4):
        tip.push([0.0, 0.0, -0.01], SLIDES, [0.0] * 3)
    row = [0.0] * 7
    assert tip.fill(row, 0) == 7
    assert row[6] == pytest.approx(4 * 1000.0 * 3e-8)


@pytest.mark.parametrize("sigma", [1e-6, 1e-5, 1e-4])
def test_what_begins_inside_a_wall_gets_no_more_than_the_stated_power(sigma: float) -> None:
    """Nothing is in the account; every second stride seems to go further in, by noise alone."""
    wall = ArmWall(shape="plane", normal=(0.0, 0.0, 1.0), stiffness=1000.0)
    softness = [1.0 / MASS] * 3
    tip = TipWall("floor", wall, [sigma**2] * 3, Effort(3, 0, 0.0), softness, PERIOD)
    tip._proxy = (0.0, 0.0, 0.0)
    rng = random.Random(0)
    x, v, given = -0.1, 0.0, 0.0
    seen, stride = x, 0.0
    for _ in range(3000):
        force = tip.push([0.0, 0.0, seen], SLIDES, [0.0, 0.0, stride])[2]
        v += (force - 2.0 * v) / MASS * PERIOD
        x += v * PERIOD
        given += force * v * PERIOD
        before, seen = seen, x + rng.gauss(0.0, sigma)
        stride = seen - before
        tip.effort.pass_slots(1)
        tip.close([0.0, 0.0, stride])
        tip.effort.begin()
    assert given <= tip._granted


@pytest.mark.parametrize(
    ("keys", "depth"),
    [
        ({"shape": "plane", "normal": (2.0, 0.0, 0.0), "centre": (0.2, 5.0, 0.0)}, 0.02),
        ({"shape": "sphere", "radius": 0.2}, 0.02),
        ({"shape": "cylinder", "radius": 0.2, "axis": (0.0, 0.0, 3.0)}, 0.02),
        ({"shape": "cylinder", "radius": 0.4, "axis": (1.0, 0.0, 0.0), "length": 0.4}, 0.02),
        ({"shape": "box", "size": (0.4, 0.8, 1.0)}, 0.02),
        ({"shape": "box", "size": (0.8, 0.4, 1.0), "turn": (0.0, 0.0, math.pi / 2)}, 0.02),
        ({"shape": "box", "size": (0.8, 0.4, 1.0), "centre": (-0.2, 0.0, 0.0)}, 0.02),
        ({"shape": "convex", "planes": ((1.0, 0.0, 0.0, 0.2), (-1.0, 0.0, 0.0, 0.2))}, 0.02),
        ({"shape": "path", "points": ((0.25, -1.0, 0.0), (0.25, 1.0, 0.0)), "radius": 0.05}, 0.02),
    ],
    ids=lambda given: given["shape"] if isinstance(given, dict) else "",
)
def test_every_shape_pushes_out_where_its_keys_put_it(keys: dict[str, Any], depth: float) -> None:
    wall = ArmWall(stiffness=1000.0, force_limit=1e6, **keys)
    tip = TipWall("body", wall, [0.0] * 3, Effort(3, 0, 0.0), [1.0 / MASS] * 3, PERIOD)
    assert tip.push([0.25, 0.0, 0.0], SLIDES, [0.0] * 3) == pytest.approx([0.0] * 3)
    moved = [-0.07, 0.0, 0.0]
    assert tip.push([0.18, 0.0, 0.0], SLIDES, moved) == pytest.approx([1e3 * depth, 0.0, 0.0])


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"shape": "path", "points": PATH, "friction": 0.2}, "a path has neither friction nor"),
        ({"shape": "path", "points": PATH, "guard": True}, "a path has neither friction nor"),
        ({"shape": "box", "size": (1.0, 1.0, 1.0), "hollow": True}, "only a sphere or an endless"),
        ({**ROD, "length": 0.4, "hollow": True}, "only a sphere or an endless cylinder is hollow"),
        ({"shape": "plane", "normal": (0.0, 0.0, 0.0)}, "a direction of length 0"),
        ({**ROD, "axis": (0.0, 0.0, 0.0)}, "a direction of length 0"),
        ({"shape": "convex", "planes": ((0.0, 0.0, 0.0, 1.0),)}, "a direction of length 0"),
    ],
)
def test_a_body_that_is_none_is_refused(keys: dict[str, Any], said: str) -> None:
    with pytest.raises(ValidationError, match=said):
        ArmWall(stiffness=1000.0, force_limit=1.0, **keys)


def test_a_sphere_and_an_endless_cylinder_may_be_hollow() -> None:
    for keys in ({"shape": "sphere", "radius": 0.2}, ROD):
        assert ArmWall(stiffness=1000.0, force_limit=1.0, hollow=True, **keys).hollow
