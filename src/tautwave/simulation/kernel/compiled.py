"""The kernel compiled by numba, and a cache that no edit can leave stale.

numba's own cache looks at the path and text of the compiled function only: after an edit in a
function that it calls, the old machine code is used on, and a second checkout of the same sources
compiles everything again. So the cache lies in a folder named by a hash of every source the kernel
is made of, and of numba's and NumPy's versions, and what is compiled says that it lies there too.
"""

from __future__ import annotations

import hashlib
import importlib
import inspect
import os
import pkgutil
import platform
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import tautwave.laws
import tautwave.models
from tautwave.controller import axis, braking, inertia, pair, run, steps
from tautwave.controller import records as controller_records
from tautwave.controller import rows as controller_rows
from tautwave.controller.steps import ALONE, Law, Steps
from tautwave.errors import ConfigError
from tautwave.laws import limit, observer, port, site
from tautwave.link import network as link_network
from tautwave.link import receiver as link_receiver
from tautwave.link import trace as link_trace
from tautwave.models import plant
from tautwave.simulation.kernel import device, records, rows
from tautwave.simulation.kernel import run as kernel
from tautwave.simulation.live import steps as live_steps

CONTROLLER_MODULES = (
    *(controller_records, steps, braking, inertia, axis, pair, controller_rows, run),
)
LINK_MODULES = (link_receiver, link_network, link_trace)
KERNEL_MODULES = (*CONTROLLER_MODULES, *LINK_MODULES, records, device, rows, kernel, live_steps)
INLINED = {
    *(axis.pass_slot, axis.close_axis, axis.decide_axis, axis.decide_command, axis.decide_effort),
    *(axis.pending_effort, axis.take_sample, pair.cycle_pair, run.run_cycle, run.check_sample),
    kernel.sense_device,
    *(device.pass_device, device.aim_hand, device.measure_device, device.command_device),
    *(device.device_forces, device.device_stored, plant.plant_forces, plant.plant_stored),
    plant.plant_step,  # unused results (in a bench: works and losses) are optimised away
    *(controller_rows.fill_pair, controller_rows.fill_axis, controller_rows.fill_wall),
    *(controller_rows.fill_element, rows.fill_device, port.port_effort, port.port_close),
    *(site.render_wall, site.clip_coupling, limit.guard_axis, limit.limit_effort),
    *(observer.observe, port.repayment, limit.clamp),
}
"""What runs in every cycle, is called in a place or two, and costs little more than a call.

Modules that are compiled beside these, and are not part of the kernel, name theirs as `INLINED`.
"""

Modules = tuple[ModuleType, ...]

RARE = ("start", "engage", "move", "brake")
"""Steps of a coupling that are called: the others are inlined."""


def source_modules() -> tuple[ModuleType, ...]:
    """Return every module that the kernel may be made of: all laws, all models, and itself."""
    modules = []
    for package in (tautwave.laws, tautwave.models):
        below = pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
        modules += [importlib.import_module(name) for name in sorted(info.name for info in below)]
    return (*modules, *KERNEL_MODULES)


def source_hash(law: Law = ALONE, more: Modules = ()) -> str:
    """Return a short name of the sources, a coupling's included, of compiler and Python in use."""
    digest = hashlib.sha256(law.name.encode())
    own = {function.__module__: sys.modules[function.__module__] for function in behind(law.steps)}
    for module in (
        *source_modules(),
        *own.values(),
        *more,
        sys.modules[__name__],
    ):  # its options count
        digest.update(module.__name__.encode())
        digest.update(Path(str(module.__file__)).read_bytes())
    for name in ("numba", "llvmlite", "numpy"):
        digest.update(importlib.import_module(name).__version__.encode())
    digest.update(f"{sys.version_info[:2]} {platform.machine()}".encode())
    return digest.hexdigest()[:16]


def behind(functions: Iterable[Callable[..., Any]]) -> list[Callable[..., Any]]:
    """Return functions and all that they call by a global name of theirs, in the order found."""
    reached: dict[Callable[..., Any], None] = {}
    waiting = list(functions)
    while waiting:
        function = waiting.pop()
        if function in reached or not inspect.isfunction(function):
            continue
        reached[function] = None
        named = (function.__globals__.get(name) for name in function.__code__.co_names)
        waiting += [one for one in named if inspect.isfunction(one)]
    return list(reached)


def cache_directory(law: Law = ALONE, more: Modules = ()) -> Path:
    """Return where machine code of the present sources is kept between processes.

    Below NUMBA_CACHE_DIR if that is set, else below the user's cache folder.
    """
    given = os.environ.get("NUMBA_CACHE_DIR")
    if given:
        root = Path(given)
    else:
        root = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return root / "tautwave" / source_hash(law, more)


def is_cached(entry: Callable[..., Any], law: Law = ALONE, more: Modules = ()) -> bool:
    """Return whether `cached(entry)` was compiled before, here and of the present sources."""
    name = f"{entry.__module__}.{entry.__qualname__}"  # as numba names its files
    return any(cache_directory(law, more).glob(f"*/{name}-*.nbi"))


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
            'or simulate(rig, engine="python"), which is several thousand times slower'
        ) from err


