"""The shipped rigs that are measured."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from tautwave.config import Rig, load_rig
from tautwave.config.shipped import find_example


class BenchRig(NamedTuple):
    """One rig: its name in the tables, and what `tautwave example` calls it."""

    name: str
    shipped: str

    def path(self) -> Path:
        """Return its file."""
        return find_example(self.shipped).path

    def load(self, overrides: Sequence[str] = ()) -> Rig:
        """Return the rig, checked and complete."""
        return load_rig(self.path(), overrides)


ONE_PAIR = BenchRig("one pair", "bench-1dof-loopback")
TWO_PAIRS = BenchRig("two pairs", "bench-2axis-loopback")
RIGS = {rig.name: rig for rig in (ONE_PAIR, TWO_PAIRS)}

END_STOPS = tuple(f"{side}.axes.lever.mechanical_range=[-2.5, 2.5]" for side in ("master", "slave"))
"""Changes of a shipped rig with one lever a side: what an effort held in a stall may do ends
at them, so that a rig is certified that waits for seconds."""
