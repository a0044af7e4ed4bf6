"""The modules that the compiled steps of scenes are made of."""

from __future__ import annotations

from tautwave_scenes.models import interaction, surface
from tautwave_scenes.models.tissue import algebra, element
from tautwave_scenes.networks import ledger
from tautwave_scenes.networks.schemes import gradient, islands, kutta, stepping, tension
from tautwave_scenes.networks3d import ledger as ledger3d
from tautwave_scenes.networks3d import solving as solving3d
from tautwave_scenes.networks3d import stepping as stepping3d
from tautwave_scenes.networks3d import straining as straining3d
from tautwave_scenes.networks3d import tension as tension3d
from tautwave_scenes.runtime import hold
from tautwave_scenes.simulation import cycle as live_scene
from tautwave_scenes.simulation import steps, tick, tick3d

SOURCES = (
    *(interaction, surface, algebra, element),
    *(stepping, tension, islands, gradient, kutta, ledger),
    *(stepping3d, tension3d, straining3d, solving3d, ledger3d),
    *(steps, tick, tick3d, hold, live_scene),
)
