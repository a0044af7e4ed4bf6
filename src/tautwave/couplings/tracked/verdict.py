"""Why a wave line is passive: its ports, line, filters, scaling and rate converters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from tautwave.certificate.data import CouplingVerdict, Element, Verdict
from tautwave.certificate.ports import port_element
from tautwave.certificate.rates import converter_element
from tautwave.config import Rig
from tautwave.couplings.tracked.keys import WaveCoupling, WavePair
from tautwave.rig import at_axis_rate, pair_scale
from tautwave.types import CommandDelay

Delays = Mapping[str, CommandDelay]


def _at_axis(rig: Rig, axis_name: str, delays: Delays, damping: float) -> Iterator[Element]:
    """Yield the port of an axis and, on a slow bus, its rate converter."""
    yield port_element(at_axis_rate(rig, axis_name), axis_name, delays, damping)
    converter = converter_element(rig, axis_name, delays)
    if converter is not None:
        yield converter


def _between(rig: Rig, pair: str, delays: Delays) -> Iterator[Element]:
    """Yield the line, its filters and scaling."""
    coupling = rig.coupling
    if rig.delay_samples:
        yield _fine(
            f"line of {pair}",
            "line",
            pair,
            f"a constant delay of {coupling.delay_s:g} s each way is lossless and holds the "
            "waves under way (Niemeyer and Slotine 1991); a missing wave counts as 0",
        )
    corner = coupling.wave_filter_hz if isinstance(coupling, WaveCoupling) else None
    if corner is not None:
        yield _fine(
            f"wave filters of {pair}",
            "filter",
            pair,
            f"|H| <= 1 at every frequency ({corner:g} Hz)",
        )
    scale = pair_scale(coupling.pairs[pair])
    if abs(scale.power - 1.0) > 1e-12:
        yield _fine(
            f"scaling of {pair}",
            "scaling",
            pair,
            f"power scaled by {scale.power:g}, the waves by its root: passive for a hand and an "
            "environment that touch each other through the rig only",
        )
    elif scale.scale != 1.0 or scale.sign < 0.0:
        yield _fine(f"scaling of {pair}", "scaling", pair, "keeps power")


def _fine(name: str, kind: str, pair: str, why: str) -> Element:
    result = Verdict(True, f"{name}: {why}.")
    return Element(name, kind, pair, result, result, {}, (result.reason,))


def _remedy(rig: Rig, pair: str) -> str:
    keys = rig.coupling.pairs[pair]
    assert isinstance(keys, WavePair)
    return f"Lower wave_impedance {keys.wave_impedance:g} or velocity_filter_s."


verdict = CouplingVerdict(_between, _at_axis, _remedy, contracting=True, picture="")
