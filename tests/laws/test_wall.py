"""The local virtual wall: what a sampled wall leaks, and the two ways of leaking nothing."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.laws.limit import LimitParams
from tautwave.laws.site import SiteParams, render_wall
from tautwave.laws.wall import (
    WallParams,
    control_wall,
    hold_wall,
    wall_depth,
    wall_effort,
    wall_loss,
    wall_stored,
)
from tests.laws.loops import Device, matrix_of, radius

MASS, K, T = 0.1, 1000.0, 1e-3
PHASES = (np.arange(64) + 0.5) / 64.0


def wall(K: float = K, B: float = 0.0, controlled: bool = False, side: float = 1.0) -> WallParams:
    return WallParams(0.0, side, K, B, controlled=controlled)


def test_pole_radius_of_the_bare_sampled_wall_is_that_of_theory_D6() -> None:
    row_x, row_v = Device(MASS).flow(T)
    p = wall()

    def cycle(state: list[float]) -> list[float]:
        x, v = state
        # Linear in contact: taken at a depth, less what the wall does there.
        effort = wall_effort(p, 10.0 + x, v) - wall_effort(p, 10.0, 0.0)
        return [
            row_x[0] * x + row_x[1] * v + row_x[2] * effort,
            row_v[0] * x + row_v[1] * v + row_v[2] * effort,
        ]

    assert radius(matrix_of(cycle, 2)) == pytest.approx(1.0024968828, abs=1e-9)


class Bounce:
    """A ballistic mass thrown at the wall at 1 m/s, `phase` of a sample before it gets there."""

    def __init__(
        self,
        p: WallParams,
        period: float,
        phase: float,
        *,
        delay: int = 0,
        damping: float = 0.0,
        believed: float = 1.0,
        filter_gain: float = 1.0,
    ) -> None:
        row_x, row_v = Device(MASS, damping).flow(period)
        side = p.side
        x, v = -side * (1.0 - phase) * period, side
        mobility = period / (2.0 * MASS * believed)
        energy = impulse = last = 0.0
        velocity = v
        waiting = [0.0] * delay
        depth = 0.0
        self.contact_energy = self.least = self.dissipated = self.flow = 0.0
        self.wall_velocity = v
        touched = False
        for _ in range(100_000):
            effort = 0.0
            if depth > 0.0:
                touched = True
                effort = wall_effort(p, depth, self.wall_velocity)
                if p.controlled:
                    free_velocity = velocity - mobility * (impulse + 2.0 * sum(waiting))
                    effort = control_wall(p, effort, energy, free_velocity, mobility, period)
            elif touched and side * v < 0.0 and not any(waiting):
                break
            waiting.append(effort)
            last = waiting.pop(0)
            after = row_x[0] * x + row_x[1] * v + row_x[2] * last
            v = row_v[0] * x + row_v[1] * v + row_v[2] * last
            moved, before = after - x, depth
            x, depth = after, wall_depth(p, after)
            energy = energy + last * moved if depth > 0.0 else 0.0
            self.contact_energy += last * moved
            self.flow += abs(last * moved)
            self.least = min(self.least, self.contact_energy)
            self.dissipated += wall_loss(p, last, moved, before, depth)
            velocity, impulse = moved / period, last
            self.wall_velocity += filter_gain * (velocity - self.wall_velocity)
        else:
            raise AssertionError("it never came out")
        self.restitution = abs(v)
        self.stored = wall_stored(p, depth)


def test_mean_energy_ratio_of_a_bounce_is_that_of_theory_D6() -> None:
    ratio = np.mean([Bounce(wall(), T, phase).restitution ** 2 for phase in PHASES])
    assert ratio == pytest.approx(1.16984, abs=3e-4)
    assert math.exp(0.5 * math.pi * math.sqrt(K / MASS) * T) == pytest.approx(1.17009, abs=1e-5)


@pytest.mark.parametrize("period", [1e-3, 5e-4, 1e-4])
@pytest.mark.parametrize("damping", [0.0, 0.25])
def test_a_bare_wall_generates_what_theory_says(period: float, damping: float) -> None:
    """Within 1 % of exp(pi (K T / 2 - b) / sqrt(K m)) - 1 (theory 1.4), by the wall's own books."""
    predicted = math.exp(math.pi * 0.5 * K * period / math.sqrt(K * MASS)) - 1.0
    runs = [Bounce(wall(), period, phase) for phase in PHASES[::4]]
    start = 0.5 * MASS
    generated = np.mean([-run.least for run in runs]) / start
    # The books of wall and mass agree: the wall gave what the mass gained.
    gained = np.mean([run.restitution**2 - 1.0 for run in runs])
    assert generated == pytest.approx(gained, rel=1e-9)
    assert generated == pytest.approx(predicted, rel=0.01)
    for run in runs:
        assert abs(run.contact_energy - run.stored - run.dissipated) <= 1e-12 * run.flow
    if damping:
        ratio = np.mean(
            [Bounce(wall(), period, f, damping=damping).restitution ** 2 for f in PHASES]
        )
        theory = math.exp(math.pi * (0.5 * K * period - damping) / math.sqrt(K * MASS))
        assert ratio == pytest.approx(theory, rel=0.01)


