"""What law mediated asks of a rig that leaves its law open, before any key is read."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from tautwave.config.keys.coupling import AnyPair
from tautwave.config.text.document import Document

SLOWEST_HZ = 500.0
"""Rate below which its estimate of a contact takes longer than a hand's press."""

SHARED = frozenset(AnyPair.model_fields)
"""Keys that pairs of all laws have."""


def missing(document: Document) -> Iterator[str]:
    """Yield what a rig has that law mediated does not do, or lacks that it needs in an account.

    Each is the end of a sentence whose subject is the law. Blocks that are none are reported where
    the rig is read.
    """
    rate = document.get(("rate_hz",))
    if not isinstance(rate, int | float) or rate < SLOWEST_HZ:
        yield f"needs {SLOWEST_HZ:g} Hz"
    if document.get(("require",)) == "coupled_stable":
        yield "is not certified as coupled_stable"
    if document.get(("operate", "scales")):
        yield "does not change its scale while it runs"
    if document.get(("arms",)):
        yield "joins no tips of arms"
    for pair in _blocks(document.get(("coupling", "pairs"))):
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
    """Return the blocks of a mapping by name."""
    return [it for it in value.values() if isinstance(it, dict)] if isinstance(value, dict) else []
