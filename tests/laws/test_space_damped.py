"""Damped least squares of a tip: what they are, what they keep, and what an account allows."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from tautwave.laws.space.damped import damped_inverse, diagonalise, room_for


def random_jacobian(rng: Any, lost: int) -> Any:
    """Return a 6 x 7 matrix with so many directions of hardly any lever."""
    left, sizes, right = np.linalg.svd(rng.normal(size=(6, 7)), full_matrices=False)
    sizes[6 - lost :] = rng.uniform(0.0, 1e-3, size=lost)
    return left @ np.diag(sizes) @ right


def inverse(jacobian: Any, axes: Any, scales: Any, floor: float) -> tuple[Any, float]:
    size = len(scales)
    found, least = damped_inverse(jacobian.ravel().tolist(), axes, scales, floor)
    return np.array(found).reshape(size, size), least


@pytest.mark.parametrize("seed", range(6))
def test_principal_axes_are_numpys_from_wherever_they_start(seed: int) -> None:
    rng = np.random.default_rng(seed)
    half = rng.normal(size=(6, 6))
    start, _ = np.linalg.qr(rng.normal(size=(6, 6)))
    whole = half @ half.T
    axes = start.ravel().tolist()
    matrix = (start.T @ whole @ start).ravel().tolist()
    diagonalise(matrix, axes, 6)
    turned = np.array(axes).reshape(6, 6)
    values = np.diag(np.array(matrix).reshape(6, 6))
    assert np.sort(values) == pytest.approx(np.linalg.eigvalsh(whole), rel=1e-6, abs=1e-6)
    assert turned @ np.diag(values) @ turned.T == pytest.approx(whole, abs=1e-6)
    assert turned.T @ turned == pytest.approx(np.eye(6), abs=1e-13)


def test_with_a_lever_everywhere_the_tip_goes_as_it_is_told_to_with_the_slowest_joints() -> None:
    rng = np.random.default_rng(1)
    jacobian, velocity = rng.normal(size=(6, 7)), rng.normal(size=6)
    gain, least = inverse(jacobian, np.eye(6).ravel().tolist(), [1.0] * 6, 1e-3)
    speeds = jacobian.T @ gain @ velocity
    assert speeds == pytest.approx(np.linalg.pinv(jacobian) @ velocity)
    assert least == pytest.approx(np.linalg.svd(jacobian)[1][-1])


@pytest.mark.parametrize("lost", [0, 1, 2, 6])
def test_power_is_kept_in_any_pose_and_no_joint_runs_away(lost: int) -> None:
    """tau.q' = F.v; what J q' lacks of v is in the lost directions; speeds stay below v / floor."""
    rng = np.random.default_rng(lost)
    floor, axes = 0.05, np.eye(6).ravel().tolist()
    for _ in range(50):
        jacobian = random_jacobian(rng, lost)
        gain, _ = inverse(jacobian, axes, [1.0] * 6, floor)
        torque, velocity = rng.normal(size=7), rng.normal(size=6)
        speeds = jacobian.T @ gain @ velocity
        effort = gain @ jacobian @ torque
        assert torque @ speeds == pytest.approx(effort @ velocity, abs=1e-11)
        assert np.linalg.norm(speeds) <= np.linalg.norm(velocity) / floor
        left, sizes, _ = np.linalg.svd(jacobian)
        missing = left.T @ (velocity - jacobian @ speeds)
        assert np.abs(missing[sizes >= floor]).max(initial=0.0) < 1e-5


def test_a_turn_counts_as_a_way_at_its_length() -> None:
    """Units of a coordinate change neither what joints do nor what is lost."""
    rng = np.random.default_rng(5)
    jacobian, velocity = rng.normal(size=(6, 7)), rng.normal(size=6)
    scales = [1.0, 1.0, 1.0, 0.2, 0.2, 0.2]
    plain, least = inverse(np.diag(scales) @ jacobian, np.eye(6).ravel().tolist(), [1.0] * 6, 0.5)
    scaled, same = inverse(jacobian, np.eye(6).ravel().tolist(), scales, 0.5)
    assert same == pytest.approx(least)
    there = jacobian.T @ np.diag(scales) @ plain @ np.diag(scales) @ velocity
    assert jacobian.T @ scaled @ velocity == pytest.approx(there)


def test_an_account_allows_what_it_covers() -> None:
    assert room_for(0.0, -1.0, 0.01) == 1.0
    assert room_for(0.02, -0.001, 0.01) == 1.0  # what earns is always allowed
    assert room_for(0.0, 0.01, 0.01) == 1.0
    assert room_for(0.005, 0.01, 0.01) == pytest.approx(0.5)
    assert room_for(0.02, 1e-6, 0.01) == 0.0


@pytest.mark.parametrize(("given", "gift"), [(0.0, math.nan), (math.nan, 1.0), (2.0, 1.0)])
def test_an_account_that_is_empty_or_unknown_allows_no_motion(given: float, gift: float) -> None:
    assert room_for(given, gift, 1.0) == 0.0
