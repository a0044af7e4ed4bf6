"""Whether the energy books of a run closed; reads summaries, without NumPy."""

from __future__ import annotations

from tautwave.analysis.claim import NOTHING
from tautwave.summary import Summary

CLOSED = 1e-9
"""Residual over gross flow up to which the books count as closed."""

EPSILON = 2.3e-16
"""Of the greatest energy held, what rounding may cost in a cycle."""


def books_limit(summary: Summary) -> float:
    """Return the residual up to which books count as closed [J].

    A share of what flowed; where hardly anything moved, what rounding makes of the energies held.
    """
    held = 0.0
    for pair in summary.pairs.values():
        for element in pair.elements.values():
            held = max(held, element.held or 0.0)
    flow, cycles = summary.energy_j.gross_flow or 0.0, summary.cycles or 0
    return max(CLOSED * flow, NOTHING, EPSILON * held * cycles)


def books_closed(summary: Summary) -> bool | None:
    """Return whether the books closed; None where nothing is known of them."""
    energy = summary.energy_j
    if energy.residual is None:
        return False if "residual" in energy.model_fields_set else None
    return abs(energy.residual) <= books_limit(summary)  # NaN is not closed
