"""The verdict of a rig's coupling law; a part without one is never certified."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from tautwave import registry
from tautwave.certificate.data import CouplingVerdict, Element, Verdict
from tautwave.config import Rig
from tautwave.rig import coupling_part
from tautwave.types import CommandDelay


def coupling_verdict(rig: Rig) -> CouplingVerdict:
    """Return the passivity verdict that the part of a rig's law declares."""
    named = coupling_part(rig).verdict
    if not named:
        return SILENT
    declared = registry.load_named(named)
    return declared if isinstance(declared, CouplingVerdict) else CouplingVerdict(declared)


def is_silent(rig: Rig) -> bool:
    """Return whether the part of a rig's law has no verdict."""
    return not coupling_part(rig).verdict


def silence(rig: Rig, pair: str) -> str:
    """Return why a law without a verdict is not certified."""
    return (
        f"coupling of {pair}: law {rig.coupling.law} makes no statement about its passivity (its "
        "part has no verdict), so it is not certified"
    )


def _silent_elements(rig: Any, pair: str, delays: Mapping[str, CommandDelay]) -> Iterable[Element]:
    reason = silence(rig, pair)
    verdict = Verdict(False, reason)
    return [Element(f"coupling of {pair}", "coupling", pair, verdict, verdict, {}, (f"{reason}.",))]


SILENT = CouplingVerdict(_silent_elements)
