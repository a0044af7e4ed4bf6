"""When a position coupling is passive, and by how much it is not.

Without delay a spring K and a damper D between two devices act on their relative motion. Each
device with at least the damping d, and anything passive beside it, has a sampled mobility in the
disc |Y - 1/(2 d)| <= 1/(2 d). The sum of two such mobilities lies in the disc of
d_m d_s / (d_m + d_s): the coupling is a virtual wall on a device of that damping. With the hold
alone it needs K T / 2 + D <= d_m d_s / (d_m + d_s); a command delay that both sides have counts as
that of a wall. A delay between the sides and filters are asked of the law itself: see
`tautwave.certificate.tuning.two_port`.

Source: Colgate & Schenkel 1997 (the wall); two devices in place of one are derived here.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from tautwave.analysis.walls.passivity import wall_leak
from tautwave.analysis.walls.sampled import SampledWall
from tautwave.certificate.belief import SIDES, assumed, broken_damping, delay_in_periods
from tautwave.certificate.data import CouplingVerdict, Element, Verdict
from tautwave.certificate.tuning.limits import unlike_ends
from tautwave.certificate.tuning.verdict import tuned_element
from tautwave.config import Rig
from tautwave.couplings.position.from_keys import coupler_constants
from tautwave.couplings.position.keys import PositionPair
from tautwave.couplings.position.steps import PositionEndParams
from tautwave.rig import axis_allowance
from tautwave.types import CommandDelay

REMEDY = (
    "Lower its stiffness or the delay, give it an account (coupling.account: {}), or use law wave."
)


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
    at_once = rig.link is None and rig.delay_samples == 0
    if at_once and late[0] == late[1] and not any(filters):
        yield _at_once(rig, pair, delays, late[0])
    else:
        yield tuned_element(rig, pair, delays, REMEDY)


def _at_once(rig: Rig, pair: str, delays: Mapping[str, CommandDelay], late: float) -> Element:
    """Return the verdict on a coupling without delay: a wall on the relative motion."""
    names = [f"{side}.{pair}" for side in SIDES]
    master = port_constants(rig, names[0])
    wall = SampledWall(master.stiffness, master.damping, rig.period_s, late)
    needed = wall_leak(wall).damping
    # the slave's damping as the master would feel it
    leverage = port_constants(rig, names[1]).stiffness / master.stiffness
    present = [axis_allowance(rig, name, delays[name]).coupling_damping for name in names]
    present[1] /= leverage
    between = damping_between(present[0], present[1])
    unit = "N m s/rad" if rig.master.axes[pair].kind == "rotary" else "N s/m"
    numbers: dict[str, object] = {
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
    broken = [f"{name}, {why}" for name in names if (why := broken_damping(rig, name)) is not None]
    margin = between - needed
    if broken:
        result = Verdict(False, f"{head}: {broken[0]}", margin=margin)
    elif margin < 0.0:
        result = Verdict(
            False,
            f"{head}: not passive; {have}. {REMEDY}",
            margin=margin,
        )
    elif (unlike := unlike_ends(rig, pair)) is not None:
        result = Verdict(False, f"{head}: not passive: {unlike}.", margin=margin)
    else:
        conditions = [
            text for name in names for text in assumed(rig.axes[name], name, damping=True)
        ]
        conditions += [
            f"the effort_rate_limit of {name} is not reached in the coupling"
            for name in names
            if rig.axes[name].effort_rate_limit is not None
        ]
        numbers["holds"] = "by tuning"
        result = Verdict(True, f"{head}: passive by tuning for any hand and environment; {have}.",
                       tuple(conditions), margin)  # fmt: skip
    steps = any(rig.axes[name].encoder_quantum for name in names)
    quantised = result
    if result.passed and steps:
        quantised = Verdict(
            False, f"{head}: no proof covers its limit cycles caused by encoder steps."
        )
    return Element(
        f"coupling of {pair}", "coupling", pair, result, quantised, numbers, (result.reason,)
    )


def _remedy(rig: Rig, pair: str) -> str:
    return "Lower the stiffness or the delay, raise the damping, or use law wave."


verdict = CouplingVerdict(
    _coupler,
    remedy=_remedy,
    picture="a position coupling: passive without delay and where it is soft",
)