def compiled_kernel(law: Law) -> Callable[..., int]:
    """Return `kernel.run_rig` of a coupling for numba; compiled at the first call, or cached."""
    if law.steps not in _kernels:
        _kernels[law.steps] = cached(kernel.run_law, law)
    return _kernels[law.steps]


_kernels: dict[Steps, Callable[..., int]] = {}


def cached(entry: Callable[..., Any], law: Law = ALONE, more: Modules = ()) -> Callable[..., Any]:
    """Return a function of the source modules, and `more`, for numba; kept once compiled.

    Its global `STEPS`, if it has one, are the steps of `law`, compiled as well.
    """

    def compile_it(
        numba: Any, function: Callable[..., Any], kept: bool, options: dict[str, Any]
    ) -> Callable[..., Any]:
        made: Callable[..., Any] = numba.njit(cache=kept, nogil=True, fastmath=False, **options)(
            function
        )
        return made

    made: Callable[..., Any] = _compile(entry, law, compile_it, more)
    return made


def cached_c(
    entry: Callable[..., Any], signature: Any, law: Law = ALONE, more: Modules = ()
) -> Any:
    """Return a function as a C function of this signature; its `address` is to be called."""

    def compile_it(
        numba: Any, function: Callable[..., Any], kept: bool, options: dict[str, Any]
    ) -> Any:
        del options["_nrt"]  # without it no array can be made of an address
        return numba.cfunc(signature, cache=kept, fastmath=False, **options)(function)

    return _compile(entry, law, compile_it, more)


def register(entry: Callable[..., Any], functions: Iterable[Callable[..., Any]]) -> None:
    """Make numba know what may be called; `entry` itself is compiled otherwise."""
    extending = importlib.import_module("numba.extending")
    for function in functions:
        if function is not entry and function not in _registered:
            # Said of each, since numba hands the option down to whatever is called.
            own = getattr(sys.modules[function.__module__], "INLINED", ())
            options = {"forceinline": function in INLINED or function in own}
            _let_call(extending, function, {**options, **OPTIONS, **INTERNAL})
            _registered.add(function)


IN_PLACE = {pair.pair_at: pair.make_pair}
"""What is compiled in place of another function, and put where that is called.

numba can hand a view of records on to a function, and not return one.
"""


def _let_call(extending: Any, function: Callable[..., Any], options: dict[str, Any]) -> None:
    made = IN_PLACE.get(function, function)
    inline = "never" if made is function else "always"
    extending.overload(function, jit_options=options, strict=False, inline=inline)(lambda *_: made)


OPTIONS = {"error_model": "numpy", "_nrt": False}
"""Nothing is allocated in a run: without numba's run time no table is counted at every call."""

INTERNAL = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""Nothing but compiled code calls these: without doors to Python and C compiling is quicker."""

_registered: set[Callable[..., Any]] = set()


def compiled_steps(law: Law) -> ModuleType:
    """Return the steps of a coupling for numba, as an argument of compiled code.

    It is a module, whose functions numba looks up while it compiles: a tuple of functions would
    hand on addresses of this very process, and code with those is not kept in the cache.
    """
    numba = load_numba()
    made = ModuleType(law.name)
    for name, step in law.steps._asdict().items():
        setattr(made, name, numba.njit(forceinline=name not in RARE, **OPTIONS)(step))
    return made


def _copy_of(entry: Callable[..., Any], directory: Path) -> Path:
    """Put a copy of a function's source file into a folder unless it is there; return its path."""
    copy = directory / f"{entry.__module__}.py"
    if not copy.exists():
        draft = directory / f"{copy.stem}-{os.getpid()}.py"  # a second process puts the same there
        draft.write_bytes(Path(inspect.getfile(entry)).read_bytes())
        draft.replace(copy)
    return copy


def _compile(
    entry: Callable[..., Any],
    law: Law,
    compile_it: Callable[[Any, Callable[..., Any], bool, dict[str, Any]], Any],
    more: Modules = (),
) -> Any:
    numba = load_numba()
    for module in (*source_modules(), *more):
        register(entry, functions_of(module))
    known, code = entry.__globals__, entry.__code__
    if "STEPS" in code.co_names:
        register(entry, behind(law.steps))
        known = {**known, "STEPS": compiled_steps(law)}
    directory = cache_directory(law, more)
    try:
        directory.mkdir(parents=True, exist_ok=True)
        code = code.replace(co_filename=str(_copy_of(entry, directory)))
        kept = True
    except OSError:
        kept = False  # a read-only home: compile every time
    function = FunctionType(code, known, entry.__name__, entry.__defaults__)
    function.__qualname__ = entry.__qualname__
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(directory)
    try:
        return compile_it(numba, function, kept, dict(OPTIONS))
    finally:
        numba.config.CACHE_DIR = before
