"""The kernel compiled by numba, and a cache that no edit can leave stale.

numba's own cache looks at the text of the compiled function only: after an edit in a function
that it calls, the old machine code is used on. So the cache lies in a folder named by a hash of
every source the kernel is made of, and of numba's and NumPy's versions.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import inspect
import os
import pkgutil
import platform
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import tautwave.laws
import tautwave.models
from tautwave.controller import axis, line, pair, rates, run
from tautwave.controller import records as controller_records
from tautwave.controller import rows as controller_rows
from tautwave.errors import ConfigError
from tautwave.laws import limit, port, site
from tautwave.models import plant
from tautwave.scene import batch, ledger
from tautwave.scene.schemes import gradient, islands, kutta, stepping
from tautwave.scene.schemes import tension as pulling
from tautwave.scene3d import ledger as ledger3d
from tautwave.scene3d import solving as solving3d
from tautwave.scene3d import stepping as stepping3d
from tautwave.scene3d import tension as tension3d
from tautwave.simulation.kernel import device, records, rows
from tautwave.simulation.kernel import run as kernel
from tautwave.simulation.live import steps as live_steps
from tautwave.simulation.scene import steps as network_steps
from tautwave.simulation.scene import tick as network_tick
from tautwave.simulation.scene import tick3d

CONTROLLER_MODULES = (controller_records, axis, line, pair, rates, controller_rows, run)
KERNEL_MODULES = (*CONTROLLER_MODULES, records, device, rows, kernel, live_steps)
MODULES_3D = (stepping3d, tension3d, solving3d, ledger3d, tick3d)
SCENE_MODULES = (
    *(stepping, pulling, islands, gradient, kutta, ledger, batch),
    *(network_steps, network_tick),
)

INLINED = {
    *(axis.pass_slot, axis.receive_wave, axis.close_axis, axis.decide_axis, axis.think_axis),
    *(axis.pending_effort, axis.waiting_energy, axis.take_sample, line.exchange_waves),
    *(pair.exchange, pair.cycle_pair, run.run_cycle, run.check_sample),
    *(device.pass_device, device.aim_hand, device.measure_device, device.command_device),
    *(device.device_forces, device.device_stored, plant.plant_forces, plant.plant_stored),
    plant.plant_step,  # what nobody takes of it (a bench: its works and losses) falls away
    *(controller_rows.fill_pair, controller_rows.fill_axis, controller_rows.fill_port),
    *(controller_rows.fill_wall, controller_rows.fill_element, rows.fill_device),
    *(site.think_wave, port.port_effort, port.port_close, limit.guard_axis, limit.limit_effort),
    *(stepping.move_ports, stepping.pull_links, stepping.step_symplectic),
}
"""What runs in every cycle, is called in a place or two, and costs little more than a call."""


def source_modules() -> tuple[ModuleType, ...]:
    """Return every module that the kernel may be made of: all laws, all models, and itself."""
    found = []
    for package in (tautwave.laws, tautwave.models):
        below = pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
        found += [importlib.import_module(name) for name in sorted(info.name for info in below)]
    return (*found, *KERNEL_MODULES, *SCENE_MODULES, *MODULES_3D)


def source_hash() -> str:
    """Return a short name of the sources, compiler and Python in use."""
    digest = hashlib.sha256()
    for module in (*source_modules(), sys.modules[__name__]):  # its options count as well
        digest.update(module.__name__.encode())
        digest.update(Path(str(module.__file__)).read_bytes())
    for name in ("numba", "llvmlite", "numpy"):
        digest.update(importlib.import_module(name).__version__.encode())
    digest.update(f"{sys.version_info[:2]} {platform.machine()}".encode())
    return digest.hexdigest()[:16]


def cache_directory() -> Path:
    """Return where machine code of the present sources is kept between processes.

    Below NUMBA_CACHE_DIR if that is set, else below the user's cache folder.
    """
    given = os.environ.get("NUMBA_CACHE_DIR")
    if given:
        root = Path(given)
    else:
        root = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return root / "tautwave" / source_hash()


def is_cached(entry: Callable[..., Any]) -> bool:
    """Return whether `cached(entry)` was compiled before, here and of the present sources."""
    name = f"{Path(inspect.getfile(entry)).stem}.{entry.__qualname__}"  # as numba names its files
    return any(cache_directory().glob(f"**/{name}-*.nbi"))


def functions_of(module: ModuleType) -> Iterator[Callable[..., Any]]:
    """Yield the functions that a module defines."""
    for _, function in inspect.getmembers(module, inspect.isfunction):
        if function.__module__ == module.__name__:
            yield function


def load_numba() -> Any:
    """Import numba.

    Raises
    ------
    ConfigError
        It is not installed.
    """
    try:
        return importlib.import_module("numba")
    except ImportError as err:
        raise ConfigError(
            "the compiled simulation needs numba: pip install 'tautwave[fast]', "
            'or simulate(rig, engine="python"), which is some thousand times slower'
        ) from err


@functools.cache
def compiled_kernel() -> Callable[..., int]:
    """Return `kernel.run_rig` for numba; compiled at the first call, or read from the cache."""
    return cached(kernel.run_rig)


def cached(entry: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function of the source modules for numba, kept in the cache once compiled."""

    def compile_it(numba: Any, kept: bool, options: dict[str, Any]) -> Callable[..., Any]:
        made: Callable[..., Any] = numba.njit(cache=kept, nogil=True, fastmath=False, **options)(
            entry
        )
        return made

    made: Callable[..., Any] = _compile(entry, compile_it)
    return made


def cached_c(entry: Callable[..., Any], signature: Any) -> Any:
    """Return a function as a C function of this signature; its `address` is to be called."""

    def compile_it(numba: Any, kept: bool, options: dict[str, Any]) -> Any:
        del options["_nrt"]  # without it no array can be made of an address
        return numba.cfunc(signature, cache=kept, fastmath=False, **options)(entry)

    return _compile(entry, compile_it)


def _compile(
    entry: Callable[..., Any], compile_it: Callable[[Any, bool, dict[str, Any]], Any]
) -> Any:
    numba = load_numba()
    extending = importlib.import_module("numba.extending")
    # Nothing is allocated in a run: without numba's run time no table is counted at every call.
    options: dict[str, Any] = {"error_model": "numpy", "_nrt": False}
    for module in source_modules():
        for function in functions_of(module):
            if function is not entry:
                # Said of each, since numba hands the option down to whatever is called.
                extending.register_jitable(forceinline=function in INLINED, **options)(function)
    directory = cache_directory()
    try:
        directory.mkdir(parents=True, exist_ok=True)
        kept = os.access(directory, os.W_OK)
    except OSError:
        kept = False  # a read-only home: compile every time
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(directory)
    try:
        return compile_it(numba, kept, options)
    finally:
        numba.config.CACHE_DIR = before
