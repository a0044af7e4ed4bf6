"""Orders of every scheme as measured, their energy, and the traps of measuring them."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from typing import Any

import pytest
from scipy.integrate import solve_ivp

from tautwave.models.foam import FoamParams, elastic_energy, foam_step, foam_stored
from tautwave.models.integrators.adaptive import (
    CLIPPED,
    FREE,
    PRESSING,
    dormand_prince_substep,
)
from tautwave.models.integrators.schemes import (
    DISCRETE_GRADIENT,
    DORMAND_PRINCE,
    IMPLICIT_MIDPOINT,
    RK4,
    SCHEMES,
    SYMPLECTIC_EULER,
    integrate_step,
)
from tautwave.models.linear import linear_flow
from tautwave.models.plant import PlantParams, plant_cache, plant_step
from tests.models.plants import plant

MASS = plant(0.1)
STEPPING = {
    "discrete_gradient": DISCRETE_GRADIENT,
    "symplectic_euler": SYMPLECTIC_EULER,
    "implicit_midpoint": IMPLICIT_MIDPOINT,
    "rk4": RK4,
}


def contact(scheme: int, exponent: float, stiffness: float, /, **more: Any) -> FoamParams:
    foam = FoamParams(stiffness, exponent, 0.0, 0.0, 1.0, 1, 0.0, scheme, 1e-13)
    return foam._replace(**more)


def slope(steps: Sequence[float], errors: Sequence[float]) -> float:
    """Least-squares slope of log error over log step."""
    x = [math.log(step) for step in steps]
    y = [math.log(error) for error in errors]
    mx, my = sum(x) / len(x), sum(y) / len(y)
    over = sum((a - mx) * (b - my) for a, b in zip(x, y, strict=True))
    return over / sum((a - mx) ** 2 for a in x)


def moved(
    p: PlantParams, foam: FoamParams, x: float, v: float, t: float, steps: int
) -> tuple[float, float]:
    for at in range(steps):
        aim = 0.01 + 0.2 * t * at
        x, v, *_ = integrate_step(p, foam, x, v, 0.5, aim, 0.2, t)
    return x, v


@pytest.mark.parametrize(
    ("scheme", "order"),
    [
        ("discrete_gradient", 2.0),
        ("symplectic_euler", 1.0),
        ("implicit_midpoint", 2.0),
        ("rk4", 4.0),
    ],
)
def test_order_where_all_is_smooth(scheme: str, order: float) -> None:
    p = plant(0.1, 0.3, 0.0, (50.0, 0.5), (80.0, 0.002))
    foam = contact(SCHEMES[scheme], 1.5, 1e4, loss=0.4)
    span = 4e-3  # deep inside all the way
    oracle = moved(p, foam._replace(scheme=DORMAND_PRINCE), 0.01, 0.2, span, 1)
    counts = (8, 13, 21, 34)
    errors = []
    for n in counts:
        x, v = moved(p, foam, 0.01, 0.2, span / n, n)
        errors.append(math.hypot((x - oracle[0]) * 300.0, v - oracle[1]))
    assert slope([1.0 / n for n in counts], errors) == pytest.approx(order, abs=0.12)


@pytest.mark.parametrize(
    ("scheme", "digits"),
    [("discrete_gradient", 1e-4), ("implicit_midpoint", 1e-4), ("rk4", 1e-9)],
)
def test_what_a_scheme_books_is_what_passed(scheme: str, digits: float) -> None:
    """Works and losses of hand, grip, joint and contact, deep inside, before it turns."""
    p = plant(0.1, 0.3, 0.4, (50.0, 0.5), (80.0, 0.002))
    foam = contact(SCHEMES[scheme], 1.5, 1e4, loss=0.4)

    def booked(by: FoamParams, steps: int) -> list[float]:
        x, v, t, sums = 0.01, 0.2, 1e-3 / steps, [0.0] * 5
        for at in range(steps):
            x, v, *parts = integrate_step(p, by, x, v, 0.5, 0.01 + 0.2 * t * at, 0.2, t)
            sums = [one + more for one, more in zip(sums, parts, strict=True)]
        return sums

    wanted = booked(foam._replace(scheme=DORMAND_PRINCE), 1)
    assert all(abs(one) > 1e-9 for one in wanted)
    for one, want in zip(booked(foam, 80), wanted, strict=True):
        assert one == pytest.approx(want, rel=digits)


def test_dormand_prince_is_of_order_five_and_its_estimate_one_less() -> None:
    p = plant(0.1, 0.3, 0.0, (50.0, 0.5), (80.0, 0.002))
    foam = contact(DORMAND_PRINCE, 1.5, 1e4, loss=0.4)
    span = 8e-3

    def fixed(n: int) -> tuple[float, float, float]:
        x, v, t, most = 0.01, 0.2, span / n, 0.0
        for at in range(n):
            aim = 0.01 + 0.2 * t * at
            x, v, _, ev, *_ = dormand_prince_substep(p, foam, PRESSING, 0.5, aim, 0.2, x, v, t)
            most = max(most, abs(ev))
        return x, v, most

    fine = fixed(400)
    counts = (4, 6, 9, 13)
    found = [fixed(n) for n in counts]
    steps = [1.0 / n for n in counts]
    errors = [math.hypot((x - fine[0]) * 300.0, v - fine[1]) for x, v, _ in found]
    assert slope(steps, errors) == pytest.approx(5.0, abs=0.5)
    assert slope(steps, [most for *_, most in found]) == pytest.approx(5.0, abs=0.5)


@pytest.mark.parametrize("kind", [PRESSING, FREE, CLIPPED])
def test_a_step_of_dormand_prince_is_exact_to_its_order_in_all_that_it_returns(kind: int) -> None:
    """Against its equations written anew: a stage that is off by a little has a lower order."""
    p = plant(0.1, 0.3, 0.0, (50.0, 0.5), (80.0, 0.002))
    foam = contact(DORMAND_PRINCE, 1.5, 1e4, loss=0.4)
    aim, rate, push, start = 0.012, 0.9, 0.5, (0.01, 0.2)
    side, wall = foam.side, foam.position

    def flow(t: float, y: Any) -> list[float]:
        x, v = y[0], y[1]
        slip = rate - v
        grip = 50.0 * (aim + rate * t - x) + 0.5 * slip
        elastic = 1e4 * max(0.0, side * (x - wall)) ** 1.5
        pull = elastic * (1.0 + 0.4 * side * v) if kind == PRESSING else 0.0
        lost = (pull - elastic) * side * v if kind != FREE else 0.0
        force = push + grip - 0.3 * v - 80.0 * (x - 0.002) - side * pull
        return [v, force / 0.1, rate * grip, 0.5 * slip * slip, v * v, lost]

    def errors(t: float) -> list[float]:
        true = solve_ivp(flow, (0.0, t), [*start, 0, 0, 0, 0], "DOP853", rtol=1e-13, atol=1e-18)
        x, v, _, _, *sums = dormand_prince_substep(p, foam, kind, push, aim, rate, *start, t)
        return [abs(one - float(w)) for one, w in zip((x, v, *sums), true.y[:, -1], strict=True)]

    spans = (4e-3, 2.8e-3, 2e-3)
    for number, column in enumerate(zip(*(errors(t) for t in spans), strict=True)):
        if max(column) > 1e-15:
            assert slope(spans, column) > 5.2, number


@pytest.mark.parametrize(("v0", "effort", "slide"), [(0.7, 0.0, 0.0), (0.7, 0.4, 0.2)])
def test_exact_has_no_error_at_any_step(v0: float, effort: float, slide: float) -> None:
    p = plant(0.1, 0.3, 0.0, (50.0, 0.5), (80.0, 0.002))
    want = linear_flow(
        130.0, 0.8, 0.1, effort + 80.0 * 0.002 + 0.5 * slide, 50.0 * slide, 0.01, v0, 0.5
    )
    for n in (1, 7, 100):
        h = 0.5 / n
        c = plant_cache(p, h)
        x, v, mode = 0.01, v0, 0
        for at in range(n):
            x, v, mode, *_ = plant_step(p, c, x, v, mode, effort, slide * h * at, slide, h)
        assert (x, v) == pytest.approx(want[:2], rel=1e-12)


def bounce(scheme: int, exponent: float, k: float, t: float, phase: float) -> tuple[float, float]:
    """State error (position, velocity; in impact speed) a fixed time after a bounce at 1 m/s."""
    foam = contact(scheme, exponent, k)
    length = contact_time(exponent, k)
    # The same instant for every step: an integer of steps after the phase, then flown on freely.
    steps = math.ceil(1.3 * length / t)
    x, v = -phase * t, 1.0
    for _ in range(steps):
        x, v, *_ = integrate_step(MASS, foam, x, v, 0.0, 0.0, 0.0, t)
    after = steps * t - phase * t - length
    return (x + after) / length, v + 1.0


def contact_time(exponent: float, k: float) -> float:
    """W1 and W3 of a mass of 0.1 kg at 1 m/s [s]."""
    deepest = math.pow((exponent + 1.0) * 0.05 / k, 1.0 / (exponent + 1.0))
    share = 1.0 / (exponent + 1.0)
    length: float = 2.0 * deepest * math.sqrt(math.pi)
    return length * math.gamma(1.0 + share) / math.gamma(0.5 + share)


@pytest.mark.sparse(2)
@pytest.mark.parametrize(
    ("scheme", "exponent", "low", "high"),
    [
        ("symplectic_euler", 1.0, 1.7, 2.4),  # free before and after: a shifted Verlet
        ("symplectic_euler", 1.5, 1.8, 2.2),
        ("implicit_midpoint", 1.0, 1.6, 2.3),
        ("implicit_midpoint", 1.5, 1.8, 2.3),
        ("discrete_gradient", 1.0, 1.8, 2.2),
        ("discrete_gradient", 1.5, 1.8, 2.2),
        ("rk4", 1.0, 1.6, 2.5),
        ("rk4", 1.5, 2.1, 3.0),
        ("rk4", 3.0, 3.5, 4.3),
    ],
)
def test_order_across_a_contact(scheme: str, exponent: float, low: float, high: float) -> None:
    rng = random.Random(4)
    length = contact_time(exponent, 1000.0)
    steps, errors = [], []
    for per in (31.7, 63.3, 127.1, 254.9):
        t = length / per
        found = [
            math.hypot(*bounce(SCHEMES[scheme], exponent, 1000.0, t, rng.random()))
            for _ in range(24)
        ]
        steps.append(t)
        errors.append(math.sqrt(sum(e * e for e in found) / len(found)))
    assert low <= slope(steps, errors) <= high


def test_trap_a_step_that_divides_the_contact_time_flatters_rk4() -> None:
    length = contact_time(1.0, 1000.0)
    counts = (16, 32, 64)
    flattered = [math.hypot(*bounce(RK4, 1.0, 1000.0, length / n, 0.0)) for n in counts]
    honest = [
        max(math.hypot(*bounce(RK4, 1.0, 1000.0, length / (n + 0.37), p)) for p in (0.1, 0.4, 0.8))
        for n in counts
    ]
    steps = [1.0 / n for n in counts]
    assert slope(steps, flattered) > 3.5
    assert slope(steps, honest) < 2.6
    assert honest[-1] > 10.0 * flattered[-1]


@pytest.mark.parametrize("k", [1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9])
@pytest.mark.parametrize("exponent", [1.0, 1.5, 3.0])
def test_D15_the_discrete_gradient_gives_the_speed_back(k: float, exponent: float) -> None:
    foam = contact(DISCRETE_GRADIENT, exponent, k)
    for phase in (0.03, 0.21, 0.5, 0.77, 0.98):
        x, v = -phase * 1e-3, 1.0
        while not (v < 0.0 and x < 0.0):
            x, v, *_ = integrate_step(MASS, foam, x, v, 0.0, 0.0, 0.0, 1e-3)
        assert -v == pytest.approx(1.0, abs=1e-13)


@pytest.mark.parametrize("k", [1e3, 1e5, 1e7, 1e9])
@pytest.mark.parametrize("steps", [0.3, 1.0, 2.2, 7.3, 31.0, 100.7, 333.0, 1000.0])
def test_the_speed_comes_back_however_many_steps_a_contact_takes(k: float, steps: float) -> None:
    """Rounding does not add up: some 1e-17 a step, where solving for the force alone had 1e-16."""
    for exponent, phase in ((1.0, 0.03), (1.5, 0.41), (1.5, 0.83), (3.0, 0.66)):
        t = contact_time(exponent, k) / steps
        foam = contact(DISCRETE_GRADIENT, exponent, k)
        x, v = -phase * t, 1.0
        while not (v < 0.0 and x < 0.0):
            x, v, *_ = integrate_step(MASS, foam, x, v, 0.0, 0.0, 0.0, t)
        assert -v == pytest.approx(1.0, abs=3e-14)


def test_free_flight_keeps_its_speed_to_the_bit() -> None:
    foam = contact(DISCRETE_GRADIENT, 1.5, 1e5)
    rng = random.Random(2)
    for _ in range(200):
        x, v = -1.0, rng.uniform(-2.0, 0.0)
        after = integrate_step(MASS, foam, x, v, 0.0, 0.0, 0.0, rng.uniform(1e-6, 1.0))
        assert after[1] == v


@pytest.mark.parametrize(
    ("more", "want"),
    [
        ({"exponent": 1.5, "stiffness": 1e5, "loss": 0.5}, 0.7484349316),
        ({"exponent": 1.5, "stiffness": 1e5, "loss": 5.0}, 0.1969802453),
        ({"exponent": 1.0, "stiffness": 1000.0, "damping": 4.0}, 0.5717400276),
        ({"exponent": 1.0, "stiffness": 1000.0, "damping": 1.0}, 0.8587581018),
        ({"exponent": 1.0, "stiffness": 1000.0, "damping": 10.0}, 0.2984360592),
    ],
)
def test_D14_the_oracle_has_the_closed_forms(more: dict[str, float], want: float) -> None:
    foam = contact(DORMAND_PRINCE, 1.0, 1.0, **more)
    x, v = -3e-4, 1.0
    books = 0.0
    while not (v < 0.0 and x < 0.0):
        x, v, *rest = integrate_step(MASS, foam, x, v, 0.0, 0.0, 0.0, 1e-3)
        books += rest[4]
    assert -v == pytest.approx(want, abs=2e-10)
    assert 0.05 * (1.0 - v * v) == pytest.approx(books, abs=1e-12)


@pytest.mark.parametrize(("scheme", "most"), [(s, 2e-3) for s in STEPPING])
def test_every_scheme_finds_the_restitution_of_a_lossy_contact(scheme: str, most: float) -> None:
    for more, want in (
        ({"exponent": 1.5, "stiffness": 1e5, "loss": 0.5}, 0.7484349316),
        ({"exponent": 1.0, "stiffness": 1000.0, "damping": 4.0}, 0.5717400276),
    ):
        foam = contact(STEPPING[scheme], 1.0, 1.0, **more)
        x, v = -2e-5, 1.0
        while not (v < 0.0 and x < 0.0):
            x, v, *_ = integrate_step(MASS, foam, x, v, 0.0, 0.0, 0.0, 2e-5)
        assert -v == pytest.approx(want, abs=most)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("v", [0.0, 0.3, -0.2])
def test_a_symplectic_step_loses_what_a_lossy_contact_pulls_beyond_its_spring(
    side: float, v: float
) -> None:
    """By the velocity at its start, into the contact, whichever side that is on."""
    foam = contact(SYMPLECTIC_EULER, 1.0, 400.0, damping=2.0, side=side)
    t, depth = 1e-4, 0.01
    _, after, *_, lost = integrate_step(MASS, foam, side * depth, side * v, 0.0, 0.0, 0.0, t)
    pull = 400.0 * depth + 2.0 * v
    assert side * after == pytest.approx(v - t * pull / MASS.mass)
    assert lost == pytest.approx(2.0 * v * t * side * after, abs=1e-18)


@pytest.mark.sparse(3)
@pytest.mark.parametrize("scheme", ["discrete_gradient", "dormand_prince", "exact"])
def test_books_close_with_everything_there(scheme: str) -> None:
    p = plant(0.1, 0.3, 0.05, (538.0, 5.0), (0.0, 0.0), (4e3, 3.0, 0.001, 1.0))
    foam = contact(SCHEMES[scheme], 1.0, 4e3, damping=3.0, position=0.001)
    rng = random.Random(3)
    x, v, mode = 0.0, 0.0, 0
    stored = sum(foam_stored(p, foam, x, v, 0.0))
    balance, gross, aim = 0.0, 0.0, 0.0
    c = plant_cache(p, 1e-3)
    for _ in range(2000):
        effort, rate = rng.uniform(-8.0, 8.0), rng.uniform(-1.0, 1.0)
        before = x
        if scheme == "exact":
            x, v, mode, work, *losses = plant_step(p, c, x, v, mode, effort, aim, rate, 1e-3)
        else:
            x, v, work, *losses = integrate_step(p, foam, x, v, effort, aim, rate, 1e-3)
        aim += rate * 1e-3
        balance += work + effort * (x - before) - sum(losses)
        gross += abs(work) + sum(losses)
        assert min(losses) >= -1e-12
    assert balance == pytest.approx(sum(foam_stored(p, foam, x, v, aim)) - stored, abs=1e-8 * gross)


@pytest.mark.slow
def test_the_oracle_is_the_exact_step_in_a_random_life_at_a_wall() -> None:
    p = plant(0.1, 0.3, 0.05, (538.0, 5.0), (0.0, 0.0), (4e3, 3.0, 0.001, 1.0))
    foam = contact(DORMAND_PRINCE, 1.0, 4e3, damping=3.0, position=0.001)
    rng = random.Random(5)
    c = plant_cache(p, 1e-3)
    x, v, mode, y, w = 0.0, 0.0, 0, 0.0, 0.0
    aim, modes = 0.0, set()
    for _ in range(1500):
        effort, rate = rng.uniform(-8.0, 8.0), rng.uniform(-1.0, 1.0)
        x, v, mode, *_ = plant_step(p, c, x, v, mode, effort, aim, rate, 1e-3)
        y, w, *_ = integrate_step(p, foam, y, w, effort, aim, rate, 1e-3)
        aim += rate * 1e-3
        modes.add(mode)
        assert y == pytest.approx(x, abs=1e-10)
        assert w == pytest.approx(v, abs=1e-8)
    assert len(modes) >= 5


def test_a_contact_within_one_step_is_not_missed() -> None:
    p = plant(0.1, 0.0, 0.0, (1e5, 0.0), (0.0, 0.0), (1e4, 0.0, 0.0004, 1.0))
    foam = contact(DORMAND_PRINCE, 1.0, 1e4, position=0.0004)
    c = plant_cache(p, 5e-3)
    x, v = 0.0, 0.45
    want = plant_step(p, c, x, v, 0, 0.0, 0.0, 0.0, 5e-3)[:2]
    free = plant_step(plant(0.1, 0.0, 0.0, (1e5, 0.0)), c, x, v, 0, 0.0, 0.0, 0.0, 5e-3)[:2]
    got = integrate_step(p, foam, x, v, 0.0, 0.0, 0.0, 5e-3)[:2]
    assert got == pytest.approx(want, rel=1e-9)
    assert got != pytest.approx(free, rel=1e-4)


def quadratised(k: float, a: float, mass: float, t: float, *, freed: bool) -> float:
    """Exit speed of the explicit energy-quadratised scheme (Ducceschi, Bilbao 2021), at 1 m/s."""
    before, x, psi = -2.0 * t, -1.0 * t, 0.0
    energy = []
    for _ in range(400):
        if x >= 0.0:
            sign = -1.0 if psi < 0.0 else 1.0
            g = sign * math.sqrt(0.5 * k * (a + 1.0)) * x ** (0.5 * (a - 1.0))
        else:
            way = (2.0 * x - before) - before
            g = -2.0 * psi / way if freed and way != 0.0 else 0.0
        inertia = mass / (t * t)
        after = (2.0 * inertia * x + (0.25 * g * g - inertia) * before - g * psi) / (
            inertia + 0.25 * g * g
        )
        psi += 0.5 * g * (after - before)
        before, x = x, after
        energy.append(0.5 * mass * ((x - before) / t) ** 2 + 0.5 * psi * psi)
    assert energy[-1] == pytest.approx(
        0.5 * mass, rel=1e-9
    )  # in either case: this is no test of it
    return (before - x) / t


def test_trap_the_quadratised_scheme_sticks_without_its_rule_after_the_contact() -> None:
    t = 1.0 / 44100.0
    assert quadratised(1e10, 1.5, 0.01, t, freed=True) == pytest.approx(1.0, abs=1e-9)
    assert quadratised(1e10, 1.5, 0.01, t, freed=False) < 0.97


def test_energy_behaviour_inside_a_spring() -> None:
    p = plant(0.1, 0.0, 0.0, (1000.0, 0.0))
    t = 1e-3  # w t = 0.1
    drift = {}
    for name, scheme in STEPPING.items():
        none = contact(scheme, 1.0, 0.0)
        x, v, found = 0.0, 1.0, []
        for _ in range(20_000):
            x, v, *_ = integrate_step(p, none, x, v, 0.0, 0.0, 0.0, t)
            found.append(0.5 * 0.1 * v * v + 500.0 * x * x)
        drift[name] = (found[-1] / 0.05 - 1.0, (max(found) - min(found)) / 0.05)
    assert drift["discrete_gradient"][1] < 1e-11
    assert drift["implicit_midpoint"][1] < 1e-11
    assert drift["symplectic_euler"][1] == pytest.approx(0.1, rel=0.1)  # |dE|/E ~ wT/2 each way
    assert drift["rk4"][0] == pytest.approx(-20_000 * 0.1**6 / 72.0, rel=0.05)


def test_the_default_is_today_s_step_to_the_bit() -> None:
    rng = random.Random(9)
    p = plant(0.2, 0.1, 0.02, (538.0, 5.0))
    foam = FoamParams(5e4, 1.5, 3.0, 0.001, 1.0, 3)
    x, v = 0.0, 0.0
    for _ in range(500):
        rest = (rng.uniform(-4, 4), rng.uniform(-0.01, 0.01), rng.uniform(-1, 1), 1e-3)
        got = integrate_step(p, foam, x, v, *rest)
        assert got == foam_step(p, foam, x, v, *rest)
        x, v = got[:2]
    assert elastic_energy(foam, 0.0) == 0.0


@pytest.mark.parametrize("tolerance", [1e-8, 1e-12, 1e-14])
def test_the_oracle_takes_few_steps_where_forces_balance(tolerance: float) -> None:
    """Pressed into a wall by a held grip the acceleration is rounding, and so is its estimate."""
    p = plant(0.1, 0.3, 0.0, (538.0, 5.0))
    foam = contact(DORMAND_PRINCE, 1.0, 4e3, damping=3.0, tolerance=tolerance)
    x, v = 0.03 * 538.0 / 4538.0, 1e-17
    for _ in range(20):
        x, v, *_ = integrate_step(p, foam, x, v, 0.0, 0.03, 0.0, 1e-3)
    assert x == pytest.approx(0.03 * 538.0 / 4538.0, rel=1e-12)
    assert abs(v) < 1e-13


@pytest.mark.parametrize("tolerance", [0.3, 0.1, 0.01, 1e-4, 1e-6])
@pytest.mark.parametrize("exponent", [1.0, 1.5, 3.0])
def test_a_tolerance_so_coarse_that_a_step_jumps_over_the_contact(
    tolerance: float, exponent: float
) -> None:
    """It starts on the surface and is out again within a step: both edges are the same one."""
    foam = contact(DORMAND_PRINCE, exponent, 1e4, tolerance=tolerance)
    for start in (-2e-3, -1e-3, -1e-4):
        x, v, *rest = integrate_step(MASS, foam, start, 1.0, 0.0, 0.0, 0.0, 0.2)
        assert rest[4] == 0.0  # it got to the end, and nothing was held
        assert math.isfinite(x)
        if tolerance < 1e-3:
            assert -v == pytest.approx(1.0, abs=20.0 * tolerance)
            assert x < -0.02
