"""Shipped rigs of the work-precision figures."""

from __future__ import annotations

from tautwave.bench.precision.rigs import RigScene
from tautwave.config.shipped import find_example


def shipped(name: str, file: str) -> RigScene:
    """Return a rig that `tautwave example` copies, under a name."""
    return RigScene(name, find_example(file).path)


WAVE_WALL = shipped("wave-wall", "bench-1dof-loopback.yaml")
WAVE_FOAM = shipped("wave-foam", "bench-foam-loopback.yaml")
