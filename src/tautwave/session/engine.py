"""`loop.engine`: a run's controller in plain Python, or compiled before anything is enabled."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec

from tautwave.config import Rig, has_plain_devices
from tautwave.errors import ConfigError
from tautwave.rig import Assembly, coupling_law
from tautwave.rig.assembly import DeviceMaker
from tautwave.runtime.control import CoupledControl

INSTALL = "pip install 'tautwave[fast]'"


def compiled_devices(
    rig: Rig, progress: Callable[[float, str], None] | None = None
) -> DeviceMaker | None:
    """Return the factory of a compiled run's loopback devices; None without engine.

    `progress` gets a message while the controller is compiled, if it is not in the cache. A scene
    has an engine of its own, by which its devices go: `scene_devices`.

    Raises
    ------
    ConfigError
        Numba is not installed.
    """
    if rig.loop.engine != "compiled":
        return None
    if find_spec("numba") is None:
        raise ConfigError(
            f"loop.engine: compiled needs numba: {INSTALL}, or set loop.engine to python"
        )
    if has_plain_devices(rig):
        return None  # they cannot be compiled: the devices stay in Python, as `check` reports
    from tautwave.simulation.kernel.compiled import cache_directory
    from tautwave.simulation.live.devices import CompiledDevices

    if progress is not None and not any(
        cache_directory(coupling_law(rig)).glob(
            "*/tautwave.simulation.live.entry._step_control-*.nbi"
        )
    ):
        progress(0.0, "compiling the controller (once per machine and version)")

    return CompiledDevices


def scene_devices(rig: Rig, engine: str) -> DeviceMaker | None:
    """Return the factory of the loopback devices of a scene whose steps are compiled."""
    if engine != "compiled" or has_plain_devices(rig):
        return None
    from tautwave.simulation.live.devices import CompiledDevices

    return CompiledDevices


def with_engine(rig: Rig, assembly: Assembly) -> Assembly:
    """Return the assembly with its controller compiled, if the rig requires it."""
    if rig.loop.engine != "compiled":
        return assembly
    from tautwave.simulation.live.control import CompiledControl

    assert isinstance(assembly.control, CoupledControl)
    control = CompiledControl(assembly.control)
    return assembly._replace(control=control, sources=[control, *assembly.sources[1:]])
