"""Where a rig file has its arms, before it is known to be valid."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from tautwave.config.keys.arm import axes_of_arm, axis_prefix
from tautwave.config.text.document import Document
from tautwave.config.text.yaml12 import KeyPath


class ArmPlace(NamedTuple):
    """Where one arm stands in a rig file; nothing need be there.

    Attributes
    ----------
    name : str
        Its full name, as in `SideArm`.
    side : str
        `master` or `slave`.
    path : KeyPath
        Of its keys.
    axes : tuple of str
        The side's axes that are its joints, as they are listed.
    prefix : str
        What their names begin with, "" for the only arm of its side.
    """

    name: str
    side: str
    path: KeyPath
    axes: tuple[str, ...]
    prefix: str = ""

    @property
    def truth(self) -> KeyPath:
        """Where its simulated truth stands."""
        return ("simulation", "arms", self.name)

    @property
    def said(self) -> str:
        """What it is called in a sentence."""
        return f"arm {self.name}" if self.prefix else f"the {self.side}'s arm"

    @property
    def which(self) -> str:
        """What follows "each axis of the side" in a sentence about its joints."""
        return f" whose name begins with {self.prefix}" if self.prefix else ""


def arm_places(document: Document) -> Iterator[ArmPlace]:
    """Yield the place of each arm: those that `arms` of a side names, else that of its `arm`."""
    for side in ("master", "slave"):
        block, arms = document.get((side, "axes")), document.get((side, "arms"))
        axes = tuple(map(str, block)) if isinstance(block, dict) else ()
        if isinstance(arms, dict) and arms and document.get((side, "arm")) is None:
            for arm in map(str, arms):
                path = (side, "arms", arm)
                own = axes_of_arm(arm, axes)
                yield ArmPlace(f"{side}.{arm}", side, path, own, axis_prefix(arm))
        else:
            yield ArmPlace(side, side, (side, "arm"), axes)
