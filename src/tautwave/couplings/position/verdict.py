"""What is known of a position coupling: not passive, and by how much."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from tautwave.certificate.belief import SIDES, delay_in_periods
from tautwave.certificate.data import CouplingVerdict, Element, Verdict
from tautwave.config import Rig
from tautwave.couplings.position.from_keys import coupler_constants
from tautwave.couplings.position.keys import PositionPair
from tautwave.types import CommandDelay


def _coupler(rig: Rig, pair: str, delays: Mapping[str, CommandDelay]) -> Iterator[Element]:
    """Yield the position coupling: never passive here, and what damping would do it.

    4 d_m d_s > (T_m + T_s)^2 K_m K_s (Nuno et al. 2009) in continuous time, the delays from a
    motion at one end until its effort at the other, half a period of hold included.
    """
    keys = rig.coupling.pairs[pair]
    assert isinstance(keys, PositionPair)
    stiffness = [coupler_constants(keys, side).stiffness for side in SIDES]
    there = [
        rig.coupling.delay_s
        + rig.period_s * (0.5 + delay_in_periods(rig, delays[f"{side}.{pair}"]))
        for side in SIDES
    ]
    both = sum(there)
    needed = [0.5 * both * value for value in stiffness]
    present = [rig.axes[f"{side}.{pair}"].damping.lower for side in SIDES]
    unit = "N m s/rad" if rig.master.axes[pair].kind == "rotary" else "N s/m"
    other = "N m s/rad" if rig.slave.axes[pair].kind == "rotary" else "N s/m"
    reason = (
        f"position coupling of {pair}: not passive with a delay of {1e3 * both:.4g} ms there and "
        f"back, half a period of hold at either end included; by 4 d_m d_s > (T_m + T_s)^2 K_m K_s "
        f"it would need {needed[0]:.4g} {unit} at the master and {needed[1]:.4g} {other} at the "
        f"slave, they have {present[0]:.4g} and {present[1]:.4g}. Use law wave, or require "
        "coupled_stable"
    )
    numbers = {
        "stiffness": stiffness,
        "delay_s": there,
        "needed_damping": needed,
        "damping": present,
        "product_ratio": _ratio(present[0] * present[1], needed[0] * needed[1]),
    }
    told = Verdict(False, reason)
    yield Element(f"coupling of {pair}", "coupling", pair, told, told, numbers, (f"{reason}.",))


def _ratio(value: float, limit: float) -> float:
    return value / limit if limit > 0.0 else math.inf


def _remedy(rig: Rig, pair: str) -> str:
    return "Lower the stiffness or the delay, raise the damping, or use law wave."


verdict = CouplingVerdict(
    _coupler, remedy=_remedy, picture="a position coupling: never certified as passive"
)
