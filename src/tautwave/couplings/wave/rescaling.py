"""Another scale for a wave end that runs: its tank by `laws.port.port_rescale`, books and pipe.

Waves on the line stay what they are, in the pair's units; those that have reached the device, and
whose commands have still to act, are the same waves in its new units. Efforts under way are the
device's own, and are booked as they act: the tank pays for what they are worth by then.
"""

from __future__ import annotations

import math
from collections.abc import MutableSequence

from tautwave.controller.records import PIPE, TAG, AxisParams, AxisState
from tautwave.controller.steps import Rescaling
from tautwave.couplings.wave.records import WaveEndParams
from tautwave.laws.port import port_rescale

FUNDED = 0.05
"""Share of the new reserve without which an end rather lets go, and begins with all of it."""


def hindrance(s: AxisState, p: AxisParams, new: WaveEndParams, ratio: float) -> str:
    """Say why an end cannot take another scale now, '' if it can."""
    if not p.impedance:
        return "it takes velocities"
    kept, _, _, _ = port_rescale(s.end.account, 0.0, 0.0, ratio)
    if not kept >= FUNDED * new.port.reserve:
        return "its tank is too empty"
    return ""


def keep(old: WaveEndParams, new: WaveEndParams) -> WaveEndParams:
    """Return constants of another scale with the filter as it is tuned now."""
    port = new.port._replace(filter_gain=old.port.filter_gain, kept=old.port.kept)
    return new._replace(port=port)


def carry(s: AxisState, p: AxisParams, ratio: float, table: MutableSequence[float]) -> None:
    """Change an end's state; a second that was watched counts anew."""
    e = s.end
    root = math.sqrt(ratio)
    e.account, e.gap, e.filtered, lost = port_rescale(e.account, e.gap, e.filtered, ratio)
    e.reserve *= ratio
    e.port_absorbed *= ratio
    e.damper_dissipated *= ratio
    e.leaked *= ratio
    e.spilled = ratio * e.spilled + lost
    e.wave_sum *= root
    e.wave_energy *= ratio
    e.wave_in *= root
    s.tag *= root
    for at in range(p.pipe, p.pipe + PIPE * p.delay, PIPE):
        table[at + TAG] *= root
    e.wanted_sum = e.cut_sum = e.gap_sum = e.gap_before = 0.0
    e.watch_left = e.owing = 0
    e.cut_before = False


rescaling = Rescaling(hindrance, keep, carry)
