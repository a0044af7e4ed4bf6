"""Laws in space compiled: the same source gives the same bits as plain Python."""

from __future__ import annotations

import random
from types import FunctionType
from typing import Any

import numpy as np
import pytest

from tautwave.laws.space import damped, proxy, triangles, wall
from tautwave.models.chain import kinematics, task
from tests.arms.test_tip import SPATIAL, options_of, postures
from tests.laws.test_space_walls import SHAPES

LAWS = (
    triangles.first_hit, triangles.mesh_proxy, proxy._convex_proxy, proxy._round_proxy,
    proxy._path_proxy, proxy.proxy_of, wall.wall_proxy, wall.wall_force, wall.allowed_share,
)  # fmt: skip
CHAIN = (
    kinematics.chain_frames, kinematics.tip_pose, kinematics.fill_jacobian, task.task_place,
)  # fmt: skip


def compiled(functions: tuple[Any, ...]) -> dict[str, Any]:
    numba = pytest.importorskip("numba")
    known: dict[str, Any] = {}
    for function in functions:
        own = FunctionType(function.__code__, {**function.__globals__, **known})
        known[function.__name__] = numba.njit(error_model="numpy")(own)
    return known


@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.nightly
def test_coordinates_of_a_tip_are_the_same_compiled() -> None:
    law = compiled(CHAIN)["task_place"]
    options = options_of(SPATIAL, "arm")
    constants = options.task()
    for q in postures(options, 20):
        plain, fast = [0.0] * 42, np.zeros(42)
        assert task.task_place(constants, q, plain) == law(constants, np.array(q), fast)
        assert plain == fast.tolist()


@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.parametrize("shape", ["box", "mesh", "cylinder", "path"])
def test_a_wall_is_the_same_compiled(shape: str) -> None:
    laws = compiled(LAWS)
    p = wall.SpaceWallParams(SHAPES[shape], 1000.0, 1.0, 0.3, 50.0)
    numbers: Any = np.array(SHAPES[shape].numbers)  # of one type, whatever the shape
    packed = p._replace(surface=proxy.Surface(p.surface.kind, numbers))
    rng = random.Random(1)
    plain: Any = (0.2, 0.2, 0.2)
    fast = plain
    for _ in range(300):
        x = [rng.uniform(-0.12, 0.12) for _ in range(3)]
        *plain, depth = wall.wall_proxy(p, *plain, *x)
        *fast, same = laws["wall_proxy"](packed, *fast, *x)
        assert (*plain, depth) == (*fast, same)
        away = [a - b for a, b in zip(plain, x, strict=True)]
        assert wall.wall_force(p, *away, *x) == laws["wall_force"](packed, *away, *x)
        assert wall.allowed_share(0.1, *x[:2]) == laws["allowed_share"](0.1, *x[:2])


def test_the_share_of_a_wall_in_a_motor_is_the_same_compiled() -> None:
    law = compiled((wall.allowed_share,))["allowed_share"]
    rng = random.Random(2)
    for _ in range(300):
        most, wanted, other = (rng.uniform(-0.2, 0.2) for _ in range(3))
        assert wall.allowed_share(most, wanted, other) == law(most, wanted, other)


@pytest.mark.slow
def test_a_damped_inverse_is_the_same_compiled() -> None:
    law = compiled((damped.diagonalise, damped.damped_inverse))["damped_inverse"]
    rng = np.random.default_rng(3)
    for _ in range(20):
        jacobian = rng.normal(size=42)
        plain, fast = np.eye(6).ravel().tolist(), np.eye(6).ravel()
        scales = np.array([1.0, 1.0, 1.0, 0.2, 0.2, 0.2])
        here = damped.damped_inverse(jacobian.tolist(), plain, scales.tolist(), 0.05)
        there = law(jacobian, fast, scales, 0.05)
        assert here[0] == list(there[0])
        assert here[1] == there[1]
