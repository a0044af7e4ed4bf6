"""The share of motion that no hand makes by will: closed forms, and where it is said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tautwave.cli.terminal.show import BAD, Cell
from tautwave.cli.terminal.summary import summary_sections
from tautwave.report.calm import unrest
from tautwave.report.fast_motion import fast_share

TIME = np.arange(4000) * 1e-3
SLOW = np.sin(2.0 * np.pi * 2.0 * TIME)


def test_the_share_is_that_of_velocity_power() -> None:
    """A tenth of the way at ten times the frequency: half of the power."""
    buzz = 0.1 * np.sin(2.0 * np.pi * 20.0 * TIME)
    assert fast_share(SLOW, 1e-3) < 0.01
    assert fast_share(SLOW + buzz, 1e-3) == pytest.approx(0.5, abs=0.01)
    assert fast_share(SLOW[:100], 1e-3) == 0.0
    assert fast_share(np.zeros(4000), 1e-3) == 0.0


def test_what_noise_makes_of_fast_motion_does_not_count() -> None:
    noise = np.random.default_rng(1).normal(0.0, 1e-3, len(TIME))
    still = fast_share(noise, 1e-3)
    assert still > 0.9
    assert fast_share(SLOW * 1e-2 + noise, 1e-3, 1e-3) < 0.5 * fast_share(SLOW * 1e-2 + noise, 1e-3)


def test_a_pair_that_buzzes_is_said_to_and_marked() -> None:
    shares = {"master": 0.1, "slave": 0.25}
    assert "25 % of the slave's" in unrest(shares, "lever")
    assert unrest({"master": 0.2, "slave": 0.1}, "lever") == ""
    assert unrest({}, "lever") == ""
    for share, marked in ((0.25, True), (0.15, False)):
        summary = {"pairs": {"lever": {"fast_share": {"master": share}}}, "cycles": 10}
        sections = summary_sections("rig", summary, Path(), 0)
        [tracking] = [it for it in sections if it.title == "Tracking"]
        cell = next(iter(tracking.rows))[-1]
        assert (isinstance(cell, Cell) and cell.style == BAD) is marked
