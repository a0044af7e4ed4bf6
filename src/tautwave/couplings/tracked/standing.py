"""What a wave pair does while both devices are held still; SI, master units where of the pair."""

from __future__ import annotations

from collections.abc import Mapping

from tautwave.config import Rig
from tautwave.couplings.tracked.from_keys import port_impedance
from tautwave.couplings.tracked.keys import WavePair
from tautwave.types import CommandDelay
from tautwave.wording import Standing


def held_share(rig: Rig, axis_name: str, delay: CommandDelay) -> float:
    """Return effort given per effort of the wave when held still.

    The port's prediction takes the effort it gives itself for a motion: the effort that acts
    within a period and its command delay, and, with a velocity filter of time constant t_f, the
    velocity that the tracker goes on believing, -F t_f / m. So the share is
    1 / (1 + b (T (1 + d) + t_f) / m); m is the inertia's lower bound, d the command delay in
    periods T of the axis.
    """
    side, name = axis_name.split(".")
    axis, pair = rig.axes[axis_name], rig.coupling.pairs[name]
    assert isinstance(pair, WavePair)
    if axis.inertia is None:
        return 1.0
    impedance = port_impedance(pair, side)
    blind = rig.axis_period_s(axis_name) * (1.0 + delay.periods) + axis.velocity_filter_s
    return 1.0 / (1.0 + impedance * blind / axis.inertia.lower)


def standing(rig: Rig, name: str, delays: Mapping[str, CommandDelay], tau: float) -> Standing:
    """Return the standing offset and the smaller share of the line's effort that a device gets.

    The offset is tau / b, per effort on the line, and what the biased velocities of both trackers
    make of it: F t_f / m is repaid over `drift_time_s`. A wall that pushes adds to the bias, here
    only the coupling does.
    """
    pair = rig.coupling.pairs[name]
    assert isinstance(pair, WavePair)
    master, slave = f"master.{name}", f"slave.{name}"
    leverage = pair.in_device_units("slave", 1.0)  # of the slave's bias, in master units
    biases = rig.axes[master].held_bias, leverage * rig.axes[slave].held_bias
    shares = [held_share(rig, axis_name, delays[axis_name]) for axis_name in (master, slave)]
    line = tau / pair.wave_impedance
    tracked = sum(share * bias for share, bias in zip(shares, biases, strict=True))
    offset = (line + pair.drift_time_s * tracked) / shares[0]
    share = min(shares)
    return Standing(offset, share, f"a port gives {share:.1%} of the line's effort")
