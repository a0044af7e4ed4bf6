"""`coupling.law: auto`: which law a rig gets, before its keys are read."""

from __future__ import annotations

from tautwave.config.keys.common import AUTO
from tautwave.config.keys.coupling import STANDARD_LAW
from tautwave.config.text.document import Document
from tautwave.types import Choice

PROMPT_S = 5e-3
"""[s] One-way delay up to which no other law follows closer (docs/explanation/couplings.md)."""


def choose_law(document: Document) -> Choice | None:
    """Put a law in place of `auto` into a document; return it and why, None if one was named.

    It is law wave at any delay: the only one that is passive by proof and holds a force exactly for
    as long as one likes. What a long delay costs is in its reason.
    """
    coupling = document.get(("coupling",))
    named = coupling.get("law") if isinstance(coupling, dict) else None
    if named != AUTO or not isinstance(coupling, dict):
        return None
    coupling["law"] = STANDARD_LAW
    delay = coupling.get("delay_s", 0.0)
    if document.get(("link",)) is not None or document.get(("sites",)) is not None:
        return Choice(STANDARD_LAW, f"{STANDARD_LAW}, passive over any network")
    if isinstance(delay, int | float) and delay > PROMPT_S:
        why = (
            f"{STANDARD_LAW}, which holds a force exactly at any delay; {1e3 * delay:g} ms cost "
            f"F tau / b between the devices and b tau of inertia in the hand (below). Over more "
            f"than {1e3 * PROMPT_S:g} ms law mediated in an account (law: mediated, account: {{}}) "
            "follows closer"
        )
        return Choice(STANDARD_LAW, why)
    return Choice(
        STANDARD_LAW,
        f"{STANDARD_LAW}: up to {1e3 * PROMPT_S:g} ms no other follows closer, and forces are "
        "exact",
    )
