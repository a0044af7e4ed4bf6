"""What an observed pair does while both devices are held still; SI, master units of the pair."""

from __future__ import annotations

from collections.abc import Mapping

from tautwave.config import Rig
from tautwave.couplings.wave.keys import WavePair
from tautwave.laws.wave_filter import filter_gain
from tautwave.types import CommandDelay
from tautwave.wording import Standing


def standing(rig: Rig, name: str, delays: Mapping[str, CommandDelay], tau: float) -> Standing:
    """Return the standing offset: tau / b of the line, with the lag of both ports' filters.

    The observer is not biased by a held effort, so the devices get all of the line's effort.
    """
    pair = rig.coupling.pairs[name]
    assert isinstance(pair, WavePair)
    lag = 0.0
    for side in ("master", "slave"):
        period = rig.axis_period_s(f"{side}.{name}")
        gain = filter_gain(pair.wave_filter_hz, period)
        lag += 0.5 * period * (1.0 - gain) / gain
    return Standing((tau + lag) / pair.wave_impedance, 1.0, "a port gives all of the line's effort")
