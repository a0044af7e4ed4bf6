"""Ids of the axes of a bus against those that its options list."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from tautwave.contracts import AxisSpec, BusSpec


def unlisted(bus: BusSpec, axis: AxisSpec, device: str, known: Collection[int], needed: str) -> str:
    """Return the message of an axis whose id is in no block.

    Parameters
    ----------
    bus, axis
        Where it is.
    device : str
        What the options list, as in `node`; the option is its plural.
    known : collection of int
        Ids that they list.
    needed : str
        What its block has to state.
    """
    listed = ", ".join(str(number) for number in sorted(known))
    return (
        f"bus {bus.name}: {axis.name} has id {axis.device_id}, but options.{device}s lists only "
        f"{listed}; add it there, with {needed}"
    )


def unused(bus: BusSpec, device: str, known: Collection[int]) -> Sequence[str]:
    """Return a message for each `device` listed that no axis uses; none for a bus without axes."""
    used = {axis.device_id for axis in bus.axes}
    return [
        f"bus {bus.name}: {device} {number} in options.{device}s is not an axis of the rig; "
        "remove it there"
        for number in known
        if bus.axes and number not in used
    ]
