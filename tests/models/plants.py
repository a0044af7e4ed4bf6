"""Plants of the tests, by the parts they have."""

from __future__ import annotations

from tautwave.models.plant import PlantParams

STEP = 1e-3


def plant(
    mass: float = 0.1,
    viscous: float = 0.0,
    coulomb: float = 0.0,
    grip: tuple[float, float] = (0.0, 0.0),
    spring: tuple[float, float] = (0.0, 0.0),
    wall: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0),
) -> PlantParams:
    """Mass, friction, grip (k, b), spring (k, position), wall (k, b, position, side)."""
    return PlantParams(mass, viscous, coulomb, *grip, *spring, *wall)
