"""The modules that the compiled steps of scenes are made of."""

from __future__ import annotations

from tautwave.models import interaction
from tautwave.models.tissue import algebra, element
from tautwave.runtime.scene import hold
from tautwave.scene import ledger
from tautwave.scene.schemes import gradient, islands, kutta, stepping, tension
from tautwave.scene3d import ledger as ledger3d
from tautwave.scene3d import solving as solving3d
from tautwave.scene3d import stepping as stepping3d
from tautwave.scene3d import straining as straining3d
from tautwave.scene3d import tension as tension3d
from tautwave.simulation.live import scene as live_scene
from tautwave.simulation.scene import steps, tick, tick3d

SOURCES = (
    *(interaction, algebra, element),
    *(stepping, tension, islands, gradient, kutta, ledger),
    *(stepping3d, tension3d, straining3d, solving3d, ledger3d),
    *(steps, tick, tick3d, hold, live_scene),
)