@pytest.mark.parametrize("B", [0.0, 0.1, 0.3])
def test_device_damping_above_the_bound_takes_in_all_that_the_wall_leaks(B: float) -> None:
    """b >= K T / 2 + B: at the plant, wall and damper together never give more than they got.

    The mass starts in any state and is pushed by any held force; energy into (wall + damper)
    is the integral of the wall's effort plus viscous loss, exact by the device's own energy.
    """
    rng = np.random.default_rng(3)
    b = 0.5 * K * T + B
    p = wall(B=B)
    row_x, row_v = Device(MASS, b).flow(T)
    for _ in range(40):
        x, v = -2e-4 * rng.random(), rng.uniform(-0.1, 0.3)
        depth, velocity, pushed = 0.0, v, 0.0
        start = 0.5 * MASS * v * v
        for k in range(400):
            push = rng.choice([-1.0, 1.0]) * rng.random() * (2.0 if k % 7 else 20.0)
            effort = wall_effort(p, depth, velocity)
            after = row_x[0] * x + row_x[1] * v + row_x[2] * (effort - push)
            v = row_v[0] * x + row_v[1] * v + row_v[2] * (effort - push)
            pushed += push * (after - x)
            velocity, x = (after - x) / T, after
            depth = wall_depth(p, x)
            taken = start + pushed - 0.5 * MASS * v * v  # into wall and damper so far
            assert taken >= -1e-12


def test_half_the_damping_is_not_enough() -> None:
    """The same books fail below the bound: so they can."""
    b = 0.25 * K * T
    run = [Bounce(wall(), T, phase, damping=b).restitution for phase in PHASES]
    assert np.mean(np.square(run)) > 1.05


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_passivity_control_makes_a_ballistic_bounce_exact(side: float) -> None:
    for phase in PHASES[::4]:
        run = Bounce(wall(controlled=True, side=side), T, phase)
        assert run.restitution == pytest.approx(1.0, abs=1e-12)
        assert run.least >= -1e-14


def test_passivity_control_with_an_underestimated_mass_loses_rather_than_gains() -> None:
    for phase in PHASES[::8]:
        assert Bounce(wall(controlled=True), T, phase, believed=0.6).restitution <= 1.0 + 1e-12


def test_passivity_control_is_bounded_with_a_delayed_command() -> None:
    bare = np.array([Bounce(wall(), T, phase, delay=1).restitution for phase in PHASES[::4]])
    kept = np.array(
        [Bounce(wall(controlled=True), T, phase, delay=1).restitution for phase in PHASES[::4]]
    )
    assert bare.min() > 1.2
    # The observer does not know yet what the effort under way will give: half a sample's worth
    # of energy is lost control of, against one and a half samples' worth for the bare wall.
    assert kept.max() < 1.08


@given(
    st.floats(-1e3, 1e3), st.floats(-10.0, 10.0), st.floats(-10.0, 10.0),
    st.floats(1e-5, 1.0), st.sampled_from([1.0, -1.0]),
)  # fmt: skip
def test_the_controller_only_ever_takes_away(
    effort: float, energy: float, free_velocity: float, mobility: float, side: float
) -> None:
    p = wall(controlled=True, side=side)
    effort = side * abs(effort)  # a wall never pulls
    out = control_wall(p, effort, energy, free_velocity, mobility, T)
    assert abs(out) <= abs(effort)
    assert out * effort >= 0.0
    planned = energy + out * T * (free_velocity - mobility * out)
    if energy >= 0.0:
        scale = energy + abs(out) * T * (abs(free_velocity) + mobility * abs(out))
        assert planned >= -1e-12 * scale - 1e-300


@given(st.floats(-1, 1), st.floats(-100, 100), st.sampled_from([1.0, -1.0]), st.floats(0, 100))
def test_it_only_pushes_out_and_only_inside(x: float, v: float, side: float, B: float) -> None:
    p = WallParams(0.1, side, K, B, controlled=False)
    depth = wall_depth(p, x)
    effort = wall_effort(p, depth, v)
    assert depth == max(0.0, side * (x - 0.1))
    assert side * effort >= 0.0  # resisting effort towards the wall's inside
    if depth == 0.0:
        assert effort == 0.0
    assert wall_stored(p, depth) == 0.5 * K * depth * depth


def test_loss_is_what_came_in_less_what_the_spring_holds() -> None:
    p = wall()
    before, after = 0.002, 0.005
    held = wall_stored(p, after) - wall_stored(p, before)
    assert wall_loss(p, 3.0, 0.003, before, after) == pytest.approx(3.0 * 0.003 - held)
    # A spring alone, its effort held over the period: the leak is K dx**2 / 2.
    leak = wall_loss(p, wall_effort(p, before, 0.0), after - before, before, after)
    assert leak == pytest.approx(-0.5 * K * (after - before) ** 2)


