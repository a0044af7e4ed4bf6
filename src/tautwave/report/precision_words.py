"""Words that both tables of precision share."""

from __future__ import annotations

from tautwave.report.units import MISSING, ratio


def share(value: float | None, whole: float | None) -> str:
    """Return a share of a whole in words, as in `2.1 × 10⁻¹⁴`."""
    if value is None or not whole:
        return MISSING
    return ratio(value / whole)
