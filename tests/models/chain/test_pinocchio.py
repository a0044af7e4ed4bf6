"""Kinematics, gravity and inertia of random chains against Pinocchio, an independent library."""

from __future__ import annotations

import random
from typing import Any

import numpy as np
import pytest

from tautwave.models.chain.build import Body, build_chain
from tautwave.models.chain.gravity import chain_gravity
from tautwave.models.chain.inertia import (
    BASE,
    chain_bodies,
    chain_coriolis,
    chain_screws,
    mass_matrix,
)
from tautwave.models.chain.kinematics import chain_frames, chain_jacobian, fill_jacobian
from tests.models.chain.drawn import draw_body, draw_chain, pin_model

GREATEST = 1e-12  # of the largest entry


def near(found: Any, wanted: Any, least: float = 1e-9) -> None:
    wanted = np.asarray(wanted).ravel()
    scale = max(float(np.abs(wanted).max()), least)
    assert float(np.abs(np.asarray(found) - wanted).max()) <= GREATEST * scale


def compare(seed: int) -> None:
    pin: Any = pytest.importorskip("pinocchio")
    rng = random.Random(seed)
    count = rng.randint(1, 7)
    links = draw_chain(rng, count)
    tip_body = draw_body(rng) if rng.random() < 0.5 else Body()
    gravity = (rng.uniform(-10, 10), rng.uniform(-10, 10), rng.uniform(-10, 10))
    chain = build_chain(links, gravity, tip_body)
    model, tip = pin_model(pin, links, gravity, tip_body)
    data = model.createData()
    q = [rng.uniform(-3.0, 3.0) for _ in range(count)]
    v = [rng.uniform(-2.0, 2.0) for _ in range(count)]
    at, rate = np.array(q), np.array(v)

    jacobian = [0.0] * (6 * count)
    pose = chain_jacobian(chain, q, jacobian)
    pin.computeJointJacobians(model, data, at)
    pin.updateFramePlacements(model, data)
    there = data.oMf[tip]
    near(pose[:3], there.translation)
    near(pose[3:], there.rotation.T)
    near(jacobian, pin.getFrameJacobian(model, data, tip, pin.LOCAL_WORLD_ALIGNED).T)

    frames = chain_frames(chain, q)
    weight = [0.0] * count
    energy = chain_gravity(chain, frames, weight)
    held = pin.computeGeneralizedGravity(model, data, at).copy()
    near(weight, held)
    near([energy], [pin.computePotentialEnergy(model, data, at)], least=float(abs(held).max()))

    bodies, screws = chain_bodies(chain, frames), chain_screws(frames)
    matrix = [0.0] * (count * count)
    beside = [0.0] * count
    again = mass_matrix(chain, q, frames, screws, BASE, matrix, beside)
    near(beside, held)
    near([again], [energy], least=float(abs(held).max()))
    upper = np.triu(pin.crba(model, data, at))
    near(matrix, upper + np.triu(upper, 1).T)
    # The same from what a loop has anyway: screws about the tip.
    moved, above = [0.0] * (count * count), [0.0] * count
    screws_there = fill_jacobian(frames, pose, [0.0] * (6 * count))
    assert mass_matrix(chain, q, frames, screws_there, pose, moved, above) == again
    assert above == beside
    near(moved, matrix)
    swung = [0.0] * count
    chain_coriolis(bodies, screws, v, swung)
    both = pin.nonLinearEffects(model, data, at, rate)
    near(swung, both - held, least=float(abs(both).max()))


@pytest.mark.parametrize("seed", range(12))
def test_a_random_chain_is_pinocchios(seed: int) -> None:
    compare(seed)


@pytest.mark.slow
def test_a_thousand_random_chains_are_pinocchios() -> None:
    for seed in range(1000):
        compare(1000 + seed)
