from __future__ import annotations

import functools
import math
import random
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tautwave.models.plant import (
    FREE,
    PlantCache,
    PlantParams,
    plant_cache,
    plant_step,
    plant_stored,
)
from tests.examples import tried
from tests.models.compiled import compiled
from tests.models.plants import STEP, plant


def books(
    p: PlantParams, steps: int, effort: float, speed: float, hertz: float, h: float, seed: int
) -> tuple[float, float]:
    """Residual of the energy books and gross flow [J] under noise and a sampled sine reference."""
    noise = random.Random(seed)
    c = plant_cache(p, h)
    x, v, mode, ref = -0.002, 0.0, FREE, 0.0
    residual = 0.0
    gross = 0.0
    stored = sum(plant_stored(p, x, v, ref))
    for k in range(steps):
        force = noise.gauss(0.0, effort)
        rate = speed * math.cos(2.0 * math.pi * hertz * k * h)
        before = x
        x, v, mode, work, *losses = plant_step(p, c, x, v, mode, force, ref, rate, h)
        assert min(losses) >= -1e-15 * (gross + 1.0)
        ref += rate * h
        now = sum(plant_stored(p, x, v, ref))
        motor = force * (x - before)
        residual += work + motor - (now - stored) - sum(losses)
        gross += abs(work) + abs(motor) + abs(now - stored) + sum(losses)
        stored = now
    return residual, gross


