"""What a scheme holds, what `auto` chooses, and what a rig's key makes of it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from tautwave.bench.rigs import ONE_PAIR
from tautwave.config import load_rig
from tautwave.errors import ConfigError
from tautwave.models.foam import FoamParams
from tautwave.models.integrators.bounds import (
    CONTACT_RATE,
    contact_slope,
    contact_stiffness_limit,
    greatest_depth,
    greatest_stiffness,
    step_growth,
)
from tautwave.models.integrators.choice import (
    FOUND,
    Trial,
    bounce_error,
    choose_scheme,
    exact_bounce,
    one_bounce,
    refusal,
    smooth_error,
    try_scheme,
)
from tautwave.models.integrators.schemes import (
    DISCRETE_GRADIENT,
    DORMAND_PRINCE,
    EXACT,
    IMPLICIT_MIDPOINT,
    RK4,
    SYMPLECTIC_EULER,
    integrate_step,
)
from tautwave.rig import axis_integration, axis_model
from tests.models.plants import plant

T = 1e-3
BOUNDED = [SYMPLECTIC_EULER, RK4]


def growth_seen(scheme: int, stiffness: float, damping: float) -> float:
    """Growth per step of a real oscillator of 0.1 kg, over the last 2000 of 4000 steps."""
    p = plant(0.1, damping, 0.0, (stiffness, 0.0))
    none = FoamParams(0.0, 1.0, 0.0, 0.0, 1.0, 1, 0.0, scheme)
    x, v, sizes = 0.0, 1e-3, []
    for at in range(4000):
        x, v, *_ = integrate_step(p, none, x, v, 0.0, 0.0, 0.0, T)
        size = max(abs(x) / T, abs(v))
        x, v = x / size, v / size
        if at >= 2000:
            sizes.append(math.log(size))
    return math.exp(sum(sizes) / len(sizes))


@pytest.mark.sparse(5)
@pytest.mark.parametrize("scheme", BOUNDED)
@pytest.mark.parametrize("damping", [0.0, 5.0, 60.0])
@pytest.mark.parametrize("share", [0.3, 0.97, 1.03, 1.5])
def test_linear_bound_is_where_a_step_begins_to_grow(
    scheme: int, damping: float, share: float
) -> None:
    k = share * greatest_stiffness(scheme, damping, 0.1, T)
    grows = step_growth(scheme, k, damping, 0.1, T)
    assert (grows <= 1.0) == (share < 1.0)
    assert growth_seen(scheme, k, damping) == pytest.approx(grows, rel=2e-3)


def test_bounds_known_by_heart() -> None:
    assert greatest_stiffness(SYMPLECTIC_EULER, 0.0, 0.1, T) == pytest.approx(4.0 * 0.1 / T**2)
    assert greatest_stiffness(RK4, 0.0, 0.1, T) == pytest.approx(8.0 * 0.1 / T**2)
    for scheme in (EXACT, DISCRETE_GRADIENT, IMPLICIT_MIDPOINT, DORMAND_PRINCE):
        assert greatest_stiffness(scheme, 0.0, 0.1, T) == math.inf


@pytest.mark.parametrize("scheme", [SYMPLECTIC_EULER, RK4, IMPLICIT_MIDPOINT])
@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0, 3.0])
def test_at_its_contact_limit_a_scheme_gives_the_speed_back_within_5_percent(
    scheme: int, exponent: float
) -> None:
    p = plant(0.1)
    limit = contact_stiffness_limit(scheme, 0.0, 0.1, T)
    assert limit == pytest.approx(0.1 * (CONTACT_RATE / T) ** 2)
    low, high = 0.0, 20.0
    for _ in range(80):
        middle = 0.5 * (low + high)
        foam = FoamParams(10.0**middle, exponent, 0.0, 0.0, 1.0, 1, 0.0, scheme)
        if contact_slope(foam, greatest_depth(p, foam, 1.0, 0.0)) > limit:
            high = middle
        else:
            low = middle
    foam = foam._replace(stiffness=10.0**low)
    assert not refusal(p, foam, scheme, 1.0, T)
    assert "holds a contact of at most" in refusal(
        p, foam._replace(stiffness=1.3 ** (exponent + 1.0) * foam.stiffness), scheme, 1.0, T
    )
    for phase in range(16):
        x, v = -(phase + 0.5) / 16.0 * T, 1.0
        while not (v < 0.0 and x < 0.0):
            x, v, *_ = integrate_step(p, foam, x, v, 0.0, 0.0, 0.0, T)
        assert -v == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("scheme", [DISCRETE_GRADIENT, DORMAND_PRINCE])
def test_nothing_is_too_stiff_for_the_others(scheme: int) -> None:
    foam = FoamParams(1e9, 1.5, 0.0, 0.0, 1.0, 1, 0.0, scheme)
    assert refusal(plant(1e-3), foam, scheme, 1.0, T) == ""


@pytest.mark.slow
@pytest.mark.parametrize("stiffness", [10.0, 1e4, 1e7])
@pytest.mark.parametrize("max_error", [1e-2, 1e-4, 1e-6])
def test_auto_meets_the_error_and_nothing_tried_was_cheaper(
    stiffness: float, max_error: float
) -> None:
    p = plant(0.01, 0.005)
    foam = FoamParams(stiffness, 1.5, 0.2, 0.0, 1.0, 1)
    choice = choose_scheme(p, foam, 2.0, T, max_error, linear=False)
    best = choice.best
    assert best.error <= max_error
    found = bounce_error(
        p,
        foam._replace(scheme=best.scheme, substeps=best.substeps, tolerance=best.tolerance),
        2.0,
        T,
    )
    assert found <= max_error
    assert all(t.cost_ns >= best.cost_ns for t in choice.tried if t.error <= max_error)
    assert f"<= {max_error:g}" in choice.why


def worst_on_a_grid(mass: float, foam: FoamParams, count: float, cells: int = 12) -> float:
    """Worst error of a bounce over entry phases and half a step more or less than `count`."""
    p = plant(mass)
    ended = exact_bounce(p, foam, 1.0)
    middles = [(i + 0.5) / cells for i in range(cells)]
    return max(
        one_bounce(p, foam, 1.0, ended[1] / (count + more - 0.5), phase, *ended)
        for phase in middles
        for more in middles
    )


@pytest.mark.slow
@pytest.mark.parametrize("scheme", [SYMPLECTIC_EULER, RK4, IMPLICIT_MIDPOINT])
@pytest.mark.parametrize("count", [5.0, 32.0, 32.37])
@pytest.mark.parametrize(("exponent", "damping"), [(1.0, 0.0), (1.0, 1.0), (1.5, 0.0)])
def test_the_error_reported_is_nearly_that_of_the_worst_entry_and_step(
    scheme: int, count: float, exponent: float, damping: float
) -> None:
    foam = FoamParams(100.0, exponent, 0.0, 0.0, 1.0, 1, damping, scheme)
    _, length = exact_bounce(plant(0.1), foam, 1.0)
    found = bounce_error(plant(0.1), foam, 1.0, length / count)
    assert 0.75 < found / worst_on_a_grid(0.1, foam, count) < 1.34


@pytest.mark.slow
def test_a_step_that_divides_the_contact_gets_no_credit_for_it() -> None:
    wall = FoamParams(100.0, 1.0, 0.0, 0.0, 1.0, 1, 0.0, RK4)
    p = plant(0.1)
    ended = exact_bounce(p, wall, 1.0)
    lucky = max(one_bounce(p, wall, 1.0, ended[1] / 32.0, i / 8.0, *ended) for i in range(8))
    assert lucky < 1e-5
    assert bounce_error(p, wall, 1.0, ended[1] / 32.0) > 3e-4
    for count in (32.0, 512.0, 2e4):  # those that a long contact is tried with, too
        at, beside = (bounce_error(p, wall, 1.0, ended[1] / (count + s)) for s in (0.0, 0.37))
        assert at == pytest.approx(beside, rel=0.2)


def test_what_auto_takes_at_a_lucky_step_holds_at_other_stiffnesses() -> None:
    p = plant(0.1)
    wall = FoamParams(100.0, 1.0, 0.0, 0.0, 1.0, 1, 0.0, RK4)
    h = exact_bounce(p, wall, 1.0)[1] / 32.0
    best = try_scheme(p, wall, RK4, 1.0, h, 1e-4, math.inf)
    assert best.substeps > 1
    for share in (0.96, 0.98, 1.0, 1.02, 1.04):
        other = wall._replace(stiffness=share * wall.stiffness)
        ended = exact_bounce(p, other, 1.0)
        errors = [one_bounce(p, other, 1.0, h / best.substeps, i / 8.0, *ended) for i in range(8)]
        assert max(errors) <= 1e-4


def test_what_was_asked_for_holds_beyond_the_entries_that_were_tried() -> None:
    """Found with random contacts: 32 sub-steps seemed enough by 2 %, and were off by 8 % more."""
    mass, speed, h, asked = (
        1.8213689890030294e-4,
        0.031292776370458256,
        5.964313061259026e-5,
        1.91e-5,
    )
    wall = FoamParams(9597.138976119224, 1.0, 0.0, 0.0, 1.0, 1, 0.0, SYMPLECTIC_EULER)
    best = try_scheme(plant(mass), wall, SYMPLECTIC_EULER, speed, h, asked, math.inf)
    ended = exact_bounce(plant(mass), wall, speed)
    worst = max(
        one_bounce(
            plant(mass), wall, speed, h / best.substeps * (1.0 + 1e-3 * more), i / 40.0, *ended
        )
        for i in range(40)
        for more in (-2, -1, 0, 1, 2)
    )
    assert worst <= best.error <= asked


@pytest.mark.parametrize("scheme", [DORMAND_PRINCE, SYMPLECTIC_EULER])
def test_a_trial_that_fails_says_what_it_tried_last(
    scheme: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def poor(_: Any, foam: FoamParams, *__: float) -> float:
        asked.append(foam)
        return 0.25 * FOUND

    monkeypatch.setattr("tautwave.models.integrators.choice.bounce_error", poor)
    foam = FoamParams(100.0, 1.5, 0.2, 0.0, 1.0, 1)
    trial = try_scheme(plant(0.01), foam, scheme, 2.0, T, 1e-4, 1000.0)
    last = asked[-1]
    tolerance = last.tolerance if scheme == DORMAND_PRINCE else 0.0
    assert trial == Trial(scheme, last.substeps, tolerance, error=0.25, cost_ns=math.inf)
    assert scheme != DORMAND_PRINCE or tolerance == pytest.approx(1e-10)
    if scheme != DORMAND_PRINCE:
        nothing = try_scheme(plant(0.01), foam, scheme, 2.0, T, 1e-4, 1.0)
        assert nothing == Trial(scheme, 0, 0.0, error=math.inf, cost_ns=math.inf)


def test_a_step_too_short_to_try_out_is_not_called_exact() -> None:
    lossy = FoamParams(1.0, 1.5, 0.2, 0.0, 1.0, 1, 0.0, SYMPLECTIC_EULER)
    tried, beyond = (bounce_error(plant(1.0), lossy, 1.0, h) for h in (2e-4, 1e-5))
    assert beyond == pytest.approx(0.05 * tried, rel=0.1)
    spring = plant(1.0, 0.0, 0.0, (1.0, 0.0))
    # Swings by w t / 2: sin(1) / 2 of w t after a radian; tried over a part of one.
    assert smooth_error(spring, SYMPLECTIC_EULER, 1.0, 2e-5) == pytest.approx(0.84e-5, rel=0.2)


def test_auto_takes_the_exact_step_at_a_stiff_wall_and_says_why() -> None:
    wall = FoamParams(1e6, 1.0, 0.0, 0.0, 1.0, 1, 2.0)
    choice = choose_scheme(plant(0.1), wall, 1.0, T, 1e-4, linear=True)
    assert choice.best.scheme == EXACT
    assert choice.why.startswith("exact in 1 sub-step")


def rig_with(*keys: str, file: str = "bench-foam-loopback.yaml") -> Any:
    path = ONE_PAIR.path().parent / file
    return load_rig(path, [f"simulation.{key}" for key in keys])


def test_without_the_key_nothing_changes() -> None:
    model = axis_model(rig_with(), "slave.lever", 10)
    assert model.foam is not None
    assert model.foam.scheme == DISCRETE_GRADIENT
    wall = axis_model(load_rig(ONE_PAIR.path()), "slave.lever", 10)
    assert wall.foam is None


@pytest.mark.slow
def test_a_rig_names_its_scheme() -> None:
    rig = rig_with("integrator.scheme=rk4", "integrator.max_error=1e-6")
    made = axis_integration(rig, "slave.lever")
    assert made.scheme == "rk4"
    assert made.foam is not None
    assert made.foam.scheme == RK4
    assert axis_model(rig, "slave.lever", 10).foam == made.foam
    assert "<= 1e-06" in made.why


@pytest.mark.parametrize(
    ("keys", "part"),
    [
        (("integrator.scheme=exact",), "exact handles walls and springs only"),
        (
            ("integrator.scheme=symplectic_euler", "environment.lever.stiffness=1e6"),
            "holds a contact of at most",
        ),
        (
            (
                "integrator.scheme=implicit_midpoint",
                "integrator.max_error=1e-9",
                "environment.lever.stiffness=1e9",
            ),
            "of at most 1024",
        ),
    ],
)
def test_what_a_scheme_cannot_hold_is_refused_with_numbers(
    keys: tuple[str, ...], part: str
) -> None:
    with pytest.raises(ConfigError, match=part):
        axis_model(rig_with(*keys), "slave.lever", 10)


@pytest.mark.sparse(4)
@pytest.mark.parametrize(
    "scheme", ["auto", "symplectic_euler", "implicit_midpoint", "rk4", "dormand_prince"]
)
def test_the_kernel_moves_as_the_axis_does(scheme: str) -> None:
    from tautwave.simulation.kernel.pack import pack_rig
    from tautwave.simulation.run import simulate

    rig = rig_with(f"integrator.scheme={scheme}")
    rows = simulate(rig, duration_s=0.3, engine="python")
    assert np.isfinite(rows["true.slave.lever.position"]).all()
    devices = pack_rig(rig, 0.01).devices
    assert devices[1].foam == axis_model(rig, "slave.lever", 10).foam


@pytest.mark.slow
@pytest.mark.parametrize(
    "scheme", ["symplectic_euler", "implicit_midpoint", "rk4", "dormand_prince"]
)
def test_compiled_and_c_give_the_bits_of_plain_python(scheme: str) -> None:
    pytest.importorskip("numba")
    from tautwave.simulation.run import simulate

    rig = rig_with(f"integrator.scheme={scheme}", file="bench-1dof-loopback.yaml")
    rows = {e: simulate(rig, duration_s=3.0, engine=e) for e in ("compiled", "python")}
    assert rows["compiled"].data.tobytes() == rows["python"].data.tobytes()
