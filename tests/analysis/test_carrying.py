"""Slopes of a chain's weight: bounds in any posture, put where there is damping to pay for them."""

from __future__ import annotations

import itertools
import math
import random
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from tautwave.analysis.carrying import weighed_slopes
from tautwave.analysis.walls.in_motor import least_damping, least_device
from tautwave.config.inputs.chains import chain_constants
from tautwave.config.keys.arm import Chain, DhRow
from tautwave.models.chain.build import build_chain
from tautwave.models.chain.gravity import chain_gravity, gravity_stiffness
from tautwave.models.chain.kinematics import chain_frames
from tautwave.models.chain.params import ChainParams
from tautwave.types import Damper
from tests.analysis.motor_loop import HOST, NEXT, SIZE, X, motor_step
from tests.models.chain.drawn import draw_chain

OPENARM = Path(__file__).parents[2] / "configs" / "arms" / "openarm.urdf"
HAS = (0.069, 0.069, 0.48, 0.648, 0.033, 0.075, 0.084)


def hessian(chain: ChainParams, q: list[float]) -> npt.NDArray[np.float64]:
    """Return the slopes of the weights by differences; shape (n, n)."""
    rows, count = [], len(q)
    for i in range(count):
        ends = []
        for step in (1e-5, -1e-5):
            moved = list(q)
            moved[i] += step
            weight = [0.0] * count
            chain_gravity(chain, chain_frames(chain, moved), weight)
            ends.append(np.array(weight))
        rows.append((ends[0] - ends[1]) / 2e-5)
    return np.array(rows)


def least_margin(chain: ChainParams, slopes: tuple[float, ...], draws: random.Random) -> float:
    """Return the least eigenvalue of h - H and h + H over postures, per the greatest h."""
    found = math.inf
    for _ in range(40):
        q = [draws.uniform(-math.pi, math.pi) for _ in slopes]
        bend = hessian(chain, q)
        for sign in (1.0, -1.0):
            found = min(found, float(np.linalg.eigvalsh(np.diag(slopes) - sign * bend).min()))
    return found / max(slopes)


@pytest.mark.parametrize("seed", range(6))
def test_no_posture_errs_by_more_whatever_the_weights_are(seed: int) -> None:
    draws = random.Random(seed)
    count = draws.randint(1, 5)
    gravity = (2.0, -3.0, -9.0)
    chain = build_chain(draw_chain(draws, count), gravity)
    while not all(joint.turns for joint in chain.joints):
        chain = build_chain(draw_chain(draws, count), gravity)
    has = tuple(10.0 ** draws.uniform(-2.0, 0.0) for _ in range(count))
    assert least_margin(chain, weighed_slopes(chain, has), draws) > -1e-6


def test_of_a_pendulum_it_is_its_weights_slope_but_for_the_grid() -> None:
    chain = chain_constants(Chain(dh=(DhRow(a=0.3, mass=2.0),), gravity=(0.0, -9.81, 0.0)))
    (slope,) = weighed_slopes(chain, (0.1,))
    assert slope == pytest.approx(2.0 * 0.3 * 9.81 / math.cos(math.pi / 12))


@pytest.mark.slow
def test_an_openarm_takes_far_less_than_with_stretched_links() -> None:
    chain = chain_constants(Chain(urdf=str(OPENARM), tip="right_hand", order="base_to_tip"))
    stretched = [0.0] * 7
    gravity_stiffness(chain, [0.0] * 7, stretched)
    slopes = weighed_slopes(chain, HAS)
    before, now = (max(h / b for h, b in zip(one, HAS, strict=True)) for one in (stretched, slopes))
    assert before > 2.2 * now
    assert least_margin(chain, slopes, random.Random(3)) > 0.0
    # What is lost is what no posture has: of the greatest share, less than half.
    root = 1.0 / np.sqrt(np.outer(HAS, HAS))
    draws = np.random.default_rng(1).uniform(-math.pi, math.pi, (400, 7))
    true = max(
        float(np.abs(np.linalg.eigvalsh(root * hessian(chain, q))).max()) for q in draws.tolist()
    )
    assert true < now < 2.0 * true


ONE = Damper(0.15, 1.0 / (math.tau * 500.0), 5e-5, 1.0, 0.0)


def test_the_least_device_is_what_a_damper_makes_enough() -> None:
    spent = least_device(ONE, 0.048, 1e-3, 0.055)
    assert spent < 0.048
    assert least_damping(ONE, spent, 1e-3) == pytest.approx(0.055, rel=1e-6)
    assert least_damping(ONE, 0.99 * spent, 1e-3) < 0.055
    assert least_device(ONE, 0.048, 1e-3, 1.0) == 0.048


def carried_radius(slope: float, mass: float, hand: float, period: float = 1e-3) -> float:
    """Return the spectral radius of a period in which a load is carried on a damped motor.

    The load's weight falls off with its slope; the motor holds it at the middle of the period in
    which that acts, a period late, predicted from the last stride.
    """
    size = SIZE + 1
    loop = np.eye(size)
    loop[:SIZE, :SIZE] = motor_step(ONE, mass, 0.048, hand - slope)
    before, unit = SIZE, np.eye(size)
    host = np.eye(size)
    host[NEXT] = slope * (unit[X] + 1.5 * (unit[X] - unit[before]))
    host[HOST] = unit[NEXT]
    host[before] = unit[X]
    count = round(period / ONE.loop_s)
    return float(np.abs(np.linalg.eigvals(np.linalg.matrix_power(loop, count) @ host)).max())


def test_what_a_damper_lends_carries_a_load_with_any_hand() -> None:
    """The class of a verdict: h T (1 + 2 d) is no more than the least that device and damper do."""
    bound = least_damping(ONE, 0.048, 1e-3) / 3e-3
    assert bound > 1.4 * 0.048 / 3e-3  # more than the device alone would bear
    draws = np.random.default_rng(2)
    hands = [
        (10.0**m, 10.0**k)
        for m, k in zip(draws.uniform(-3, 1, 300), draws.uniform(1.5, 5, 300), strict=True)
    ]
    for sign, (mass, hand) in itertools.product((1.0, -1.0), hands):
        assert carried_radius(sign * bound, mass, max(hand, bound)) <= 1.0 + 1e-11
    beyond = [carried_radius(-8.0 * bound, mass, hand) for mass, hand in hands]
    assert max(beyond) > 1.001
