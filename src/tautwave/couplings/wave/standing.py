"""What an observed pair does while both devices are held still; SI, master units of the pair."""

from __future__ import annotations

from collections.abc import Mapping

from tautwave.config import Rig
from tautwave.couplings.wave.keys import WavePair
from tautwave.types import CommandDelay
from tautwave.wording import Standing


def line_time(rig: Rig, name: str, pair: WavePair, tau: float) -> float:
    """Return the delay tau [s] of a line with the lag of both ports' filters."""
    for side in ("master", "slave"):
        period = rig.axis_period_s(f"{side}.{name}")
        gain = pair.filter_step(period)
        tau += 0.5 * period * (1.0 - gain) / gain
    return tau


def standing(rig: Rig, name: str, delays: Mapping[str, CommandDelay], tau: float) -> Standing:
    """Return the standing offset: tau / b of the line, with the lag of both ports' filters.

    The observer is not biased by a held effort, so the devices get all of the line's effort.
    """
    pair = rig.coupling.pairs[name]
    assert isinstance(pair, WavePair)
    offset = line_time(rig, name, pair, tau) / pair.impedance
    return Standing(offset, 1.0, "a port gives all of the line's effort")