PLANTS = {
    "grip": plant(0.243, 0.1, grip=(538.0, 5.0)),
    "no grip, no damping": plant(wall=(1000.0, 0.0, 0.0, 1.0), spring=(10.0, -0.001)),
    "wall": plant(0.243, 0.1, grip=(538.0, 5.0), wall=(5000.0, 5.0, 0.0, 1.0)),
    "stiff wall": plant(0.243, 0.1, grip=(538.0, 5.0), wall=(1e7, 5.0, 0.001, 1.0)),
    "stiff wall, nothing damped": plant(grip=(538.0, 0.0), wall=(1e7, 0.0, 0.0, -1.0)),
    "damper wall": plant(0.243, 0.1, grip=(538.0, 5.0), wall=(0.0, 500.0, 0.0, 1.0)),
    "stick-slip": plant(0.243, 0.0, 2.0, (538.0, 5.0)),
    "all": plant(0.243, 0.1, 0.3, (538.0, 5.0), (100.0, 0.0), (1e5, 50.0, 0.003, 1.0)),
    "light and stiff": plant(1e-3, 0.0, 0.05, (1e4, 1.0), (0.0, 0.0), (1e6, 3.0, 0.0, 1.0)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", PLANTS)
def test_the_books_close(name: str) -> None:
    steps = 300 if name == "light and stiff" else 1500
    residual, gross = books(PLANTS[name], steps, 1.0, 0.4, 3.0, STEP, 1)
    assert gross > 0.1
    assert abs(residual) <= 1e-13 * gross


def test_the_books_close_at_a_damper_that_lets_go() -> None:
    residual, gross = books(PLANTS["damper wall"], 200, 1.0, 0.4, 3.0, STEP, 1)
    assert abs(residual) <= 1e-13 * gross


@settings(max_examples=tried(40))
@given(
    mass=st.floats(0.01, 2.0),
    viscous=st.sampled_from([0.0, 0.3]),
    coulomb=st.sampled_from([0.0, 0.2]),
    grip=st.sampled_from([(0.0, 0.0), (538.0, 5.0), (2000.0, 0.0), (0.0, 4.0)]),
    wall=st.sampled_from([0.0, 300.0, 2e4, 1e7]),
    zeta=st.sampled_from([0.0, 0.1, 0.9, 3.0]),
    side=st.sampled_from([1.0, -1.0]),
    h=st.sampled_from([1e-4, 1e-3, 7e-3]),
    seed=st.integers(0, 1000),
)
def test_the_books_close_for_any_plant(
    mass: float,
    viscous: float,
    coulomb: float,
    grip: tuple[float, float],
    wall: float,
    zeta: float,
    side: float,
    h: float,
    seed: int,
) -> None:
    damping = 2.0 * zeta * math.sqrt(wall * mass)
    p = plant(mass, viscous, coulomb, grip, (0.0, 0.0), (wall, damping, 0.0005, side))
    residual, gross = books(p, 60, 1.0, 0.3, 5.0, h, seed)
    # the last bit of 2 mm under 5 N is 2e-18 J a step
    assert abs(residual) <= 1e-12 * gross + 1e-16


@functools.cache
def compiled_books() -> Callable[..., tuple[float, float]]:
    step = compiled(plant_step)
    stored_in = compiled(plant_stored)

    def loop(
        p: PlantParams, c: PlantCache, steps: int, h: float, draw: float
    ) -> tuple[float, float]:
        x = -0.002
        v = 0.0
        mode = 0
        ref = 0.0
        residual = 0.0
        gross = 0.0
        a, b, d = stored_in(p, x, v, ref)
        stored = a + b + d
        for k in range(steps):
            draw = (draw * 9301.0 + 49297.0) % 233280.0
            force = draw / 116640.0 - 1.0
            rate = 0.4 * math.cos(18.85 * k * h)
            before = x
            x, v, mode, work, l1, l2, l3, l4 = step(p, c, x, v, mode, force, ref, rate, h)
            ref = ref + rate * h
            a, b, d = stored_in(p, x, v, ref)
            now = a + b + d
            losses = l1 + l2 + l3 + l4
            motor = force * (x - before)
            residual = residual + (work + motor - (now - stored) - losses)
            gross = gross + abs(work) + abs(motor) + abs(now - stored) + losses
            stored = now
        return residual, gross

    return compiled(loop)


@pytest.mark.slow
@pytest.mark.parametrize("name", PLANTS)
@pytest.mark.nightly
def test_the_books_close_over_a_million_steps(name: str) -> None:
    p = PLANTS[name]
    events_everywhere = name == "light and stiff"
    steps = 50_000 if events_everywhere else 1_000_000
    residual, gross = compiled_books()(p, plant_cache(p, STEP), steps, STEP, 7.0)
    assert gross > 1.0
    assert abs(residual) <= 1e-10 * gross


@pytest.mark.parametrize("rate", [0.05, -0.05, 0.2, -0.2, 0.5, -0.9])
def test_a_grip_that_stretches_against_friction_works_by_its_spring_and_damper(rate: float) -> None:
    """At rest, f = k (x_h - x) + b w grows with the hand: its work is the integral of f w."""
    p = plant(0.1, coulomb=2.0, grip=(40.0, 0.5))
    h, aim = 0.1, 0.01
    c = plant_cache(p, h)
    x, v, _, work, grip, viscous, coulomb, outside = plant_step(
        p, c, 0.0, 0.0, FREE, 0.3, aim, rate, h
    )
    pull = 40.0 * aim + 0.5 * rate
    if abs(0.3 + pull + 40.0 * rate * h) < 2.0 and abs(0.3 + pull) < 2.0:
        assert (x, v, viscous, coulomb, outside) == (0.0, 0.0, 0.0, 0.0, 0.0)
        assert work == pytest.approx(rate * h * (pull + 20.0 * rate * h), rel=1e-12)
        assert grip == pytest.approx(0.5 * rate * rate * h, rel=1e-12)
    # In parts it is the same, also where it breaks loose within one of them.
    parts = 160
    small = plant_cache(p, h / parts)
    y, w, mode, sums = 0.0, 0.0, FREE, [0.0] * 5
    for k in range(parts):
        y, w, mode, *more = plant_step(
            p, small, y, w, mode, 0.3, aim + rate * k * h / parts, rate, h / parts
        )
        sums = [one + two for one, two in zip(sums, more, strict=True)]
    assert (y, w) == (pytest.approx(x, abs=1e-12), pytest.approx(v, abs=1e-10))
    assert sums == pytest.approx([work, grip, viscous, coulomb, outside], rel=1e-8, abs=1e-13)


def test_a_grip_that_stretches_breaks_loose_where_friction_ends() -> None:
    p = plant(0.1, coulomb=2.0, grip=(40.0, 0.5))
    reached = [
        plant_step(p, plant_cache(p, h), 0.0, 0.0, FREE, 0.3, 0.01, 0.3, h)[1] for h in (0.09, 0.10)
    ]
    # 0.3 + 40 (0.01 + 0.3 t) + 0.15 = 2 at t = 0.0958 s.
    assert reached[0] == 0.0 < reached[1]
