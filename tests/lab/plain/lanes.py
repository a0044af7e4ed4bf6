"""A thousand parameter sets of the plain wave-teleoperation scene: side by side against in turn.

The scene is `plain_scene`'s: both devices exact, meetings with the wall located. Three ways to run
it are held against each other, bit for bit: by hand in C one set after the other and 16 sets in the
lanes of the processor's vectors (`lanes_text`), and the Python text compiled by numba. How exact it
is is said by two others: `simulate`'s own plant, whose events are found by iteration, and Dormand-
Prince.

`simulate` itself is not run in lanes. A cycle of its kernel with books, limits, friction and
located events takes some 105 ns where this scene's takes 7, for a pair has 3.4 kB of records (the
plain one 1 kB, line included), 55 kB in 16 lanes: more than a first cache of 32 kB holds. Its text
has some 450 branches, most on what the set itself does; in lanes every set would compute both
sides of each, and whatever locates an event would be done one set at a time. The plain scene has
one such branch and gains a factor of three; which says nothing about the other.
"""

from __future__ import annotations

import ctypes
import importlib
import math
import shutil
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import numpy.typing as npt

from tautwave.bench.compiled import NO_NUMBA, has_numba
from tautwave.bench.result import Goal, Suite, Table, Value
from tautwave.models.integrators.schemes import DORMAND_PRINCE, EXACT
from tautwave.simulation.kernel.records import record_type
from tests.lab.plain import scene as plain_scene
from tests.lab.plain.gcc import compile_text
from tests.lab.plain.lanes_text import LANES, scene_text
from tests.lab.plain.scene import DELAY, Plain, plain_set, run_plain
from tests.lab.plain.truth import plain_truth

Floats = npt.NDArray[np.float64]
Run = Callable[[Any, Floats, Floats], None]
"""Takes records of sets, aims [m] and the table of results, (sets, 2)."""

PERIOD = 1e-3
FLAGS = (
    *("-O3", "-march=native", "-ffp-contract=off", "-fno-trapping-math", "-fno-math-errno"),
    *("-shared", "-fPIC"),
)
LIMIT = 0.5
COMPOSED = 1.3
EXACTNESS = 1e-12
SCALAR = "C, in turn"


def plain_sets(sets: int) -> list[Plain]:
    """Return as many sets, all different: impedance, both masses and the wall's stiffness vary."""
    impedances = np.geomspace(2.0, 20.0, sets).tolist()
    masses = np.linspace(0.3, 0.6, sets).tolist()
    walls = np.geomspace(200.0, 5000.0, sets).tolist()
    far = reversed(masses)
    parts = zip(impedances, masses, far, walls, strict=True)
    return [plain_set(PERIOD, b, m1, m2, 0.005, k) for b, m1, m2, k in parts]


def plain_aims(steps: int) -> Floats:
    """Return where the hand wants the master at each step [m]."""
    aims: Floats = 0.01 * np.sin(0.006 * np.arange(steps))
    return aims


def as_records(sets: Sequence[Plain]) -> Any:
    """Return sets as a table of records, for the compiled ways."""
    return np.array([tuple(part) for part in sets], dtype=record_type(Plain))


def lanes(
    *, sets: int = 1008, steps: int = 4000, rounds: int = 9, tell: Callable[[str], None] = print
) -> Suite:
    """Measure a sweep of `sets` parameter sets (a multiple of 16) in every way there is.

    Parameters
    ----------
    sets, steps, rounds : int
        Sets, steps of 1 ms of each, and how often all ways are timed in turn.
    tell : callable
        Called with the name of each measurement as it starts.
    """
    if shutil.which("gcc") is None:
        return Suite("lanes", [], _goals({}, math.nan, sets, "needs gcc"))
    tell(f"{sets} parameter sets")
    made = plain_sets(sets)
    aims = plain_aims(steps)
    with tempfile.TemporaryDirectory(prefix="tautwave-") as directory:
        taken, results = _timed(_ways(Path(directory)), as_records(made), aims, rounds)
    tell("oracles")
    errors = _error_rows(made, aims)
    scalar = taken[SCALAR]
    ratios = {
        way: median(one / other for one, other in zip(spent, scalar, strict=True))
        for way, spent in taken.items()
    }
    rows: list[list[Value]] = [
        [
            way,
            min(spent),
            ratios[way],
            "yes" if np.array_equal(results[way], results[SCALAR]) else "NO",
        ]
        for way, spent in taken.items()
    ]
    table = Table(
        f"{sets} sets of the plain wave-teleoperation scene, {steps} steps each, events located",
        f"gcc {' '.join(FLAGS[:-2])}; numba without fastmath; CPU time per set and step, best of "
        f"{rounds}, one thread; ratio: median of neighbouring runs; {LANES} sets side by side; "
        "equal: the bits of C in turn",
        ("way", "step_ns", "ratio", "equal"),
        rows,
    )
    exact = Table(
        "How exact the plain scene is",
        "greatest distance from the oracle over the oracle's range, of the slave's position and "
        "of the force on the master; oracles: simulate's exact plant with events found by "
        "iteration, Dormand-Prince at a tolerance of 1e-13, both in plain Python",
        ("impedance", "stiffness", "oracle", "position", "force"),
        errors,
    )
    worst = max(float(value) for row in errors for value in row[3:] if isinstance(value, float))
    why_not = "" if has_numba() else NO_NUMBA
    return Suite("lanes", [table, exact], _goals(ratios, worst, sets, why_not))


