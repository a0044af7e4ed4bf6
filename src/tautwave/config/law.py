"""`coupling.law: auto`: which law a rig gets, before its keys are read."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from tautwave import registry
from tautwave.config.keys.common import AUTO
from tautwave.config.keys.coupling import STANDARD_LAW, AnyLaw, AnyPair, coupling_block
from tautwave.config.keys.rig import Rig
from tautwave.config.text.document import Document
from tautwave.types import Choice

PROMPT_S = 5e-3
"""[s] One-way delay up to which law wave follows as closely as any (`tests.lab chosen`)."""

LATE_LAW = "mediated"
"""What follows over a longer one as if there were none, in an account."""

BLOCKS: Mapping[str, dict[str, Any]] = {
    STANDARD_LAW: {"law": STANDARD_LAW},
    LATE_LAW: {"law": LATE_LAW, "account": {}},
}
"""Their keys of the whole coupling, where a rig has none of its own."""

UNCERTIFIED = "is not certified for this rig"

CERTIFY = "tautwave.certificate:certify"
"""Judges a whole rig; by name, since it imports this package."""


class ChosenLaw(NamedTuple):
    """A law in place of `auto`, and the one to take where only that is certified, if any."""

    choice: Choice
    other: Choice | None = None


def choose_law(document: Document) -> ChosenLaw | None:
    """Put a law in place of `auto` into a document; return it and why, None if one was named.

    Up to `PROMPT_S` it is law wave, whose forces are exact. A longer line makes that F tau / b off
    and b tau heavy, so it is law mediated in an account, where that law misses nothing in the rig.
    """
    coupling = document.get(("coupling",))
    named = coupling.get("law") if isinstance(coupling, dict) else None
    if named != AUTO or not isinstance(coupling, dict):
        return None
    coupling["law"] = STANDARD_LAW
    delay = coupling.get("delay_s", 0.0)
    if document.get(("link",)) is not None or document.get(("sites",)) is not None:
        return ChosenLaw(Choice(STANDARD_LAW, f"{STANDARD_LAW}, passive over any network"))
    missing = registry.load_named(registry.load_coupling(LATE_LAW).missing)
    but = next(missing(document), "")
    if not isinstance(delay, int | float) or delay <= PROMPT_S:
        prompt = f"{1e3 * PROMPT_S:g} ms"
        why = f"{STANDARD_LAW}: up to {prompt} no other follows much closer, and forces are exact"
        late = f"{LATE_LAW}, in an account: law {STANDARD_LAW} {UNCERTIFIED}"
        return ChosenLaw(Choice(STANDARD_LAW, why), None if but else Choice(LATE_LAW, late))
    if but:
        return ChosenLaw(_costly(delay, but))
    coupling["law"] = LATE_LAW
    if coupling.get("account") is None:
        coupling["account"] = {}
    why = (
        f"{LATE_LAW}, in an account: over {1e3 * delay:g} ms it follows and renders contacts as "
        "without a delay. A first contact is felt two delays late, and how long a press is held "
        f"is not promised; law {STANDARD_LAW} holds forces exactly, F tau / b apart"
    )
    return ChosenLaw(Choice(LATE_LAW, why), _costly(delay, UNCERTIFIED))


def certified_law(rig: Rig, chosen: ChosenLaw, choose_keys: Callable[[Rig], Rig]) -> Rig:
    """Return a rig whose law was chosen with a law that is certified, or that says that none is.

    `choose_keys` gives a rig a value for each key that is left to its law, as `rig` has already.
    """
    certify = registry.load_named(CERTIFY)
    if certify(rig, brief=True).passed:
        return rig.with_law(chosen.choice)
    law, why = chosen.choice
    if chosen.other is None:
        return rig.with_law(Choice(law, f"{why}; it {UNCERTIFIED} (below)"))
    other = choose_keys(_with_law(rig, chosen.other.value))
    if certify(other, brief=True).passed:
        return other.with_law(chosen.other)
    neither = f"neither it nor law {chosen.other.value} is certified for this rig (below)"
    return rig.with_law(Choice(law, f"{why}; {neither}"))


def _with_law(rig: Rig, law: str) -> Rig:
    """Return a rig with another of the two laws, and what laws and pairs of both have."""
    kept = rig.coupling.model_dump(include=set(AnyLaw.model_fields) - {"law", "account", "pairs"})
    shared = set(AnyPair.model_fields)
    pairs = {name: it.model_dump(include=shared) for name, it in rig.coupling.pairs.items()}
    coupling = coupling_block(law).model_validate(kept | BLOCKS[law] | {"pairs": pairs})
    return rig.model_copy(update={"coupling": coupling})


def _costly(delay: float, but: str) -> Choice:
    """Return law wave over a delay [s] for which another would be chosen, but for one thing."""
    why = (
        f"{STANDARD_LAW}, which over {1e3 * delay:g} ms costs F tau / b between the devices and "
        f"b tau of inertia in the hand (below); law {LATE_LAW} follows closer, but {but}"
    )
    return Choice(STANDARD_LAW, why)
