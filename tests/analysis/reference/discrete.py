"""Positive realness of a sampled transfer function, by the bilinear map."""

from __future__ import annotations

from tautwave.analysis.exact.positive_real import (
    Band,
    PositiveReal,
    _praise,
    _reason,
    positive_real,
)
from tautwave.analysis.exact.rational import Rational
from tests.analysis.reference.bilinear import angle_of, bilinear

_DISCRETE = (
    ("in the right half-plane", "outside the unit circle"),
    ("K(jw)", "K(e^jw)"),
    ("rad/s", "rad"),
)


def discrete_positive_real(law: Rational) -> PositiveReal:
    """Decide whether a function of z is positive real outside the unit circle, exactly.

    Frequencies in the result are angles [rad], 0 to pi. It is the test for a world that is to be
    passive in its own samples; it is *not* passivity of the device that holds its force for a
    period (that is Colgate's condition).
    """
    found = positive_real(bilinear(law))
    found = found._replace(
        axis_poles=tuple(p._replace(frequency=angle_of(p.frequency)) for p in found.axis_poles),
        negative=tuple(Band(angle_of(b.low), angle_of(b.high)) for b in found.negative),
        touches=tuple(angle_of(w) for w in found.touches),
    )
    reason = _reason(found) if not found.positive_real else _praise(found)
    for word, other in _DISCRETE:
        reason = reason.replace(word, other)
    return found._replace(reason=reason)