def _goals(ratios: dict[str, float], worst: float, sets: int, why_not: str) -> list[Goal]:
    def goal(name: str, limit: float, way: str) -> Goal:
        value = ratios.get(way)
        return Goal(name, limit, "times", value, why_not="" if value is not None else why_not)

    exact = None if math.isnan(worst) else worst
    return [
        goal(
            f"{sets} sets in lanes against scalar C, CPU time per set and core, events located",
            LIMIT,
            "C, side by side",
        ),
        goal("plain scene: composed, by numba, against plain C", COMPOSED, "numba, in turn"),
        Goal(
            "plain scene: greatest distance from an oracle, of the scene's range",
            EXACTNESS,
            "",
            exact,
            why_not="" if exact is not None else why_not,
        ),
    ]


def _ways(directory: Path) -> dict[str, Run]:
    """Return every way to run sets; the one by numba where it is installed."""
    ways: dict[str, Run] = {}
    library: Any = ctypes.CDLL(str(compile_text(scene_text(), directory, FLAGS)))
    for way, name in ((SCALAR, "in_turn"), ("C, side by side", "side_by_side")):
        ways[way] = _by_hand(getattr(library, name))
    if has_numba():
        ways["numba, in turn"] = _tables(compiled_plain())
    return ways


def compiled_plain() -> Callable[..., int]:
    """Return `run_plain` by numba, its parts compiled with the simulation's own settings."""
    numba: Any = importlib.import_module("numba")
    extending = importlib.import_module("numba.extending")
    options: dict[str, Any] = {"error_model": "numpy", "_nrt": False}
    extending.register_jitable(**options)(plain_scene.meet_wall)
    extending.register_jitable(forceinline=True, **options)(plain_scene.plain_step)
    compiled: Callable[..., int] = numba.njit(nogil=True, **options)(run_plain)
    return compiled


def _by_hand(function: Any) -> Run:
    def run(sets: Any, aims: Floats, out: Floats) -> None:
        function(
            *(ctypes.c_int64(value) for value in (len(sets), len(aims))),
            *(ctypes.c_void_p(array.ctypes.data) for array in (sets, aims, out)),
        )

    return run


def _tables(function: Callable[..., Any]) -> Run:
    def run(sets: Any, aims: Floats, out: Floats) -> None:
        sizes = np.array([len(sets), len(aims), 0])
        function(sets, aims, np.zeros(2 * DELAY), np.zeros(0), out.reshape(-1), sizes)

    return run


def _timed(
    ways: dict[str, Run], sets: Any, aims: Floats, rounds: int
) -> tuple[dict[str, list[float]], dict[str, Floats]]:
    """Return CPU times per set and step [ns], and results, by way."""
    for run in ways.values():
        run(sets[:LANES], aims[:1], np.zeros((LANES, 2)))  # numba compiles
    taken: dict[str, list[float]] = {way: [] for way in ways}
    results = {}
    for _ in range(rounds):
        for way, run in ways.items():
            out = np.zeros((len(sets), 2))
            began = time.thread_time_ns()
            run(sets, aims, out)
            taken[way].append((time.thread_time_ns() - began) / len(sets) / len(aims))
            results[way] = out
    return taken, results


def _error_rows(sets: Sequence[Plain], aims: Floats) -> list[list[Value]]:
    """Return how far first, middle and last set are from both oracles."""
    rows: list[list[Value]] = []
    for p in (sets[0], sets[len(sets) // 2], sets[-1]):
        found = plain_rows(p, aims)
        for oracle, scheme in (("simulate", EXACT), ("Dormand-Prince", DORMAND_PRINCE)):
            truth = plain_truth(p, aims.tolist(), scheme, 1e-13)
            off = np.abs(found - truth).max(axis=0) / np.ptp(truth, axis=0)
            rows.append([p.impedance, p.stiffness, oracle, float(off[1]), float(off[2])])
    return rows


def plain_rows(p: Plain, aims: Floats) -> Floats:
    """Return positions of both [m] and the force on the master [N], by plain Python, per step."""
    rows = [0.0] * (3 * len(aims))
    run_plain([p], aims.tolist(), [0.0] * (2 * DELAY), rows, [0.0, 0.0], [1, len(aims), 1])
    return np.array(rows).reshape(-1, 3)
