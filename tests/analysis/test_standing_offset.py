"""Offset of a held force: no passive line has less than tau**2 over the inertia that it adds.

The argument is in docs/explanation/standing-offset.md.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from tautwave.certificate.belief import declared_delays
from tautwave.certificate.haptics.transparency import Felt, pair_felt
from tautwave.config import load_rig

CONFIGS = Path(__file__).parents[2] / "configs"
BENCH = "bench-1dof-2khz"
PERIOD = 1e-3
IMPEDANCE, DELAY_S, LOAD, DAMPING = 0.05, 0.02, 0.05, 0.017


def felt(name: str, *changes: str) -> tuple[Felt, float]:
    """What a pair feels like at low frequencies, and the inertia of its devices."""
    rig = load_rig(CONFIGS / f"{name}.yaml", changes)
    found = pair_felt(rig, "lever", declared_delays(rig))
    assert isinstance(found, Felt)
    devices = 0.0
    for axis in rig.axes.values():
        assert axis.inertia is not None
        devices += axis.inertia.value
    return found, devices


@pytest.mark.parametrize("delay", [0.005, 0.02])
def test_a_line_of_waves_adds_as_little_weight_as_its_offset_allows(delay: float) -> None:
    found, devices = felt(BENCH, f"coupling.delay_s={delay}")
    product = (found.mass - devices) / found.stiffness
    assert 0.97 * delay**2 < product < 1.3 * (delay + 1e-3) ** 2


def test_a_law_of_positions_with_less_offset_drags_and_is_not_passive() -> None:
    keys = "{stiffness: 20, damping: 0.07}"
    for delay in (0.02, 0.05):
        found, devices = felt(
            BENCH, f"coupling={{law: position, delay_s: {delay}, pairs: {{lever: {keys}}}}}"
        )
        assert (found.mass - devices) / found.stiffness < 0.5 * delay**2
        assert found.damping == pytest.approx(2.0 * 20.0 * delay, rel=0.06)
        assert not found.stable


def swing(lag: float | None, seconds: float) -> list[float]:
    """Energy of a load behind a clamped line of waves [J], at the end of each second.

    Waves in samples; `lag`: the follower goes on by tau / b times the force that it feels, through
    two of these lags. The load is integrated exactly over each sample, the force held.
    """
    places = round(DELAY_S / PERIOD)
    there, back = [0.0] * places, [0.0] * places
    root = math.sqrt(2.0 * IMPEDANCE)
    velocity, once, twice, energies = 1.0, 0.0, 0.0, []
    gain = 0.0 if lag is None else DELAY_S / (IMPEDANCE * lag)
    share = 0.0 if lag is None else PERIOD / lag
    keep = math.exp(-DAMPING * PERIOD / LOAD)
    for k in range(round(seconds / PERIOD)):
        arriving = there.pop(0)
        moved = velocity + gain * (once - twice)
        force = IMPEDANCE * moved - root * arriving
        once += share * (force - once)
        twice += share * (once - twice)
        back.append(root * moved - arriving)
        there.append(-back.pop(0))  # a clamped master returns every wave
        velocity = keep * velocity - (1.0 - keep) * force / DAMPING
        if (k + 1) % round(1.0 / PERIOD) == 0:
            energies.append(0.5 * LOAD * velocity**2 + 0.5 * (DELAY_S / IMPEDANCE) * force**2)
    return energies


def test_an_integral_of_the_gap_at_the_follower_swings_a_load() -> None:
    bare, led_back = swing(None, 6.0), swing(0.15, 6.0)
    assert np.all(np.diff(bare) < 0.0)
    # An energy grows twice as fast as the root, 1.22 per second.
    growth = np.log(led_back[-1] / led_back[1]) / 4.0
    assert growth == pytest.approx(2.0 * 1.22, rel=0.08)
