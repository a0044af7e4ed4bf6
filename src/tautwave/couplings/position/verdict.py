"""When a position coupling is passive, and by how much it is not.

Without delay a spring K and a damper D between two devices act on their relative motion. Each
device with at least the damping d, and anything passive beside it, has a sampled mobility in the
disc |Y - 1/(2 d)| <= 1/(2 d). The sum of two such mobilities lies in the disc of
d_m d_s / (d_m + d_s): the coupling is a virtual wall on a device of that damping. With the hold
alone it needs K T / 2 + D <= d_m d_s / (d_m + d_s); a command delay that both sides have counts as
that of a wall.

Source: Colgate & Schenkel 1997 (the wall); two devices in place of one are derived here.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from tautwave.analysis.walls.passivity import wall_leak
from tautwave.analysis.walls.sampled import SampledWall
from tautwave.certificate.belief import SIDES, assumed, broken_damping, delay_in_periods
from tautwave.certificate.data import CouplingVerdict, Element, Verdict
from tautwave.config import Rig, local_wall
from tautwave.couplings.position.from_keys import coupler_constants
from tautwave.couplings.position.keys import PositionPair
from tautwave.couplings.position.steps import PositionEndParams
from tautwave.types import CommandDelay


def port_constants(rig: Rig, axis_name: str) -> PositionEndParams:
    """Return spring and damper as one device feels them."""
    side, name = axis_name.split(".")
    keys = rig.coupling.pairs[name]
    assert isinstance(keys, PositionPair)
    return coupler_constants(keys, side)


def damping_between(first: float, second: float) -> float:
    """Return the damping of the relative motion of two damped devices: d_m d_s / (d_m + d_s)."""
    both = first + second
    return first * second / both if both > 0.0 else 0.0


def _coupler(rig: Rig, pair: str, delays: Mapping[str, CommandDelay]) -> Iterator[Element]:
    """Yield the position coupling."""
    late = [delay_in_periods(rig, delays[f"{side}.{pair}"]) for side in SIDES]
    filters = [rig.axes[f"{side}.{pair}"].velocity_filter_s for side in SIDES]
    if rig.delay_samples == 0 and late[0] == late[1] and not any(filters):
        yield _at_once(rig, pair, late[0])
    else:
        yield _delayed(rig, pair, delays)


def _at_once(rig: Rig, pair: str, late: float) -> Element:
    """Return the verdict on a coupling without delay: a wall on the relative motion."""
    names = [f"{side}.{pair}" for side in SIDES]
    master = port_constants(rig, names[0])
    wall = SampledWall(master.stiffness, master.damping, rig.period_s, late)
    needed = wall_leak(wall).damping
    # the slave's damping as the master would feel it
    leverage = port_constants(rig, names[1]).stiffness / master.stiffness
    present = [rig.axes[name].damping.lower - _of_wall(rig, name, late) for name in names]
    present = [max(0.0, present[0]), max(0.0, present[1] / leverage)]
    between = damping_between(present[0], present[1])
    unit = "N m s/rad" if rig.master.axes[pair].kind == "rotary" else "N s/m"
    numbers = {
        "stiffness": [master.stiffness, master.stiffness * leverage],
        "needed_damping": needed,
        "damping": present,
        "damping_between": between,
    }
    head = f"position coupling of {pair}"
    have = (
        f"it needs {needed:.4g} {unit} between the devices, which have d_m d_s / (d_m + d_s) = "
        f"{between:.4g}"
    )
    broken = [text for name in names if (text := broken_damping(rig, name)) is not None]
    margin = between - needed
    if broken:
        result = Verdict(False, f"{head}: {broken[0]}", margin=margin)
    elif margin < 0.0:
        result = Verdict(
            False,
            f"{head}: not passive; {have}. Use law wave, or require coupled_stable",
            margin=margin,
        )
    else:
        conditions = [
            text for name in names for text in assumed(rig.axes[name], name, damping=True)
        ]
        conditions += [
            f"the effort_rate_limit of {name} is not reached in the coupling"
            for name in names
            if rig.axes[name].effort_rate_limit is not None
        ]
        result = Verdict(True, f"{head}: passive for any hand and environment; {have}.",
                       tuple(conditions), margin)  # fmt: skip
    steps = any(rig.axes[name].encoder_quantum for name in names)
    quantised = result
    if result.passed and steps:
        quantised = Verdict(
            False, f"{head}: nothing is proved of its limit cycles on encoder steps."
        )
    return Element(
        f"coupling of {pair}", "coupling", pair, result, quantised, numbers, (result.reason,)
    )


def _of_wall(rig: Rig, axis_name: str, late: float) -> float:
    """Return the damping that the local wall of an axis takes."""
    wall = local_wall(rig, axis_name)
    if wall is None:
        return 0.0
    return wall_leak(SampledWall(wall.stiffness, wall.damping, rig.period_s, late)).damping


def _delayed(rig: Rig, pair: str, delays: Mapping[str, CommandDelay]) -> Element:
    """Return the verdict on a coupling with delay: not passive, and what damping would do it.

    4 d_m d_s > (T_m + T_s)^2 K_m K_s (Nuno et al. 2009) in continuous time, the delays from a
    motion at one end until its effort at the other, half a period of hold included.
    """
    stiffness = [port_constants(rig, f"{side}.{pair}").stiffness for side in SIDES]
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
    result = Verdict(False, reason)
    return Element(
        f"coupling of {pair}", "coupling", pair, result, result, numbers, (f"{reason}.",)
    )


def _ratio(value: float, limit: float) -> float:
    return value / limit if limit > 0.0 else math.inf


def _remedy(rig: Rig, pair: str) -> str:
    return "Lower the stiffness or the delay, raise the damping, or use law wave."


verdict = CouplingVerdict(
    _coupler,
    remedy=_remedy,
    picture="a position coupling: passive without delay and where it is soft",
)
