"""`simulate` of a rig with a scene: the live loop itself on the fake clock, rows kept in memory.

Laws and models of pairs have a kernel of their own; a scene has not: its loop is that of a run,
so its rows are a run's, to the bit, whatever driver a bus names.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from tautwave.config import Rig
from tautwave.errors import ConfigError, TautwaveError
from tautwave.offline.ticking import CompiledScene, can_tick
from tautwave.rig import build_rig
from tautwave.runtime.loop import Loop
from tautwave.scene.live import SceneModel

if TYPE_CHECKING:
    from tautwave.offline.simulation import Simulation

ENGINES = ("compiled", "python")


class KeptRows:
    """A sink that keeps every row in memory, packed."""

    def __init__(self, width: int) -> None:
        self.row = array("d", [0.0] * width)
        self.kept = array("d")

    @property
    def commit(self) -> Callable[[], object]:
        """Take the row as it stands."""
        return self._take

    def _take(self) -> None:
        self.kept.extend(self.row)


def simulate_scene(rig: Rig, duration_s: float | None, engine: str) -> Simulation:
    """Return the rows of a rig with a scene; see `offline.simulation.simulate`.

    `compiled` steps a scene by numba where that is installed, and everything else in Python.

    Raises
    ------
    ConfigError
        The rig simulates nothing, or there is no such engine for a scene.
    SafetyStop
        The scene never engaged.
    """
    from tautwave.offline.simulation import Simulation

    if rig.simulation is None:
        raise ConfigError(
            f"{rig.name}: there is nothing to simulate; add a simulation block to the rig file"
        )
    if engine not in ENGINES:
        raise ConfigError(
            f"{rig.name}: engine {engine!r} does not do scenes; engines: {', '.join(ENGINES)}"
        )
    built = build_rig(rig, clock="fake", duration_s=duration_s)
    assert built.scene is not None
    model = built.scene.model
    if engine == "compiled" and can_tick():
        if isinstance(model, SceneModel):
            built.scene.model = CompiledScene(model.network, model.scheme, model.period)
        else:
            from tautwave.offline.space_ticking import CompiledSpaceModel

            built.scene.model = CompiledSpaceModel(model.network, model.scheme, model.period)
    sink = KeptRows(len(built.columns))
    loop = Loop(built.clock, built.settings, built.buses, built.pairs, built.sources, sink)
    result = loop.run()
    for simulator in built.simulators:
        simulator.close()
    error = result.error
    began = built.scene.slot > 0
    if error is not None and not (began and isinstance(error, TautwaveError)):
        raise error
    assert error is None or isinstance(error, TautwaveError)
    data = np.array(sink.kept, dtype=np.float64).reshape(-1, len(built.columns))
    return Simulation(tuple(built.columns), data, error)
