"""What is guaranteed and said of law position: verdict by its tuning, linear end, messages."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from tautwave.analysis.ports.sampled_loop import Device, LinearEnd, Site, position_end
from tautwave.certificate.data import CouplingVerdict, Element
from tautwave.certificate.tuning.verdict import tuned_element
from tautwave.config import Rig
from tautwave.couplings.position.keys import PositionPair
from tautwave.couplings.position.law import coupler_constants
from tautwave.types import CommandDelay
from tautwave.wording import CouplingMessages, Standing


def linear_end(pair: PositionPair, side: str, device: Device, site: Site) -> LinearEnd:
    """Return the end at one side; it sends its position, weighed as the far side will."""
    ratio = float(pair.sign) * pair.position_scale
    far, back = ("slave", ratio) if side == "master" else ("master", 1.0 / ratio)
    here, there = coupler_constants(pair, side), coupler_constants(pair, far)
    return position_end(
        device,
        site,
        stiffness=here.stiffness,
        damping=here.damping,
        sent_stiffness=there.stiffness * back,
        sent_damping=there.damping * back,
    )


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


def _coupling(rig: Rig) -> str:
    text = f"positions, {rig.coupling.delay_s:g} s each way"
    return text if rig.coupling.account else f"{text} (passive by its tuning, if at all)"


def _pair(
    settings: Mapping[str, Any], effort: str, position: str, number: Callable[[Any], str]
) -> str:
    stiffness = settings.get("stiffness")
    if stiffness is None:
        return ""
    return (
        f"position coupling, K = {number(stiffness)} {effort}/{position}, "
        f"B = {number(settings.get('damping'))} {effort} s/{position}"
    )


messages = CouplingMessages(
    coupling=_coupling,
    standing=standing,
    pair=_pair,
    offset_caption="Dotted in the error: stretch of the coupling's spring K under the effort F, "
    "velocity filters included.",
    offset_cause="its spring",
)


REMEDY = (
    "Lower its stiffness or the delay, give it an account (coupling.account: {}), or use law wave."
)


def _coupler(rig: Rig, pair: str, delays: Mapping[str, CommandDelay]) -> Iterator[Element]:
    """Yield the position coupling."""
    yield tuned_element(rig, pair, delays, REMEDY)


def _remedy(rig: Rig, pair: str) -> str:
    return "Lower the stiffness or the delay, raise the damping, or use law wave."


verdict = CouplingVerdict(
    _coupler,
    remedy=_remedy,
    picture="a position coupling: passive by tuning where it is soft",
)
