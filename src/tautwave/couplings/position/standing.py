"""What a position pair does while both devices are held still; SI, master units."""

from __future__ import annotations

from collections.abc import Mapping

from tautwave.config import Rig
from tautwave.couplings.position.keys import PositionPair
from tautwave.types import CommandDelay
from tautwave.wording import Standing


def standing(rig: Rig, name: str, delays: Mapping[str, CommandDelay], tau: float) -> Standing:
    """Return the standing offset and the share of its stiffness with which the spring acts.

    The offset is 1 / K and, through the coupler's damper, the velocity that the filters' trackers
    believe of a device held still: B (t_f / m) / K.
    """
    pair = rig.coupling.pairs[name]
    assert isinstance(pair, PositionPair)
    leverage = pair.in_device_units("slave", 1.0)
    biases = rig.master.axes[name].held_bias, leverage * rig.slave.axes[name].held_bias
    offset = (1.0 + pair.damping * sum(biases)) / pair.stiffness
    share = 1.0 / (offset * pair.stiffness)
    unit = "N m/rad" if rig.master.axes[name].kind == "rotary" else "N/m"
    acts = share * pair.stiffness
    return Standing(offset, share, f"K = {pair.stiffness:.4g} {unit} acts as {acts:.4g}")
