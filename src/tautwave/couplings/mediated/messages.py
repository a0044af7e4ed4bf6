"""What `check` and the report say of law mediated; figures are SI of the master."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from tautwave.config import Rig
from tautwave.config.keys.coupling import chosen
from tautwave.types import CommandDelay
from tautwave.wording import CouplingMessages, Standing


def _coupling(rig: Any) -> str:
    return f"model-mediated, {rig.coupling.delay_s:g} s each way"


def _standing(rig: Rig, name: str, delays: Mapping[str, CommandDelay], tau: float) -> Standing:
    """Return the standing offset where the slave does not press by itself, 1 / K."""
    pair: Any = rig.coupling.pairs[name]
    stiffness = chosen(pair, "stiffness")
    if pair.force_gain > 0.0 or stiffness == 0.0:
        return Standing()
    return Standing(1.0 / stiffness, 1.0, f"K = {stiffness:.4g}")


def _pair(
    settings: Mapping[str, Any], effort: str, position: str, number: Callable[[Any], str]
) -> str:
    if settings.get("stiffness") is None:
        return ""
    return (
        f"the slave follows with K = {number(settings.get('stiffness'))} {effort}/{position}, the "
        f"master renders up to {number(settings.get('stiffest'))} {effort}/{position}"
    )


messages = CouplingMessages(
    coupling=_coupling,
    standing=_standing,
    pair=_pair,
    offset_caption="Dotted in the error: stretch of the slave's spring under the effort F.",
    offset_cause="its spring",
)
