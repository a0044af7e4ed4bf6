"""Cross-checks between a rig's `operate` and its other keys."""

from __future__ import annotations

from collections.abc import Mapping

from tautwave.config.keys.operate import Resting
from tautwave.config.pieces import Parts
from tautwave.config.text.document import Document

MIN_STEPS = 4
"""Of the drive's effort, with which a brake still holds."""


def check_operate(document: Document, parts: Parts) -> None:
    """Note what an operated rig, or one of two sites, cannot have."""
    for block in ("operate", "sites"):
        if document.get((block, "hold_effort_share")):
            _check_brakes(document, parts, (block, "hold_effort_share"))
    if document.get(("operate",)) is None:
        return
    if document.get(("scene",)) is not None:
        document.report(("operate",), "engages pairs, and a rig with a scene has none; remove it")
    if document.get(("sites",)) is not None:
        if document.get(("operate", "scales")):
            text = "two sites cannot change both ends in the same slot; remove it"
            document.report(("operate", "scales"), text)
        for key, field in Resting.model_fields.items():
            if document.get(("operate", key)) not in (None, field.default):  # as in a kept rig
                document.report(
                    ("operate", key), f"with two sites, use sites.{key} instead; remove it"
                )
    if document.get(("operate", "policy")) is not None:
        _check_policy(document, parts)
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


def _check_policy(document: Document, parts: Parts) -> None:
    """Note masters that a policy cannot lead by their own motors."""
    key = ("operate", "policy")
    if document.get(("sites",)) is not None:
        document.report(key, "with two sites the master is led by a person; remove it")
    hands = document.get(("simulation", "hand"))
    for name in parts.pairs or {}:
        axis = parts.axis("master", name)
        if axis is None:
            continue
        if axis.causality != "impedance" or axis.follower is not None:
            document.report(
                key, f"master.{name} takes no effort, so its motor cannot lead it; remove it"
            )
        elif axis.velocity_limit is None:
            document.report(
                key, f"leading master.{name} needs its velocity_limit; add it, or remove this key"
            )
        hand = hands.get(name) if isinstance(hands, Mapping) else None
        reference = hand.get("reference") if isinstance(hand, Mapping) else None
        if isinstance(reference, Mapping) and reference.get("type") == "policy":
            document.report(
                key,
                f"simulation.hand.{name} is led by a policy already, at a simulated master; "
                "remove one of both",
            )


def _check_brakes(document: Document, parts: Parts, key: tuple[str, str]) -> None:
    """Note axes that a brake cannot be made for."""
    for name in parts.pairs or {}:
        for side in ("master", "slave"):
            axis = parts.axis(side, name)
            if axis is None or axis.causality != "impedance":
                continue
            given = {"velocity_limit": axis.velocity_limit, "damping.lower": axis.damping.lower}
            missing = " and ".join(what for what, value in given.items() if not value)
            share = float(document.get(key))
            if missing:
                text = f"a brake needs {missing} of {side}.{name}; add it, or remove this key"
                document.report(key, text)
            elif share * axis.effort_limit < MIN_STEPS * axis.effort_quantum:
                document.report(
                    key,
                    f"{side}.{name} would be held with {share * axis.effort_limit:.3g}, less than "
                    f"{MIN_STEPS} steps of its effort_quantum, {axis.effort_quantum:g}; raise it "
                    f"(got {share:g})",
                )
