"""What is guaranteed and said of a law of states: verdict by its tuning, if at all; messages."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from tautwave.certificate.data import CouplingVerdict, Element
from tautwave.certificate.tuning.verdict import tuned_element
from tautwave.config import Rig
from tautwave.couplings.states.keys import PositionForcePair, ServoPair
from tautwave.types import CommandDelay
from tautwave.wording import CouplingMessages, Standing


def _standing(rig: Rig, name: str, delays: Mapping[str, CommandDelay], tau: float) -> Standing:
    """Return the standing offset, 1 / K."""
    pair = rig.coupling.pairs[name]
    assert isinstance(pair, ServoPair)
    stiffness = pair.gain("stiffness")
    gain = pair.force_gain if isinstance(pair, PositionForcePair) else 1.0
    if stiffness == 0.0 or gain == 0.0:
        return Standing()
    return Standing(1.0 / (stiffness * gain), 1.0, f"K = {stiffness:.4g}")


def _pair(
    settings: Mapping[str, Any], effort: str, position: str, number: Callable[[Any], str]
) -> str:
    if settings.get("stiffness") is None:
        return ""
    return (
        f"K = {number(settings.get('stiffness'))} {effort}/{position}, "
        f"B = {number(settings.get('damping'))} {effort} s/{position}"
    )


def _messages(what: str) -> CouplingMessages:
    def coupling(rig: Any) -> str:
        return f"{what}, {rig.coupling.delay_s:g} s each way"

    return CouplingMessages(
        coupling=coupling,
        standing=_standing,
        pair=_pair,
        offset_caption="Dotted in the error: stretch of the spring K under the effort F.",
        offset_cause="its spring",
    )


position_force = _messages("position to the slave, effort back")
pd_damping = _messages("PD with damping injection")
four_channel = _messages("four channels")


REMEDY = "Give it an account (coupling.account: {}), or use law wave."


def _coupler(rig: Rig, pair: str, delays: Mapping[str, CommandDelay]) -> Iterator[Element]:
    """Yield the verdict on the law of one pair."""
    yield tuned_element(rig, pair, delays, REMEDY)


verdict = CouplingVerdict(_coupler, picture="no picture for this coupling")
