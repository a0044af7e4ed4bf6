"""Verdicts of drivers that have laws of their own between axes and motors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from tautwave.certificate.data import Element, Verdict
from tautwave.config import Rig, bus_spec
from tautwave.registry import load_driver
from tautwave.types import CommandDelay


def bus_elements(rig: Rig, delays: Mapping[str, CommandDelay]) -> Iterator[Element]:
    """Yield what the drivers of a rig's buses say of themselves."""
    for name, bus in rig.own_buses.items():
        plugin = load_driver(bus.driver)
        if plugin.elements is None:
            continue
        spec = bus_spec(rig, name)
        delay = delays[spec.axes[0].name]
        late = delay.periods + delay.remainder_s / (rig.period_s * bus.divisor)
        options = plugin.options.model_validate(bus.options)
        for found in plugin.elements(options, spec, rig.axes, late):
            verdict = Verdict(found.passed, found.sentence, found.conditions, found.margin)
            yield Element(
                found.name,
                found.kind,
                found.axis,
                verdict,
                verdict,
                found.numbers,
                (found.sentence,),
            )