HELD, FASTEST = 0.051, 5.0
"""[s] and [m/s] Of a stall: how long an effort is held, and the device's limit."""


def indebted(reserve: float) -> WallParams:
    reach, drift = FASTEST * HELD, 0.5 * HELD * HELD / MASS
    most = 2.0 * reserve / (reach + math.sqrt(reach * reach + 4.0 * drift * reserve))
    return wall(controlled=True)._replace(reserve=reserve, reach=reach, drift=drift, most=most)


def paid(p: WallParams, push: float, energy: float, free_velocity: float, mobility: float) -> float:
    """A controlled wall's effort as a site bounds it."""
    return control_wall(p, min(push, p.most), energy, free_velocity, mobility, T)


@given(st.floats(1e-6, 50.0), st.floats(0.0, 1.0), st.floats(1.0, 1e4))
def test_a_walls_push_is_what_a_stall_may_cost(reserve: float, share: float, push: float) -> None:
    """Closed form: F (v h + F h**2 / 2m) is what is left of the reserve, or F is as requested."""
    p = indebted(reserve)
    left = reserve * (1.0 - share)
    into = FASTEST + 1e6  # deep inward: the period's own rule allows any push
    got = paid(p, push, -share * reserve, into, 1e-9)
    spent = got * (FASTEST * HELD + got * HELD * HELD / (2.0 * MASS))
    assert got <= push
    assert spent == pytest.approx(left, rel=1e-9, abs=1e-9 * reserve) or (
        got == push and spent <= left * (1.0 + 1e-12)
    )


@given(
    st.lists(
        st.tuples(st.floats(0.0, 2e3), st.floats(-5.0, 5.0), st.integers(0, 50), st.floats(-1, 1)),
        min_size=1,
        max_size=80,
    )
)
def test_stalls_whenever_they_come_leave_no_more_than_the_reserve(
    script: list[tuple[float, float, int, float]],
) -> None:
    """The adversary chooses pushes, speeds, stalls and where the device goes in them."""
    p = indebted(3.0)
    energy, least = 0.0, 0.0
    for push, free_velocity, skipped, way in script:
        got = paid(p, push, energy, free_velocity, T / (2.0 * MASS))
        held = T * (skipped + 1)
        out = way * (FASTEST * held + got * held * held / (2.0 * MASS))
        energy -= got * out
        least = min(least, energy)
        if way > 0.0:  # it has left the wall
            energy = min(energy, 0.0)
    assert least >= -3.0 * (1.0 + 1e-12)


def test_without_a_reserve_the_same_stalls_take_any_amount() -> None:
    """What the bound is for: cut out, ten stalls on the way in take ten times as much."""
    bare, kept = wall(controlled=True), indebted(3.0)
    for p, most in ((bare, math.inf), (kept, 3.0)):
        energy = 0.0
        for _ in range(10):
            push = paid(p, 40.0, energy, FASTEST, 1e-9)
            energy -= push * FASTEST * HELD
        assert (-energy > 30.0) if p is bare else (0.0 < -energy <= most)


@pytest.mark.parametrize("side", [1.0, -1.0])
@given(
    push=st.floats(0.1, 50.0),
    reach=st.floats(1e-4, 1.0),
    drift=st.floats(1e-6, 1e-2),
    stiffer=st.floats(1.0, 100.0),
    owed=st.floats(0.0, 2.0),
)
def test_a_stiffer_wall_may_owe_no_more_than_the_first_one(
    side: float, push: float, reach: float, drift: float, stiffer: float, owed: float
) -> None:
    reserve = push * (reach + drift * push)
    p = WallParams(0.0, side, K, 0.0, False, reserve, reach, drift)
    assert hold_wall(p, side * push, 0.0) == side * push  # what the rig's wall asks for passes
    held = side * hold_wall(p, side * stiffer * push, -owed * reserve)
    assert 0.0 <= held <= stiffer * push
    left = max(0.0, reserve - owed * reserve)
    assert held * (reach + drift * held) <= left * (1.0 + 1e-9)
    if stiffer * push * (reach + drift * stiffer * push) > left > 0.0:
        assert held * (reach + drift * held) == pytest.approx(left, rel=1e-9)


def test_a_wall_without_a_limit_of_velocity_is_not_held() -> None:
    assert hold_wall(wall(), 1e9, -1e9) == 1e9


def test_a_site_holds_a_wall_that_was_made_stiffer() -> None:
    reach, drift, push = 0.1, 0.01, 2.0
    reserve = push * (reach + drift * push)
    first = WallParams(0.0, 1.0, 10.0, 0.0, False, reserve, reach, drift, push)
    limit = LimitParams(effort=50.0)
    site = SiteParams(T, 0.0, first, limit, 1.0, 0.0, has_wall=True)
    assert render_wall(site, 0.0, False, 0.2, 0.0, 0.0, 50.0) == 2.0
    stiffer = site._replace(wall=first._replace(stiffness=30.0))
    assert render_wall(stiffer, 0.0, False, 0.2, 0.0, 0.0, 50.0) == push
