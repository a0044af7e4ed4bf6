"""A viscous fluid below a surface, thicker with depth, that buoys the device up.

SI; on a rotary axis N m and rad stand for N and m.
"""

from __future__ import annotations

from pydantic import Field

from tautwave.plugin import EnvironmentPart, EnvironmentPlugin


class FluidKeys(EnvironmentPart):
    """A fluid above a position: drag and buoyancy."""

    surface: float = Field(description="[rad | m] Where the fluid begins; it fills all above.")
    viscosity: float = Field(gt=0, description="[N m s/rad | N s/m] Drag just below the surface.")
    thickening: float = Field(
        default=0.0, ge=0, description="[1/rad | 1/m] By how much it grows with depth, in shares."
    )
    buoyancy: float = Field(
        default=0.0, ge=0, description="[N m/rad | N/m] Effort per depth, towards the surface."
    )


def params(keys: FluidKeys) -> tuple[float, ...]:
    """Return the numbers that `force` and `stored` take."""
    return (keys.surface, keys.viscosity, keys.thickening, keys.buoyancy)


def force(p: tuple[float, ...], x: float, v: float) -> float:
    """Return the effort on the device at a position and velocity."""
    depth = x - p[0]
    if depth <= 0.0:
        return 0.0
    return -p[1] * (1.0 + p[2] * depth) * v - p[3] * depth


def stored(p: tuple[float, ...], x: float) -> float:
    """Return the energy that buoyancy holds [J]."""
    depth = x - p[0]
    if depth <= 0.0:
        return 0.0
    return 0.5 * p[3] * depth * depth


def kinks(p: tuple[float, ...]) -> tuple[float, ...]:
    """Return where drag sets in: the surface."""
    return (p[0],)


plugin = EnvironmentPlugin(
    "viscous fluid with a depth profile", FluidKeys, params, force, stored, kinks
)
