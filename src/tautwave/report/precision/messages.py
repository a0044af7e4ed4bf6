"""Phrases shared by both tables of precision."""

from __future__ import annotations

from tautwave.report.units import MISSING, ratio


def share(value: float | None, whole: float | None) -> str:
    """Return a fraction of a total as text, as in `2.1 × 10⁻¹⁴`."""
    if value is None or whole is None:
        return MISSING
    if whole == 0.0:
        return "of zero" if value else "both zero"
    return ratio(value / whole)
