"""The closed-form contacts W1-W4 and W9 by every scheme that is to have them."""

from __future__ import annotations

import math

import pytest

from tautwave.models.foam import FoamParams, elastic_energy
from tautwave.models.integrators.bounds import greatest_depth
from tautwave.models.integrators.schemes import (
    DISCRETE_GRADIENT,
    DORMAND_PRINCE,
    IMPLICIT_MIDPOINT,
    RK4,
    SYMPLECTIC_EULER,
    integrate_step,
)
from tautwave.models.plant import PlantParams, plant_cache, plant_step
from tests.models.plants import plant

ERRORS = {
    DORMAND_PRINCE: 1e-9,
    RK4: 1e-5,
    DISCRETE_GRADIENT: 1e-5,
    IMPLICIT_MIDPOINT: 1e-5,
    SYMPLECTIC_EULER: 1e-5,
}
"""At 2000 steps a contact; Dormand-Prince takes its own."""


def thrown(
    p: PlantParams, foam: FoamParams, h: float, speed: float = 1.0
) -> tuple[float, float, float]:
    """Greatest depth (parabola through the deepest steps), exit speed, time of contact."""
    x, v, t = 0.0, speed, 0.0
    depths = [0.0]
    while True:
        before, was = x, v
        x, v, *_ = integrate_step(p, foam, x, v, 0.0, 0.0, 0.0, h)
        t += h
        depths.append(x)
        if v < 0.0 and x <= 0.0:
            break
        assert t < 1.0, (before, was)
    at = max(range(len(depths)), key=depths.__getitem__)
    one, two, three = depths[at - 1 : at + 2]
    bend = one - 2.0 * two + three
    deepest = two - (three - one) ** 2 / (8.0 * bend) if bend else two
    return deepest, -v, t + x / -v


@pytest.mark.parametrize("scheme", ERRORS)
def test_w1_bounce_of_a_spring(scheme: int) -> None:
    length = math.pi * math.sqrt(0.1 / 1000.0)
    foam = FoamParams(1000.0, 1.0, 0.0, 0.0, 1.0, 1, 0.0, scheme, 1e-12)
    deepest, speed, time = thrown(plant(0.1), foam, length / 2000.37)
    assert length == pytest.approx(31.415927e-3, rel=1e-7)
    assert deepest == pytest.approx(0.01, rel=1e-5)
    assert speed == pytest.approx(1.0, rel=ERRORS[scheme])
    assert time == pytest.approx(length, rel=max(ERRORS[scheme], 1e-9))


@pytest.mark.parametrize("scheme", ERRORS)
def test_w3_hertz(scheme: int) -> None:
    foam = FoamParams(1e6, 1.5, 0.0, 0.0, 1.0, 1, 0.0, scheme, 1e-12)
    deepest, speed, time = thrown(plant(0.01), foam, 2.03046204e-3 / 2000.37)
    assert deepest == pytest.approx(0.6898648e-3, rel=2e-5)
    assert speed == pytest.approx(1.0, rel=ERRORS[scheme])
    assert time == pytest.approx(2.03046204e-3, rel=max(ERRORS[scheme], 3e-9))
    assert time / deepest == pytest.approx(2.943275184, rel=1e-4)


@pytest.mark.parametrize(
    ("zeta", "surface", "force"),
    [
        (0.05, 0.8544678930, 0.8587581018),
        (0.2, 0.5266205993, 0.5717400276),
        (0.5, 0.1630335348, 0.2984360592),
    ],
)
def test_w2_the_wall_lets_go_where_its_force_ends(
    zeta: float, surface: float, force: float
) -> None:
    b = 2.0 * zeta * math.sqrt(1000.0 * 0.1)
    p = plant(0.1, wall=(1000.0, b, 0.0, 1.0))
    c = plant_cache(p, 1e-3)
    x, v, mode = -3e-4, 1.0, 0
    while not (v < 0.0 and x < 0.0):
        x, v, mode, *_ = plant_step(p, c, x, v, mode, 0.0, 0.0, 0.0, 1e-3)
    assert -v == pytest.approx(force, abs=1e-9)
    # A spring and damper that also pull let go at the surface.
    both = plant(0.1, b, 0.0, (0.0, 0.0), (1000.0, 0.0))
    half = math.pi / math.sqrt(1000.0 / 0.1 - (0.5 * b / 0.1) ** 2)
    _, v, *_ = plant_step(both, plant_cache(both, half), 0.0, 1.0, 0, 0.0, 0.0, 0.0, half)
    assert -v == pytest.approx(surface, abs=1e-9)


@pytest.mark.parametrize("scheme", ERRORS)
def test_w4_hunt_crossley(scheme: int) -> None:
    foam = FoamParams(1e5, 1.5, 0.5, 0.0, 1.0, 1, 0.0, scheme, 1e-12)
    deepest, speed, _ = thrown(plant(0.1), foam, 1.3e-5)
    first_order = 5e-4 if scheme == SYMPLECTIC_EULER else 1e-5  # its loss is
    assert deepest == pytest.approx(3.8925738e-3, rel=first_order)
    assert speed == pytest.approx(0.7484349316, abs=max(1e-9, ERRORS[scheme]))
    # w - ln(1 + w) is the same before and after.
    w = 0.5 * 1.0
    after = -0.5 * speed
    lost = 1e-9 if scheme == DORMAND_PRINCE else 1e-5
    assert w - math.log1p(w) == pytest.approx(after - math.log1p(after), abs=lost)


@pytest.mark.parametrize("k", [1e6, 1e10, 1e15])
@pytest.mark.parametrize("exponent", [1.0, 1.5, 10.0])
@pytest.mark.parametrize("h", [2.27e-5, 1.0])
def test_w9_the_discrete_gradient_at_the_extremes(k: float, exponent: float, h: float) -> None:
    p = plant(0.01)
    foam = FoamParams(k, exponent, 0.0, 0.0, 1.0, 1)
    x, v = -0.37 * h, 1.0
    depth = greatest_depth(p, foam, 1.0, 0.0)
    # A position has its digits in h, the energy needs them in the depth.
    most = max(7e-12, 4.0 * 2.2e-16 * h / depth)
    for _ in range(50):
        x, v, *_ = integrate_step(p, foam, x, v, 0.0, 0.0, 0.0, h)
        energy = 0.5 * 0.01 * v * v + elastic_energy(foam, x)
        assert energy == pytest.approx(0.005, rel=most)
