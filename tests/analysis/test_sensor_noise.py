"""What noise takes from a tank: the formula against the law run on noise, and the worst colour."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tautwave.analysis.wave_port.sensor_noise import (
    noise_bounds,
    noise_power,
    noise_responses,
    tank_changes,
    worst_changes,
)
from tautwave.laws.observer import observe
from tautwave.laws.port import port_close, port_effort
from tests.laws.ports import PERIOD, ends

UNIT = 0.05 / PERIOD
"""b / T: joules per period and variance of the noise."""


@pytest.mark.parametrize(
    ("pole", "delay", "drain", "feigned"),
    [
        *((0.3, 0, 4.32, 1.40), (0.3, 1, 4.02, 5.46), (0.3, 2, 6.81, 5.87)),
        *((0.5, 0, 1.95, 1.06), (0.5, 1, 1.92, 2.20), (0.5, 2, 2.54, 2.43)),
        *((0.6, 0, 1.24, 0.96), (0.6, 1, 1.29, 1.35), (0.6, 2, 1.49, 1.51)),
    ],
)
def test_worst_colours(pole: float, delay: int, drain: float, feigned: float) -> None:
    end = ends(pole=pole, delay=delay)
    bounds = noise_bounds(end.port, end.observer, delay)
    assert bounds.drain / UNIT == pytest.approx(drain, abs=0.006)
    assert bounds.feigned / UNIT == pytest.approx(feigned, abs=0.006)


@pytest.mark.parametrize("delay", [0, 1, 2])
@pytest.mark.parametrize("theta", [0.1, 0.8, 1.7, 2.9])
def test_responses_are_those_of_the_law(theta: float, delay: int) -> None:
    """A sine of noise on a lever at rest, a far end that sends back half of what left."""
    end = ends(delay=delay)
    port = end.port._replace(reserve=1e9)  # rich: linear
    slots = 3000
    noise = np.cos(theta * np.arange(slots))
    at = velocity = outside = filtered = leaving = 0.0
    account, last = 1e6, 0.0
    efforts, waves = [0.0] * (delay + 1), [0.0] * (delay + 1)
    seen = np.zeros((slots, 3))
    for k, sample in enumerate(noise):
        effort, wave = efforts[0], waves[0]
        ahead, velocity, outside = observe(end.observer, at, velocity, outside, sample, effort, 1.0)
        energy = 0.5 * PERIOD * wave * wave
        leaving, account, _, filtered, _, _, _ = port_close(
            port, account, 0.0, filtered, sample - last, ahead - at, 1.0, effort, wave, energy,
            False,
        )  # fmt: skip
        at, last = ahead, sample
        came = 0.5 * leaving
        sent = port_effort(port, account, velocity, outside, sum(efforts[1:]), came)
        efforts, waves = [*efforts[1:], sent], [*waves[1:], came]
        seen[k] = efforts[0], came, leaving
    carrier = np.exp(-1j * theta * np.arange(slots))[-2000:]
    basis = np.stack([carrier.real, -carrier.imag], axis=1)
    fitted = np.linalg.lstsq(basis, seen[-2000:], rcond=None)[0]
    wanted = noise_responses(port, end.observer, delay, np.array([theta]), np.array([0.5 + 0.0j]))
    for column, answer in enumerate(wanted):
        real, imaginary = fitted[:, column]
        assert real == pytest.approx(answer[0].real, rel=1e-6, abs=1e-9)
        assert -imaginary == pytest.approx(answer[0].imag, rel=1e-6, abs=1e-9)


def test_a_declared_colour_costs_less_than_an_unknown_one() -> None:
    end = ends(delay=1)
    unknown = noise_power(end.port, end.observer, 1, 9e-5, 0.0)
    white = noise_power(end.port, end.observer, 1, 9e-5, 0.0, autocorrelation=())
    worst = noise_power(end.port, end.observer, 1, 9e-5, 0.0, autocorrelation=(0.5,))
    assert white.lost < 0.35 * unknown.lost
    assert white.lost < worst.lost < unknown.lost
    assert noise_power(end.port, end.observer, 1, 0.0, 0.0) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("lags", "drains"),
    [((), (1.41, 0.64, 0.64)), ((0.5,), (0.76, 0.96, 0.50)), ((-0.4,), (1.93, 0.38, 0.75))],
)
def test_declared_colours(lags: tuple[float, ...], drains: tuple[float, ...]) -> None:
    """The table of the page on the port."""
    for delay, drain in enumerate(drains):
        end = ends(pole=0.5, delay=delay)
        bounds = noise_bounds(end.port, end.observer, delay, lags)
        assert bounds.drain / UNIT == pytest.approx(drain, abs=0.005)


@pytest.mark.parametrize(("pole", "delay"), [(0.3, 0), (0.3, 1), (0.5, 0), (0.5, 1), (0.5, 2)])
@pytest.mark.parametrize("centre", [0.3, 0.8, 1.5, 2.0, 2.6, 3.0])
def test_sixteen_tapered_lags_of_a_narrow_band_cover_what_the_band_itself_drains(
    centre: float, delay: int, pole: float
) -> None:
    """The margin pays for the taper, and what it does not cost a wave never exceeds the worst."""
    end = ends(pole=pole, delay=delay)
    lags = np.arange(1, 17)
    tapered = 0.98**lags * np.cos(centre * lags) * (1.0 - lags / 17.0)
    declared = noise_bounds(end.port, end.observer, delay, tuple(tapered.tolist()))
    theta = math.pi * (np.arange(4000) + 0.5) / 4000
    lost, _ = worst_changes(end.port, end.observer, delay, theta)
    density = 1.0 / np.abs(1.0 - 2 * 0.98 * math.cos(centre) * (z := np.exp(-1j * theta))
                           + 0.98**2 * z * z) ** 2  # fmt: skip
    drain = float(np.sum(density * lost) / np.sum(density))
    assert drain <= declared.drain <= noise_bounds(end.port, end.observer, delay).drain


@pytest.mark.parametrize(
    ("pole", "drains"), [(0.5, (0.25, 0.12, 0.12)), (0.3, (0.5, 0.25, 0.2)), (0.2, (math.inf,) * 3)]
)
def test_a_step_takes_what_was_found_and_never_more_than_is_sure(
    pole: float, drains: tuple[float, ...]
) -> None:
    step = 1e-3
    for delay, drain in enumerate(drains):
        end = ends(pole=pole, delay=delay)
        sure = noise_bounds(end.port, end.observer, delay).drain * 0.25 * step**2 / PERIOD
        lost = noise_power(end.port, end.observer, delay, 0.0, step).lost
        assert lost == pytest.approx(min(drain * 0.05 * step**2 / PERIOD**2, sure))


def test_white_noise_drifts_as_the_effort_s_answer_to_the_newest_sample_says() -> None:
    """-g_0 per variance without command delay, and nothing with one."""
    theta = math.pi * (np.arange(400) + 0.5) / 400
    none = np.zeros(400, dtype=complex)
    for delay, wanted in ((0, -0.618), (1, 0.0), (2, 0.0)):
        end = ends(delay=delay)
        _, seen = tank_changes(end.port, end.observer, delay, theta, none)
        assert np.mean(seen) / UNIT == pytest.approx(wanted, abs=5e-4)
