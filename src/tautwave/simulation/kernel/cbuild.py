"""The kernel in C: translated, compiled by gcc, called through ctypes on the same tables."""

from __future__ import annotations

import ctypes
import functools
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from tautwave.controller.records import (
    AxisParams,
    AxisState,
    PairParams,
    PairState,
    RunParams,
    RunState,
    Sample,
)
from tautwave.errors import ConfigError
from tautwave.simulation.kernel import records
from tautwave.simulation.kernel.ctext import translate
from tautwave.simulation.kernel.run import run_rig

FLAGS = ("-O2", "-ffp-contract=off", "-shared", "-fPIC")
"""No contraction to fused multiply-adds, which round once instead of twice."""

RECORDS = (
    RunParams,
    RunState,
    AxisParams,
    AxisState,
    Sample,
    PairParams,
    PairState,
    records.FakeParams,
    records.DeviceParams,
    records.DeviceState,
)


def kernel_text() -> str:
    """Return the kernel as one C file, with the sizes of its records checked against NumPy's."""
    checks = "".join(
        f"_Static_assert(sizeof(R_{record.__name__}) == {records.record_type(record).itemsize}, "
        f'"layout of {record.__name__}");\n'
        for record in RECORDS
    )
    return translate(run_rig) + "\n" + checks


def compile_text(text: str, directory: Path, flags: Sequence[str] = FLAGS) -> Path:
    """Compile a C file into a shared library in `directory`.

    Raises
    ------
    ConfigError
        There is no gcc, or it refuses the text.
    """
    gcc = shutil.which("gcc")
    if gcc is None:
        raise ConfigError("engine c needs gcc, and there is none on PATH; use another engine")
    source = directory / "kernel.c"
    library = directory / "kernel.so"
    source.write_text(text, encoding="utf-8")
    done = subprocess.run(
        [gcc, *flags, "-o", str(library), str(source), "-lm"],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        raise ConfigError(f"gcc refuses the kernel: {done.stderr.strip()[:2000]}")
    return library


@functools.cache
def c_kernel() -> Callable[..., int]:
    """Return `kernel.run_rig` in C; it takes the tables of `pack.record_tables`."""
    with tempfile.TemporaryDirectory(prefix="tautwave-") as directory:
        library = ctypes.CDLL(str(compile_text(kernel_text(), Path(directory))))
    function = library.run_rig
    function.restype = ctypes.c_int64

    def run(*tables: Any) -> int:
        return int(function(*[ctypes.c_void_p(table.ctypes.data) for table in tables]))

    return run
