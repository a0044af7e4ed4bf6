"""`simulate` of a rig with a scene: the live loop itself on the fake clock, rows kept in memory.

Unlike pairs, a scene has no separate kernel: its loop is that of a run, so its rows are a run's, to
the bit, whatever the driver of a bus.
"""

from __future__ import annotations

from tautwave.config import Rig
from tautwave.errors import ConfigError, TautwaveError
from tautwave.rig import build_rig
from tautwave.simulation.memory import run_in_memory
from tautwave.simulation.rows import Simulation
from tautwave_scenes.networks.live import SceneModel
from tautwave_scenes.runtime.axes import SceneControl
from tautwave_scenes.simulation.ticking import CompiledScene, can_tick

ENGINES = ("compiled", "python")


def simulate_scene(rig: Rig, duration_s: float | None, engine: str) -> Simulation:
    """Return the rows of a rig with a scene; see `simulation.run.simulate`.

    `compiled` steps a scene by numba if installed, and everything else in Python.

    Raises
    ------
    ConfigError
        The rig has no simulation, or the engine does not support scenes.
    SafetyStop
        The scene never engaged.
    """
    if rig.simulation is None:
        raise ConfigError(
            f"{rig.name}: there is nothing to simulate; add a simulation block to the rig file"
        )
    if engine not in ENGINES:
        raise ConfigError(
            f"{rig.name}: engine {engine!r} does not support scenes; engines: {', '.join(ENGINES)}"
        )
    built = build_rig(rig, clock="fake", duration_s=duration_s)
    assert isinstance(built.control, SceneControl)
    scene = built.control.scene
    model = scene.model
    if engine == "compiled" and can_tick():
        if isinstance(model, SceneModel):
            scene.model = CompiledScene(model.network, model.scheme, model.period)
        else:
            from tautwave_scenes.simulation.ticking3d import CompiledModel3d

            scene.model = CompiledModel3d(model.network, model.scheme, model.period)
    result, data = run_in_memory(built)
    error = result.error
    began = scene.slot > 0
    if error is not None and not (began and isinstance(error, TautwaveError)):
        raise error
    assert error is None or isinstance(error, TautwaveError)
    return Simulation(tuple(built.columns), data, error)
