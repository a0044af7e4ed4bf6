"""The runs of a work-precision diagram in plain C: the same algorithm, translated, by gcc."""

from __future__ import annotations

import ctypes
import functools
import shutil
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import median
from typing import Any

from tautwave.bench.result import Goal, Table, Value
from tautwave.bench.workprecision.contact import ContactScene, compiled, run_method
from tautwave.bench.workprecision.points import ROUNDS
from tautwave.bench.workprecision.rig import RigScene, run_job
from tautwave.models.integrators.schemes import DORMAND_PRINCE, EXACT, SCHEMES
from tautwave.simulation.kernel.pack import pack_rig
from tautwave.simulation.kernel.records import PLANT
from tautwave.simulation.kernel.schemes import with_scheme

LIMIT = 1.3
STEPS = 131
NO_GCC = "gcc is not installed"


@functools.cache
def in_c(entry: Callable[..., int]) -> Callable[..., int]:
    """Return a run of `workprecision_runs` in C, called on the same tables."""
    from tautwave.simulation.kernel.cbuild import compile_text
    from tautwave.simulation.kernel.ctext import translate

    with tempfile.TemporaryDirectory(prefix="tautwave-") as directory:
        library = ctypes.CDLL(str(compile_text(translate(entry), Path(directory))))
    function = getattr(library, entry.__name__)
    function.restype = ctypes.c_int64

    def run(*tables: Any) -> int:
        *arrays, t = tables
        pointers = [ctypes.c_void_p(table.ctypes.data) for table in arrays]
        return int(function(*pointers, ctypes.c_double(t)))

    return run


def c_costs(
    scenes: Sequence[ContactScene],
    rigs: Sequence[RigScene],
    duration_s: float,
    rounds: int = ROUNDS,
) -> tuple[Table, list[Goal]]:
    """Return the cost of a step by numba and by gcc, and the goals on the rigs' ratios.

    Parameters
    ----------
    duration_s : float
        Simulated time of a rig [s].
    """
    if shutil.which("gcc") is None:
        goals = [_goal(rig.name, None, NO_GCC) for rig in rigs]
        return _table([]), goals
    rows: list[list[Value]] = []
    for scene in scenes:
        for name, scheme in SCHEMES.items():
            if scheme == DORMAND_PRINCE or (scheme == EXACT and scene.exponent != 1.0):
                continue
            rows.append(_contact_row(scene, name, scheme, rounds))
    goals = []
    for rig in rigs:
        row = _rig_row(rig, duration_s, rounds)
        rows.append(row)
        ratio = row[4]
        assert isinstance(ratio, float)
        goals.append(_goal(rig.name, ratio, ""))
    return _table(rows), goals


def _contact_row(scene: ContactScene, name: str, scheme: int, rounds: int) -> list[Value]:
    t = scene.span_s / STEPS
    pairs = []
    equal = True
    for _ in range(rounds):
        fast, spent = run_method(scene, scheme, STEPS, 0.0, compiled, 1)
        plain, spent_c = run_method(scene, scheme, STEPS, 0.0, in_c, 1)
        equal = equal and fast.tobytes() == plain.tobytes()
        pairs.append((1e9 * spent * t, 1e9 * spent_c * t))
    return [scene.name, name, *_figures(pairs), "yes" if equal else "NO"]


def _rig_row(rig: RigScene, duration_s: float, rounds: int) -> list[Value]:
    from tautwave.simulation.kernel.cbuild import c_kernel
    from tautwave.simulation.kernel.compiled import compiled_kernel

    job = pack_rig(rig.load(), duration_s)
    name = "as shipped"
    if all(device.kind == PLANT for device in job.devices):
        job, name = with_scheme(job, EXACT, 1, 0.0), "exact"
    period = job.run.period_ns
    pairs = []
    equal = True
    for _ in range(3 * rounds):
        fast = run_job(job, compiled_kernel(), 1)
        plain = run_job(job, c_kernel(), 1)
        equal = equal and fast.rows.tobytes() == plain.rows.tobytes()
        pairs.append((period * fast.cpu_s, period * plain.cpu_s))
    return [rig.name, name, *_figures(pairs), "yes" if equal else "NO"]


def _figures(pairs: Sequence[tuple[float, float]]) -> tuple[float, float, float]:
    """Return the best times [ns] of both engines, and the median ratio of neighbouring runs."""
    return (
        min(fast for fast, _ in pairs),
        min(plain for _, plain in pairs),
        median(fast / plain for fast, plain in pairs),
    )


def _goal(name: str, ratio: float | None, why_not: str) -> Goal:
    return Goal(f"{name}: compiled against plain C", LIMIT, "times", ratio, why_not=why_not)


def _table(rows: list[list[Value]]) -> Table:
    return Table(
        "One step, compiled by numba and in plain C",
        f"CPU time of a sub-step, of {STEPS} in 1.5 contact times, or of a whole cycle of a rig, "
        "all rows written; gcc -O2 -ffp-contract=off on the translation of the same text; best "
        "times, median ratio of runs in turn; equal: every result the same to the bit",
        ("scene", "scheme", "compiled_ns", "c_ns", "ratio", "equal"),
        rows,
    )
