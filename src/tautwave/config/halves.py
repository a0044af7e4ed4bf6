"""The half of a rig that runs on one of two machines: nothing of the other's buses is looked at."""

from __future__ import annotations

from typing import Any

from tautwave.config.text.document import Document

SIDES = ("master", "slave")
OF_ONE_END = tuple(f"_{side}" for side in SIDES)
"""Endings of the keys of a pair that concern one end only: the sites need not agree on them."""

STAND_IN = "loopback"
"""Driver in place of the other half's: it is always installed, and nothing of it is opened."""


def leave_other_half(document: Document) -> None:
    """Put a stand-in in place of each driver that only the other site uses; sites have a link.

    What is left of such a bus is its divisor: at which rate the other site sends.
    """
    if document.get(("sites",)) is not None and document.get(("link",)) is None:
        document.value["link"] = {}
        document.marks["link",] = document.mark(("sites",))
    here = document.get(("sites", "here"))
    buses = document.get(("buses",))
    if here not in SIDES or not isinstance(buses, dict):
        return
    own, other = (buses_of(document, side) for side in (here, *(s for s in SIDES if s != here)))
    for name, block in buses.items():
        if name in other - own and isinstance(block, dict):
            kept = {"divisor": block["divisor"]} if "divisor" in block else {}
            buses[name] = {"driver": STAND_IN, **kept}
    _leave_truth(document, here)


def _leave_truth(document: Document, here: str) -> None:
    """Remove what is simulated on the other side; its files need not be here."""
    simulation = document.get(("simulation",))
    if not isinstance(simulation, dict):
        return
    simulation.pop("environment" if here == "master" else "hand", None)
    axes = simulation.get("axes")
    if isinstance(axes, dict):
        simulation["axes"] = {
            name: block for name, block in axes.items() if str(name).partition(".")[0] == here
        }


def buses_of(document: Document, side: str) -> set[str]:
    """Return the names of the buses that the axes of a side are on."""
    axes: Any = document.get((side, "axes"))
    names = set()
    for axis in axes.values() if isinstance(axes, dict) else ():
        bus = axis.get("bus") if isinstance(axis, dict) else None
        if isinstance(bus, str):
            names.add(bus)
    return names
