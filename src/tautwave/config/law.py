"""`coupling.law: auto`: which law a rig gets, before its keys are read."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

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

SLOWEST_HZ = 500.0
"""Rate below which its estimate of a contact takes longer than a hand's press."""

CERTIFY = "tautwave.certificate:certify"
"""Judges a whole rig; by name, since it imports this package."""

SHARED = frozenset(AnyPair.model_fields)
"""Keys that pairs of all laws have."""


def choose_law(document: Document) -> Choice | None:
    """Put a law in place of `auto` into a document; return it and why, None if one was named.

    Up to `PROMPT_S` it is law wave, whose forces are exact. A longer line makes that F tau / b off
    and b tau heavy, so it is law mediated in an account where the rig has what that needs.
    """
    coupling = document.get(("coupling",))
    named = coupling.get("law") if isinstance(coupling, dict) else None
    if named != AUTO or not isinstance(coupling, dict):
        return None
    coupling["law"] = STANDARD_LAW
    delay = coupling.get("delay_s", 0.0)
    if document.get(("link",)) is not None or document.get(("sites",)) is not None:
        return Choice(STANDARD_LAW, f"{STANDARD_LAW}, passive over any network")
    prompt = f"{1e3 * PROMPT_S:g} ms"
    if not isinstance(delay, int | float) or delay <= PROMPT_S:
        why = f"{STANDARD_LAW}: up to {prompt} no other follows much closer, and forces are exact"
        return Choice(STANDARD_LAW, why)
    missing = next(_missing(document, coupling), "")
    if missing:
        return _costly(delay, missing)
    coupling["law"] = LATE_LAW
    if coupling.get("account") is None:
        coupling["account"] = {}
    why = (
        f"{LATE_LAW}, in an account: over {1e3 * delay:g} ms it follows and renders contacts as "
        "without a delay. A first contact is felt two delays late, and a hold is as long as "
        f"`held force` says; law {STANDARD_LAW} holds forces exactly, F tau / b apart"
    )
    return Choice(LATE_LAW, why)


def certified_law(rig: Rig, choose_keys: Callable[[Rig], Rig]) -> Rig:
    """Return a rig whose law was chosen, with law wave where only that one is certified.

    `choose_keys` gives a rig a value for each key that is left to its law, as `rig` has already.
    """
    if rig.law is None or rig.law.value != LATE_LAW:
        return rig
    certify = registry.load_named(CERTIFY)
    certificate = certify(rig, brief=True)
    if certificate.passed:
        return rig
    law = coupling_block(STANDARD_LAW)
    shared = rig.coupling.model_dump(include=set(AnyLaw.model_fields) - {"law", "account", "pairs"})
    pairs = {
        name: pair.model_dump(include=set(SHARED)) for name, pair in rig.coupling.pairs.items()
    }
    coupling = law.model_validate({**shared, "law": STANDARD_LAW, "pairs": pairs})
    other = choose_keys(rig.model_copy(update={"coupling": coupling}))
    if not certify(other, brief=True).passed:
        return rig
    return other.with_law(_costly(rig.coupling.delay_s, "is not certified for this rig"))


def _costly(delay: float, but: str) -> Choice:
    """Return law wave over a delay [s] for which another would be chosen, but for one thing."""
    why = (
        f"{STANDARD_LAW}, which over {1e3 * delay:g} ms costs F tau / b between the devices and "
        f"b tau of inertia in the hand (below); law {LATE_LAW} follows closer, but {but}"
    )
    return Choice(STANDARD_LAW, why)


def _missing(document: Document, coupling: dict[str, Any]) -> Iterator[str]:
    """Yield what a rig has that law mediated does not do, or lacks that it needs."""
    rate = document.get(("rate_hz",))
    if not isinstance(rate, int | float) or rate < SLOWEST_HZ:
        yield f"needs {SLOWEST_HZ:g} Hz"
    if document.get(("require",)) == "coupled_stable":
        yield "is not certified as coupled_stable"
    if document.get(("operate", "scales")):
        yield "does not change its scale while it runs"
    if document.get(("arms",)):
        yield "joins no tips of arms"
    for pair in _blocks(coupling.get("pairs")):
        own = sorted(set(pair) - SHARED)
        if own:
            yield f"is not chosen for a pair with {own[0]}"
    for bus in _blocks(document.get(("buses",))):
        if bus.get("divisor", 1) != 1:
            yield "needs both sides at the same rate"
    for side in ("master", "slave"):
        for axis in _blocks(document.get((side, "axes"))):
            if axis.get("causality", "impedance") != "impedance":
                yield "drives axes that take effort only"
            for key in ("inertia", "velocity_limit", "effort_rate_limit"):
                if axis.get(key) is None:
                    yield f"needs {key}"


def _blocks(value: Any) -> list[dict[str, Any]]:
    """Return the blocks of a mapping by name; what is none is reported elsewhere."""
    return [it for it in value.values() if isinstance(it, dict)] if isinstance(value, dict) else []
