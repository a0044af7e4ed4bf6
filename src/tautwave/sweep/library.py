"""The kernel in C for sweeps: compiled once for this very processor, and kept.

Same text and same order of operations as `cbuild.c_kernel`, so the same bits; only loading it
costs a few milliseconds where gcc, and numba even more, would cost every worker seconds.
"""

from __future__ import annotations

import ctypes
import fcntl
import hashlib
import operator
import os
import platform
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tautwave.simulation.kernel import cbuild, cexpr, ctext, ctypes_of
from tautwave.simulation.kernel.compiled import source_modules

FLAGS = (
    *("-O3", "-march=native", "-ffp-contract=off", "-shared", "-fPIC"),
    *("-fno-math-errno", "-fno-trapping-math", "-fno-tree-vectorize"),
)
"""Nothing that changes a bit. Vectors are left out: a pair of numbers stored as two and loaded as
one waits for the store, in a step that is one chain of such pairs (5 % of it)."""


def library_path() -> Path:
    """Return where the library of the present sources, on this processor, is kept."""
    digest = hashlib.sha256(" ".join(FLAGS).encode())
    for module in (*source_modules(), cbuild, cexpr, ctext, ctypes_of):
        digest.update(module.__name__.encode())
        digest.update(Path(str(module.__file__)).read_bytes())
    digest.update(f"{sys.version_info[:2]} {platform.machine()} {_processor()}".encode())
    root = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return root / "tautwave" / f"kernel-{digest.hexdigest()[:16]}.so"


def _processor() -> str:
    """Return what the processor can do: a home directory may be shared by several machines."""
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return platform.processor()
    kept = [line for line in text.splitlines() if line.startswith(("model name", "flags"))]
    return "\n".join(kept[:2])


def kept_kernel() -> Callable[..., int]:
    """Return `kernel.run_rig` in C; compiled by the first that asks, the others wait.

    Raises
    ------
    ConfigError
        It is not there, and there is no gcc or it refuses the text.
    OSError
        The cache cannot be written; use `cbuild.c_kernel`.
    """
    path = library_path()
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.with_suffix(".lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not path.is_file():
                _compile(path)
    function = ctypes.CDLL(str(path)).run_rig
    function.restype = ctypes.c_int64
    last: tuple[Any, ...] = ()
    addresses: list[ctypes.c_void_p] = []

    def run(*tables: Any) -> int:
        nonlocal last, addresses
        if len(last) != len(tables) or not all(map(operator.is_, tables, last)):
            addresses = [ctypes.c_void_p(table.ctypes.data) for table in tables]
            last = tables  # held, so that no other table gets the same address
        return int(function(*addresses))

    return run


def _compile(path: Path) -> None:
    with tempfile.TemporaryDirectory(prefix="tautwave-", dir=path.parent) as directory:
        made = cbuild.compile_text(cbuild.kernel_text(), Path(directory), FLAGS)
        os.replace(made, path)
