"""What lies between two ports: the line, filters, scaling; or a position coupling."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from tautwave.certificate.belief import SIDES, delay_in_periods
from tautwave.certificate.data import Element, Verdict
from tautwave.config import Rig
from tautwave.rig import device_impedance, pair_scale
from tautwave.types import CommandDelay


def between(rig: Rig, pair: str, delays: Mapping[str, CommandDelay]) -> Iterator[Element]:
    """Yield the elements of a pair that belong to neither axis."""
    if rig.coupling.law == "position":
        yield _coupler(rig, pair, delays)
        return
    if rig.delay_samples:
        yield _fine(
            f"line of {pair}",
            "line",
            pair,
            f"a constant delay of {rig.coupling.delay_s:g} s each way is lossless and holds the "
            "waves under way (Niemeyer and Slotine 1991); a missing wave counts as 0",
        )
    corner = rig.coupling.wave_filter_hz
    if corner is not None:
        yield _fine(
            f"wave filters of {pair}",
            "filter",
            pair,
            f"|H| <= 1 at every frequency ({corner:g} Hz)",
        )
    scale = pair_scale(rig.coupling.pairs[pair])
    if abs(scale.power - 1.0) > 1e-12:
        yield _fine(
            f"scaling of {pair}",
            "scaling",
            pair,
            f"power scaled by {scale.power:g}, the waves by its root: passive for a hand and an "
            "environment that touch each other through the rig only",
        )
    elif scale.scale != 1.0 or scale.sign < 0.0:
        yield _fine(f"scaling of {pair}", "scaling", pair, "keeps power")


def _fine(name: str, kind: str, pair: str, why: str) -> Element:
    told = Verdict(True, f"{name}: {why}.")
    return Element(name, kind, pair, told, told, {}, (told.reason,))


def _coupler(rig: Rig, pair: str, delays: Mapping[str, CommandDelay]) -> Element:
    """Return the position coupling: never passive here, and what damping would do it.

    4 d_m d_s > (T_m + T_s)^2 K_m K_s (Nuno et al. 2009) in continuous time, the delays from a
    motion at one end until its effort at the other, half a period of hold included.
    """
    keys = rig.coupling.pairs[pair]
    stiffness = [device_impedance(keys, side, keys.stiffness or 0.0) for side in SIDES]
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
    return Element(f"coupling of {pair}", "coupling", pair, told, told, numbers, (f"{reason}.",))


def _ratio(value: float, limit: float) -> float:
    return value / limit if limit > 0.0 else math.inf
