"""The verdict on law mediated without an account: the energy of a wrong model is unbounded."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from tautwave.certificate.data import CouplingVerdict, Element, Verdict
from tautwave.config import Rig
from tautwave.types import CommandDelay


def _coupling(rig: Rig, pair: str, delays: Mapping[str, CommandDelay]) -> Iterator[Element]:
    """Yield the verdict on one pair."""
    head = f"coupling of {pair}"
    verdict = Verdict(
        False,
        f"{head}: not passive; a model that stiffens while in contact generates energy, and so "
        f"does a slave that follows. Give it an account (coupling.account: {{}}).",
    )
    yield Element(head, "coupling", pair, verdict, verdict, {}, (verdict.reason,))


verdict = CouplingVerdict(_coupling, picture="a rendered model: no picture")
