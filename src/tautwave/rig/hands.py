"""The hand that holds a device, as a rig states it."""

from __future__ import annotations

from typing import NamedTuple

from tautwave.config import Rig
from tautwave.models.hand import PAPER_HAND, Hand, rotary_hand

LEVER_ARM = 0.075
"""[m] Lever arm of the typical linear hand on a rotary axis without a stated hand."""


class StatedHand(NamedTuple):
    """A hand in SI of its axis, and where it comes from."""

    hand: Hand
    text: str


def stated_hand(rig: Rig, pair: str) -> StatedHand:
    """Return the hand on a pair's master: the simulation's, else a typical one."""
    rotary = rig.master.axes[pair].kind == "rotary"
    given = None if rig.simulation is None else rig.simulation.hand.get(pair)
    mass, damping, stiffness = PAPER_HAND
    lever, whose = LEVER_ARM, "a typical hand"
    if given is not None:
        mass, damping, stiffness = given.mass, given.damping, given.stiffness
        lever, whose = given.lever_arm or 1.0, "the simulation's hand"
    text = f"{whose}: {mass:g} kg, {damping:g} N s/m, {stiffness:g} N/m"
    if not rotary:
        return StatedHand(Hand(mass, damping, stiffness), text)
    return StatedHand(
        rotary_hand(mass, damping, stiffness, lever), f"{text} at a lever arm of {lever:g} m"
    )
