"""Cross-checks between a rig's `operate` and its other keys."""

from __future__ import annotations

from tautwave.config.keys.operate import Aligning
from tautwave.config.pieces import Parts
from tautwave.config.text.document import Document


def check_operate(document: Document, parts: Parts) -> None:
    """Note what an operated rig cannot have."""
    if document.get(("operate",)) is None:
        return
    if document.get(("scene",)) is not None:
        document.report(("operate",), "engages pairs, and a rig with a scene has none; remove it")
    if document.get(("sites",)) is not None:
        if document.get(("operate", "scales")):
            text = "two sites cannot change both ends in the same slot; remove it"
            document.report(("operate", "scales"), text)
        for key, field in Aligning.model_fields.items():
            if document.get(("operate", key)) not in (None, field.default):  # as in a kept rig
                document.report(
                    ("operate", key), f"with two sites, use sites.{key} instead; remove it"
                )
    if document.get(("loop", "engine")) == "compiled":
        document.report(("loop", "engine"), "an operated rig runs in plain Python: remove it")
    for name, bus in parts.buses.items():
        if bus is not None and bus.divisor > 1:
            text = f"an operated rig reads every axis in every cycle (got {bus.divisor})"
            document.report(("buses", name, "divisor"), text)
    for name, pair in (parts.pairs or {}).items():
        slave = parts.axis("slave", name)
        if pair is None or slave is None or isinstance(pair.offset, str):
            continue
        if slave.causality == "admittance":
            document.report(
                ("coupling", "pairs", name, "offset"),
                "a velocity-controlled slave is not aligned: write at_engage "
                f"(got {pair.offset:g})",
            )
