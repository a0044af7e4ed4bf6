"""Gains that a rig leaves to the laws of states: from the devices' inertia, the rate, the delay."""

from __future__ import annotations

import math

from tautwave.config import Rig
from tautwave.config.keys.common import AUTO
from tautwave.couplings.states.keys import PositionForcePair, ServoPair
from tautwave.types import Choice

FASTEST = 100.0
"""[rad/s] 16 Hz: beyond what a hand moves by will."""

PER_RATE = 2.0 * math.pi / 100.0
PER_DELAY = 1.0
BY_DELAY = "1 over the round-trip delay"
DAMPED = 0.7
MORE = 1.1


def resolve(rig: Rig) -> dict[str, Choice]:
    """Return what each `auto` of a rig is, by its path in the coupling."""
    choices: dict[str, Choice] = {}
    for name, pair in rig.coupling.pairs.items():
        assert isinstance(pair, ServoPair)
        chosen = _gains(rig, name, pair)
        for key, choice in chosen.items():
            if getattr(pair, key, None) == AUTO:
                choices[f"pairs.{name}.{key}"] = choice
    return choices


def _gains(rig: Rig, name: str, pair: ServoPair) -> dict[str, Choice]:
    scale = pair.in_device_units("slave", 1.0)
    masses = [rig.master.axes[name].inertia, rig.slave.axes[name].inertia]
    assert masses[0] is not None
    assert masses[1] is not None
    mass = min(masses[0].value, masses[1].value / scale)
    both = 2.0 * (rig.coupling.delay_s + 0.5 * rig.period_s)
    bounds = {
        "16 Hz": FASTEST,
        "a hundredth of the rate": PER_RATE * rig.rate_hz,
        BY_DELAY: PER_DELAY / both,
    }
    if isinstance(pair, PositionForcePair):
        del bounds[BY_DELAY]  # its spring closes no loop over the line
    which = min(bounds, key=lambda it: bounds[it])
    stiffness = pair.stiffness
    if stiffness == AUTO:
        stiffness = float(f"{mass * bounds[which] ** 2:.4g}")
    damping = float(f"{2.0 * DAMPED * math.sqrt(stiffness * mass):.4g}")
    needed = float(f"{MORE * 0.5 * both * stiffness:.4g}")
    return {
        "stiffness": Choice(stiffness, f"resonates at {which} with {mass:.3g}"),
        "damping": Choice(damping, "0.7 of critical"),
        "injection": Choice(needed, "round-trip delay times half the stiffness, plus 10 %"),
    }
