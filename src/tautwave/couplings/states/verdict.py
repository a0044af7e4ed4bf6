"""The verdict on a law of states without an account: by its tuning, if at all."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from tautwave.certificate.data import CouplingVerdict, Element
from tautwave.certificate.tuning.verdict import tuned_element
from tautwave.config import Rig
from tautwave.types import CommandDelay

REMEDY = "Give it an account (coupling.account: {}), or use law wave."


def _coupler(rig: Rig, pair: str, delays: Mapping[str, CommandDelay]) -> Iterator[Element]:
    """Yield the verdict on the law of one pair."""
    yield tuned_element(rig, pair, delays, REMEDY)


verdict = CouplingVerdict(_coupler, picture="no picture for this coupling")
