"""The rigs that are measured: those of the checkout's configs/, else copies in this package."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from tautwave.config import Rig, load_rig

HERE = Path(__file__).parent
CONFIGS = HERE.parents[2] / "configs"


class BenchRig(NamedTuple):
    """One rig by the name it has in the tables, its file in configs/, and the package's own."""

    name: str
    shipped: str
    own: str

    def path(self) -> Path:
        """Return the file to use."""
        shipped = CONFIGS / self.shipped
        return shipped if shipped.is_file() else HERE / self.own

    def load(self, overrides: Sequence[str] = ()) -> Rig:
        """Return the rig, checked and complete."""
        return load_rig(self.path(), overrides)


ONE_PAIR = BenchRig("one pair", "bench-1dof-loopback.yaml", "one-pair.yaml")
TWO_PAIRS = BenchRig("two pairs", "bench-2axis-loopback.yaml", "two-pairs.yaml")
RIGS = {rig.name: rig for rig in (ONE_PAIR, TWO_PAIRS)}
