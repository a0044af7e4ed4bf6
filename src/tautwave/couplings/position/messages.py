"""What `check` and the report say of law position; figures are SI of the master."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from tautwave.config import Rig
from tautwave.couplings.position.standing import standing
from tautwave.wording import CouplingMessages


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
