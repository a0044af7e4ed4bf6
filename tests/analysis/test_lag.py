"""What the lag of an observer takes from a tank: the form against the laws in time, its bound."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

from tautwave.analysis.wave_port.lag import SHARE, lag_power, swing_power
from tautwave.laws.observer import observe, observer_params, plain_observer
from tautwave.laws.port import PortParams, port_close, port_effort, port_params

T = 1e-3
B, MASS = 0.03, 1e-3
RICH = 1e30


def port(delay: int, *, gain: float = 1.0, matched: bool = False) -> PortParams:
    return port_params(
        T, B, MASS, delay=float(delay), filter_gain=gain, matched=matched, reserve=1.0
    )


def swung(p: PortParams, pole: float, delay: int, samples: int, wave: complex) -> list[complex]:
    """Swing a lever by 1 rad and a wave; return its velocity, its effort and the tank's power."""
    seen = observer_params(T, MASS, pole)
    turn = 2.0 * math.pi / samples
    x = at = velocity = push = filtered = 0.0
    efforts, waves = [0.0] * (delay + 1), [0.0] * (delay + 1)
    work, speed, force = 0.0, 0j, 0j
    for k in range(40 * samples):
        counts = k >= 20 * samples
        acted, tag = efforts.pop(0), waves.pop(0)
        now = math.cos(turn * (k + 1))
        ahead, velocity, push = observe(seen, at, velocity, push, now, acted, 1.0)
        _, _, _, filtered, gained, _, _ = port_close(
            p, RICH, 0.0, filtered, now - x, ahead - at, 1.0, acted, tag,
            0.5 * T * tag * tag, False,
        )  # fmt: skip
        if counts:
            share = cmath.exp(-1j * turn * k) / (10.0 * samples)
            work += gained / (20.0 * samples * T)
            speed, force = speed + share * (now - x) / T, force + share * acted
        x, at = now, ahead
        came = (wave * cmath.exp(1j * turn * (k + 1))).real
        effort = port_effort(p, RICH, velocity, push, sum(efforts), came)
        efforts.append(effort)
        waves.append(came)
    return [speed, force, complex(work)]


@pytest.mark.parametrize("pole", [0.5, 0.1])
@pytest.mark.parametrize(
    ("delay", "options"),
    [(0, {}), (1, {"gain": 0.4}), (2, {"gain": 0.4, "matched": True})],
    ids=["plain", "filter", "matched"],
)
def test_the_form_is_what_the_laws_do(pole: float, delay: int, options: dict) -> None:
    p, samples = port(delay, **options), 60
    for wave in (0.0, 30.0 * cmath.exp(0.7j), 200j):
        v, f, power = swung(p, pole, delay, samples, wave)
        found = swing_power(
            p, observer_params(T, MASS, pole), delay, np.array([2.0 * math.pi / samples])
        )
        form = (
            found.vv[0] * abs(v) ** 2
            + 2.0 * (found.vf[0] * v.conjugate() * f).real
            + found.ff[0] * abs(f) ** 2
        )
        scale = abs(v) ** 2 * B + abs(v) * abs(f) + abs(f) ** 2 / B
        assert abs(0.5 * form - power.real) < 1e-7 * scale


@pytest.mark.parametrize("delay", [0, 1, 2])
@pytest.mark.parametrize("pole", [0.5, 0.3, 0.0])
def test_a_slow_swing_costs_what_the_observer_lags_behind_a_ramp(pole: float, delay: int) -> None:
    """A triple pole is late for an acceleration that ramps by errors of velocity and acceleration.

    Solved from the filter's own steady state, then carried over the delay to the middle of the
    period in which the effort acts.
    """
    rest = 1.0 - pole
    push = 1.5 * (1.0 + pole) / rest - 0.5
    speed = (1.0 - pole**3) / rest**3 - 0.5 * push - 1.0 / 6.0
    lead = delay + 0.5
    late = speed + lead * push + 0.5 * lead * lead + 1.0 / 24.0
    swing = 1e-3
    found = swing_power(port(delay), observer_params(T, MASS, pole), delay, np.array([swing]))
    assert abs(found.vf[0]) == pytest.approx(0.5 * B * T / MASS * late * swing, rel=0.02)


def test_the_bound_is_the_worst_swing_of_its_share_of_the_limits() -> None:
    p, seen = port(1, gain=0.4), observer_params(T, MASS, 0.5)
    most = lag_power(p, seen, 1, 1.0, 12.0)
    least = 0.0
    for hertz in np.geomspace(0.05, 10.0, 300):
        form = swing_power(p, seen, 1, np.array([2.0 * math.pi * hertz * T]))
        for phase in np.linspace(0.0, 2.0 * math.pi, 90):
            f = SHARE * cmath.exp(1j * phase)
            power = 0.5 * (form.vv[0] * (12.0 * SHARE) ** 2 + form.ff[0] * SHARE**2)
            least = min(least, power + (form.vf[0] * 12.0 * SHARE * f).real)
    assert most == pytest.approx(-least, rel=0.01)
    assert lag_power(p, seen, 1, 2.0, 24.0) == pytest.approx(4.0 * most)


def test_no_bound_without_limits_or_without_an_observer() -> None:
    p = port(0)
    assert lag_power(p, observer_params(T, MASS, 0.5), 0, math.inf, 1.0) == 0.0
    assert lag_power(p, observer_params(T, MASS, 0.5), 0, 1.0, math.inf) == 0.0
    assert lag_power(p, plain_observer(T, MASS), 0, 1.0, 1.0) == 0.0
