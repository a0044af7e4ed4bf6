"""The verdict on a position coupling without an account: by its tuning."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from tautwave.certificate.data import CouplingVerdict, Element
from tautwave.certificate.tuning.verdict import tuned_element
from tautwave.config import Rig
from tautwave.types import CommandDelay

REMEDY = (
    "Lower its stiffness or the delay, give it an account (coupling.account: {}), or use law wave."
)


def _coupler(rig: Rig, pair: str, delays: Mapping[str, CommandDelay]) -> Iterator[Element]:
    """Yield the position coupling."""
    yield tuned_element(rig, pair, delays, REMEDY)


def _remedy(rig: Rig, pair: str) -> str:
    return "Lower the stiffness or the delay, raise the damping, or use law wave."


verdict = CouplingVerdict(
    _coupler,
    remedy=_remedy,
    picture="a position coupling: passive by tuning where it is soft",
)
