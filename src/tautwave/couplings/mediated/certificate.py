"""What is guaranteed and said of law mediated; figures are SI of the master.

Without an account nothing is: the energy of a wrong model is unbounded.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from tautwave.certificate.data import CouplingVerdict, Element, Verdict
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


def _energy(rig: Rig, pair: str, delays: Mapping[str, CommandDelay]) -> Iterator[Element]:
    """Yield the verdict on one pair."""
    head = f"coupling of {pair}"
    verdict = Verdict(
        False,
        f"{head}: not passive; a model that stiffens while in contact generates energy, and so "
        f"does a slave that follows. Give it an account (coupling.account: {{}}).",
    )
    yield Element(head, "coupling", pair, verdict, verdict, {}, (verdict.reason,))


verdict = CouplingVerdict(_energy, picture="a rendered model: no picture")
