"""Where an encoder is too coarse or too noisy for its port, as `check` says it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from tautwave.config import Rig
from tautwave.couplings.wave.claim import Claim, claim_of
from tautwave.couplings.wave.from_keys import observer_of, port_impedance
from tautwave.couplings.wave.keys import WavePair
from tautwave.types import CommandDelay

GREATEST_STEP = 0.1
"""Of the effort limit: a held force chatters by about as much as one step changes the effort."""

GREATEST_LEAK = 0.01
"""Of effort limit times velocity limit."""


def effort_per_error(pair: WavePair, side: str, period: float, mass: float, delay: float) -> float:
    """Return what an error of one sample makes of the effort [N m/rad or N/m]."""
    seen = observer_of(pair, side, period, mass)
    velocity = seen.velocity + (delay + 0.5) * period * seen.disturbance
    return port_impedance(pair, side) * velocity


def noise_hints(rig: Rig, delays: Mapping[str, CommandDelay]) -> Iterator[tuple[str, str]]:
    """Yield a hint for each axis whose step is felt, or whose noise costs much of its claim."""
    for axis_name, axis in rig.axes.items():
        side, name = axis_name.split(".")
        keys = rig.coupling.pairs[name]
        claim = claim_of(rig, axis_name, delays)
        assert isinstance(keys, WavePair)
        if axis.inertia is None or not isinstance(claim, Claim):
            continue
        late = delays[axis_name].periods + delays[axis_name].remainder_s / claim.period
        gain = effort_per_error(keys, side, claim.period, axis.inertia.lower, late)
        share = gain * axis.encoder_quantum / axis.effort_limit
        if share > GREATEST_STEP:
            softer = keys.wave_impedance * GREATEST_STEP / share
            yield (
                f"hint on {axis_name}",
                f"one encoder step changes the effort by {share:.0%} of effort_limit, and a held "
                f"force chatters by about as much; wave_impedance up to {softer:.2g} keeps it "
                f"below {GREATEST_STEP:.0%}",
            )
        if claim.leak > GREATEST_LEAK * claim.effort * claim.velocity:
            colour = ""
            loud = axis.position_noise > 0.5 * axis.encoder_quantum
            if loud and axis.position_noise_autocorrelation is None:
                colour = ", or declare the noise's colour, which identify --noise measures"
            yield (
                f"hint on {axis_name}",
                f"step and noise of its encoder take {1e3 * claim.leak:.3g} mW from the port, "
                f"{claim.leak / (claim.effort * claim.velocity):.1%} of what the motor can give, "
                f"and its claim grows by that; lower wave_impedance{colour}",
            )
