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
from tautwave.errors import ConfigError
from tautwave.laws import limit, port, site
from tautwave.models import plant
from tautwave.offline import (
    couple,
    device,
    kernel,
    network_steps,
    network_tick,
    rates,
    records,
    rows,
    side,
    space_tick,
)
from tautwave.scene import batch, gradient, islands, ledger, pulling, stepping
from tautwave.scene.space import ledger as space_ledger
from tautwave.scene.space import pulling as space_pulling
from tautwave.scene.space import solving as space_solving
from tautwave.scene.space import stepping as space_stepping

KERNEL_MODULES = (records, side, couple, rates, device, rows, kernel)
SPACE_MODULES = (space_stepping, space_pulling, space_solving, space_ledger, space_tick)
SCENE_MODULES = (stepping, pulling, islands, gradient, ledger, batch, network_steps, network_tick)

INLINED = {
    *(side.pass_side, side.receive_side, side.close_side, side.decide_side, side.think_side),
    *(side.pending_effort, side.waiting_energy, couple.meet, couple.exchange_waves),
    *(device.pass_body, device.aim_hand, device.measure_body, device.command_body),
    *(device.body_forces, device.body_stored, plant.plant_forces, plant.plant_stored),
    plant.plant_step,  # what nobody takes of it (a bench: its works and losses) falls away
    *(rows.fill_pair, rows.fill_side, rows.fill_port, rows.fill_wall, rows.fill_body),
    *(site.think_wave, port.port_effort, port.port_close, limit.guard_axis, limit.limit_effort),
    *(stepping.move_ports, stepping.pull_links, stepping.step_symplectic),
}
"""What runs in every cycle, is called in a place or two, and costs little more than a call."""


def source_modules() -> tuple[ModuleType, ...]:
    """Return every module that the kernel may be made of: all laws, all models, and itself."""
    found = []
    for package in (tautwave.laws, tautwave.models):
        names = sorted(info.name for info in pkgutil.iter_modules(package.__path__))
        found += [importlib.import_module(f"{package.__name__}.{name}") for name in names]
    return (*found, *KERNEL_MODULES, *SCENE_MODULES, *SPACE_MODULES)


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
        result: Callable[..., Any] = numba.njit(cache=kept, nogil=True, fastmath=False, **options)(
            entry
        )
    finally:
        numba.config.CACHE_DIR = before
    return result
