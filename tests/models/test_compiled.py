"""The compiled models give the bits of the plain ones, event paths included."""

from __future__ import annotations

import random
from typing import Any

import pytest

from tautwave.models.crossing import first_rise, motion_bounds
from tautwave.models.encoder import quantise
from tautwave.models.foam import FoamParams, foam_forces, foam_step, foam_stored, foam_substeps
from tautwave.models.hand import rotary_hand
from tautwave.models.linear import flow_coefficients, flow_increment, linear_flow
from tautwave.models.plant import FREE, plant_cache, plant_forces, plant_step, plant_stored
from tautwave.models.reference import minimum_jerk_position, ramp_gain, sine_position
from tautwave.models.servo import ServoParams, servo_forces, servo_step, servo_stored
from tests.models.compiled import compiled
from tests.models.plants import STEP, plant

SLOW = pytest.mark.slow
PLANT = plant(0.243, 0.1, 0.3, (538.0, 5.0), (100.0, 0.0), (1e5, 50.0, 0.001, 1.0))


def draw(rng: random.Random, count: int, size: float = 1.0) -> list[float]:
    return [rng.uniform(-size, size) for _ in range(count)]


def test_encoders() -> None:
    rng = random.Random(6)
    nearest = compiled(quantise)
    for _ in range(500):
        a, b = draw(rng, 2, 3.0)
        assert nearest(a, abs(b)) == quantise(a, abs(b))


@SLOW
@pytest.mark.nightly
def test_flows() -> None:
    rng = random.Random(1)
    linear, coefficients = compiled(linear_flow), compiled(flow_coefficients)
    increment, rise, bounds = (
        compiled(flow_increment),
        compiled(first_rise),
        compiled(motion_bounds),
    )
    for _ in range(200):
        k, b = 10.0 ** rng.uniform(-1, 7), 10.0 ** rng.uniform(-2, 4)
        many = (k, b, 0.1, *draw(rng, 4), 1e-3)
        assert linear(*many) == linear_flow(*many)
        assert coefficients(k, b, 0.1, 1e-3) == flow_coefficients(k, b, 0.1, 1e-3)
        state = (k, b, 0.1, *draw(rng, 3, 10.0), 1e-3)
        assert increment(*state) == flow_increment(*state)
        assert bounds(*state) == motion_bounds(*state)
        search = (k, b, 0.1, *draw(rng, 3, 10.0), 1.0, 0.0, rng.uniform(-1e-3, 0.0), 2e-4)
        assert rise(*search) == first_rise(*search)


@SLOW
@pytest.mark.nightly
def test_plant() -> None:
    rng = random.Random(2)
    step, cache = compiled(plant_step), compiled(plant_cache)
    stored, forces = compiled(plant_stored), compiled(plant_forces)
    c = plant_cache(PLANT, STEP)
    assert cache(PLANT, STEP) == c
    x, v, mode = 0.0, 0.0, FREE
    modes = set()
    for _ in range(800):
        args: Any = (
            PLANT,
            c,
            x,
            v,
            mode,
            *draw(rng, 1, 4.0),
            *draw(rng, 1, 0.01),
            *draw(rng, 1),
            STEP,
        )
        want = plant_step(*args)
        assert step(*args) == want
        x, v, mode = want[:3]
        modes.add(mode)
        assert stored(PLANT, x, v, 0.01) == plant_stored(PLANT, x, v, 0.01)
        assert forces(PLANT, x, v, 0.01, 0.2) == plant_forces(PLANT, x, v, 0.01, 0.2)
    assert len(modes) >= 5


@SLOW
@pytest.mark.nightly
def test_foam() -> None:
    rng = random.Random(3)
    foam = FoamParams(5e4, 1.5, 3.0, 0.001, 1.0, 3)
    step, stored, forces = compiled(foam_step), compiled(foam_stored), compiled(foam_forces)
    assert compiled(foam_substeps)(PLANT, foam, 0.5, 3.0, STEP) == foam_substeps(
        PLANT, foam, 0.5, 3.0, STEP
    )
    x, v = 0.0, 0.0
    for _ in range(800):
        args: Any = (
            PLANT,
            foam,
            x,
            v,
            *draw(rng, 1, 4.0),
            *draw(rng, 1, 0.01),
            *draw(rng, 1),
            STEP,
        )
        want = foam_step(*args)
        assert step(*args) == want
        x, v = want[:2]
        assert stored(PLANT, foam, x, v, 0.01) == foam_stored(PLANT, foam, x, v, 0.01)
        assert forces(PLANT, foam, x, v, 0.0, 0.2) == foam_forces(PLANT, foam, x, v, 0.0, 0.2)


@SLOW
def test_servo() -> None:
    rng = random.Random(4)
    p = ServoParams(0.002, 0.143, 538.0, 5.0, 50.0, 0.0, 1e4, 20.0, 0.0002, -1.0)
    step, stored, forces = compiled(servo_step), compiled(servo_stored), compiled(servo_forces)
    x, v = 0.0, 0.0
    for _ in range(800):
        args: Any = (p, x, v, *draw(rng, 1), *draw(rng, 1, 0.01), *draw(rng, 1), STEP)
        want = servo_step(*args)
        assert step(*args) == want
        x, v = want[:2]
        assert stored(p, x, v, 0.01) == servo_stored(p, x, v, 0.01)
        assert forces(p, x, v, 0.1, 0.0, 0.2) == servo_forces(p, x, v, 0.1, 0.0, 0.2)


@SLOW
def test_small_models() -> None:
    rng = random.Random(5)
    jerk, sine, ramp = compiled(minimum_jerk_position), compiled(sine_position), compiled(ramp_gain)
    assert compiled(rotary_hand)(0.1, 5.0, 500.0, 0.07) == rotary_hand(0.1, 5.0, 500.0, 0.07)
    for _ in range(2000):
        a, b, c, d, e = draw(rng, 5, 3.0)
        assert jerk(a, b, c, d, e) == minimum_jerk_position(a, b, c, d, e)
        assert sine(a, b, c, d) == sine_position(a, b, c, d)
        assert ramp(a, b) == ramp_gain(a, b)
