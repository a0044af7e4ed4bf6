"""Values of a mediated pair that a rig leaves to the law: from the devices and the rate."""

from __future__ import annotations

import math

from tautwave.config import Rig
from tautwave.config.keys.common import AUTO
from tautwave.couplings.mediated.keys import MediatedPair
from tautwave.types import Choice

FASTEST = 100.0
"""[rad/s] 16 Hz: beyond what a hand moves by will."""

PER_RATE = 2.0 * math.pi / 100.0
DAMPED = 0.7
SLOWEST_PERIODS = 7.0
TOUCH = 0.02


def resolve(rig: Rig) -> dict[str, Choice]:
    """Return what each `auto` of a rig is, by its path in the coupling."""
    choices: dict[str, Choice] = {}
    for name, pair in rig.coupling.pairs.items():
        assert isinstance(pair, MediatedPair)
        for key, choice in _chosen(rig, name, pair).items():
            if getattr(pair, key) == AUTO:
                choices[f"pairs.{name}.{key}"] = choice
    return choices


def _chosen(rig: Rig, name: str, pair: MediatedPair) -> dict[str, Choice]:
    master, slave = rig.master.axes[name], rig.slave.axes[name]
    assert master.inertia is not None
    assert slave.inertia is not None
    mass = slave.inertia.value / pair.in_device_units("slave", 1.0)
    bounds = {"16 Hz": FASTEST, "a hundredth of the rate": PER_RATE * rig.rate_hz}
    which = min(bounds, key=lambda it: bounds[it])
    stiffness = pair.stiffness
    if isinstance(stiffness, str):
        stiffness = float(f"{mass * bounds[which] ** 2:.4g}")
    damping = 2.0 * DAMPED * math.sqrt(stiffness * mass)
    touch = TOUCH * slave.effort_limit + slave.coulomb.value
    stiffest = master.inertia.lower / (SLOWEST_PERIODS * rig.period_s) ** 2
    return {
        "stiffness": Choice(stiffness, f"the slave oscillates at {which} with {mass:.3g}"),
        "damping": Choice(float(f"{damping:.4g}"), "0.7 of critical"),
        "touch": Choice(
            float(f"{touch:.4g}"), "2 % of the slave's effort limit and its Coulomb friction"
        ),
        "stiffest": Choice(float(f"{stiffest:.4g}"), "the master on it has a period of 44 samples"),
    }
