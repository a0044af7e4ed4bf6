"""The share of motion that no hand makes by will: closed forms, and where it is said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tautwave.cli.terminal.summary import summary_sections
from tautwave.report.calm import high_frequency_share
from tautwave.report.fast_motion import fast_share
from tautwave.summary import Summary
from tautwave.summary.model import Pair, Side
from tautwave.tables import BAD, Cell

TIME = np.arange(4000) * 1e-3
SLOW = np.sin(2.0 * np.pi * 2.0 * TIME)


def test_the_share_is_that_of_velocity_power() -> None:
    """A tenth of the way at ten times the frequency: half of the power."""
    buzz = 0.1 * np.sin(2.0 * np.pi * 20.0 * TIME)
    assert fast_share(SLOW, 1e-3) < 0.01
    assert fast_share(SLOW + buzz, 1e-3) == pytest.approx(0.5, abs=0.01)
    assert fast_share(SLOW[:100], 1e-3) == 0.0
    assert fast_share(np.zeros(4000), 1e-3) == 0.0


@pytest.mark.parametrize("drift", [0.0, 3.0])
@pytest.mark.parametrize("error", [0.0, 1e-3])
def test_the_share_of_lines_is_exact(drift: float, error: float) -> None:
    """A difference of a sine of f Hz is one of 2 sin(pi f T) times its amplitude; 1 s of them."""
    time, period = np.arange(1001) * 1e-3, 1e-3
    lines = {2.0: 1.0, 8.0: 0.4, 9.0: 0.3, 20.0: 0.2, 100.0: 0.1, 101.0: 5.0}
    position = 0.7 + drift * time
    for hertz, amplitude in lines.items():
        position += amplitude * np.sin(2.0 * np.pi * hertz * time + hertz)
    power = {f: 0.5 * (2.0 * a * np.sin(np.pi * f * period)) ** 2 for f, a in lines.items()}
    slow = power[2.0] + power[8.0]
    noise = 8.0 * np.pi**2 * error**2 * period**3 * (100.0**3 - 8.0**3) / 3.0
    fast = power[9.0] + power[20.0] + power[100.0] - noise
    assert noise < 0.1 * fast
    assert fast_share(position, period, error) == pytest.approx(fast / (slow + fast), rel=1e-9)


def test_below_200_hz_noise_ends_at_half_the_rate() -> None:
    """At 50 Hz: up to 25 Hz."""
    time, error = np.arange(101) * 0.02, 1e-2
    position = np.sin(2.0 * np.pi * 2.0 * time) + 0.2 * np.sin(2.0 * np.pi * 10.0 * time)
    slow = 0.5 * (2.0 * np.sin(0.04 * np.pi)) ** 2
    noise = 8.0 * np.pi**2 * error**2 * 0.02**3 * (25.0**3 - 8.0**3) / 3.0
    fast = 0.5 * (0.4 * np.sin(0.2 * np.pi)) ** 2 - noise
    assert fast_share(position, 0.02, error) == pytest.approx(fast / (slow + fast), rel=1e-9)
    assert fast_share(position, 0.02, 1.0) == 0.0


def test_a_motion_shorter_than_two_swings_has_no_share() -> None:
    """At 8 Hz: 250 ms."""
    buzz = np.sin(2.0 * np.pi * 40.0 * TIME)
    assert fast_share(buzz[:249], 1e-3) == 0.0
    assert fast_share(buzz[:250], 1e-3) > 0.9


def test_what_noise_makes_of_fast_motion_does_not_count() -> None:
    noise = np.random.default_rng(1).normal(0.0, 1e-3, len(TIME))
    still = fast_share(noise, 1e-3)
    assert still > 0.9
    assert fast_share(SLOW * 1e-2 + noise, 1e-3, 1e-3) < 0.5 * fast_share(SLOW * 1e-2 + noise, 1e-3)


def test_a_pair_that_buzzes_is_said_to_and_marked() -> None:
    shares: dict[Side, float | None] = {"master": 0.1, "slave": 0.25}
    assert "25 % of the slave's" in high_frequency_share(shares, "lever")
    assert high_frequency_share({"master": 0.2, "slave": 0.1}, "lever") == ""
    assert high_frequency_share({}, "lever") == ""
    for share, marked in ((0.25, True), (0.15, False)):
        summary = Summary(pairs={"lever": Pair(fast_share={"master": share})}, cycles=10)
        sections = summary_sections("rig", summary, Path(), 0)
        [tracking] = [it for it in sections if it.title == "Tracking"]
        cell = next(iter(tracking.rows))[-1]
        assert (isinstance(cell, Cell) and cell.level == BAD) is marked
