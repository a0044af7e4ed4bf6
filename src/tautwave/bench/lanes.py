"""A thousand parameter sets of the plain wave-teleoperation scene: side by side against in turn.

The scene is the textbook's: hand, master, wave line of 50 periods, slave, wall; both devices by
their exact step, the wall's mode kept for a period. One text of a step is compiled twice by gcc:
for one set after the other, and for 16 sets in the lanes of the processor's vectors. `simulate`
keeps books, locates events and branches on them, and does not fit lanes; this says what could be
had by a scene without.
"""

from __future__ import annotations

import ctypes
import shutil
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tautwave.bench.result import Goal, Suite, Table, Value
from tautwave.offline.cbuild import compile_text

Floats = npt.NDArray[np.float64]
LANES = 16
DELAY = 50
PARAMETERS = ("b", "root", "a1", "c1", "d1", "a2", "c2", "d2", "k", "w", "p11", "p12", "p21", "p22")
STATE = ("x1", "v1", "x2", "v2", "sum", "peak")
FLAGS = ("-O3", "-march=native", "-ffp-contract=off", "-fno-trapping-math", "-shared", "-fPIC")
LIMIT = 0.5

STEP = """
double in1 = BACK, in2 = FORTH;
double f1 = Q(b) * S(v1) - Q(root) * in1;
double f2 = Q(root) * in2 - Q(b) * S(v2);
BACK = in2 - Q(root) * S(v2);
FORTH = Q(root) * S(v1) - in1;
double h = 500.0 * (aim - S(x1)) - 5.0 * S(v1) - f1;
S(x1) = S(x1) + Q(a1) * S(v1) + Q(c1) * h;
S(v1) = S(v1) + Q(d1) * h;
double deep = S(x2) - Q(w);
double free_x = S(x2) + Q(a2) * S(v2) + Q(c2) * f2;
double free_v = S(v2) + Q(d2) * f2;
double rest = deep - f2 / Q(k);
double wall_x = S(x2) + (Q(p11) - 1.0) * rest + Q(p12) * S(v2);
double wall_v = Q(p21) * rest + Q(p22) * S(v2);
S(x2) = deep > 0.0 ? wall_x : free_x;
S(v2) = deep > 0.0 ? wall_v : free_v;
double off = S(x1) - S(x2);
S(sum) = S(sum) + off * off;
double size = f1 < 0.0 ? -f1 : f1;
S(peak) = size > S(peak) ? size : S(peak);
"""


def scene_text() -> str:
    """Return both loops over sets in C; parameters and results are laid out by name, then set."""

    def named(name: str, at: str) -> str:
        return f"p[{PARAMETERS.index(name)} * n + {at}]"

    one = [f"double q_{name} = {named(name, 'i')};" for name in PARAMETERS]
    one += [f"double s_{name} = 0.0;" for name in STATE]
    many = [f"double q_{name}[L];" for name in PARAMETERS]
    many += [f"double s_{name}[L];" for name in STATE]
    load = [f"q_{name}[l] = {named(name, 'i + l')};" for name in PARAMETERS]
    load += [f"s_{name}[l] = 0.0;" for name in STATE]
    turn = "at = at + 1 == D ? 0 : at + 1;"
    return f"""
#include <stdint.h>
#define D {DELAY}
#define L {LANES}
#define Q(name) q_##name
#define S(name) s_##name
#define BACK back[at]
#define FORTH forth[at]
void in_turn(int64_t n, int64_t steps, const double *p, const double *aims, double *out) {{
for (int64_t i = 0; i < n; i++) {{
double back[D] = {{0}}, forth[D] = {{0}};
int64_t at = 0;
{" ".join(one)}
for (int64_t k = 0; k < steps; k++) {{ double aim = aims[k]; {STEP} {turn} }}
out[2 * i] = s_sum; out[2 * i + 1] = s_peak;
}} }}
#undef Q
#undef S
#undef BACK
#undef FORTH
#define Q(name) q_##name[l]
#define S(name) s_##name[l]
#define BACK back[at][l]
#define FORTH forth[at][l]
void side_by_side(int64_t n, int64_t steps, const double *p, const double *aims, double *out) {{
for (int64_t i = 0; i < n; i += L) {{
double back[D][L] = {{{{0}}}}, forth[D][L] = {{{{0}}}};
int64_t at = 0;
{" ".join(many)}
for (int64_t l = 0; l < L; l++) {{ {" ".join(load)} }}
for (int64_t k = 0; k < steps; k++) {{ double aim = aims[k];
for (int64_t l = 0; l < L; l++) {{ {STEP} }}
{turn} }}
for (int64_t l = 0; l < L; l++) {{ out[2 * (i + l)] = s_sum[l]; out[2 * (i + l) + 1] = s_peak[l]; }}
}} }}
"""


def parameters(sets: int) -> Floats:
    """Return parameters of as many sets, all different, shape (14, sets)."""
    period = 1e-3
    b = np.geomspace(2.0, 20.0, sets)
    m1 = np.linspace(0.3, 0.6, sets)
    m2 = np.linspace(0.6, 0.3, sets)
    k = np.geomspace(200.0, 5000.0, sets)
    rate = np.sqrt(k / m2)
    c, s = np.cos(rate * period), np.sin(rate * period)
    full = np.ones(sets)
    rows = [b, np.sqrt(2.0 * b)]
    for m in (m1, m2):
        rows += [period * full, 0.5 * period**2 / m, period / m]
    rows += [k, 0.005 * full, c, s / rate, -rate * s, c]
    return np.ascontiguousarray(rows)


def lanes(
    *, sets: int = 1008, steps: int = 4000, rounds: int = 9, tell: Callable[[str], None] = print
) -> Suite:
    """Measure a sweep of `sets` parameter sets (a multiple of 16) both ways.

    Parameters
    ----------
    sets, steps, rounds : int
        Sets, steps of 1 ms of each, and how often both are timed in turn.
    tell : callable
        Told what is being measured.
    """
    name = f"{sets} sets in lanes against scalar C, CPU time per set and core"
    if shutil.which("gcc") is None:
        return Suite("lanes", [], [Goal(name, LIMIT, "times", None, why_not="needs gcc")])
    tell(f"{sets} parameter sets")
    p = parameters(sets)
    aims = 0.01 * np.sin(0.006 * np.arange(steps))
    best: dict[str, float] = {}
    results: dict[str, Floats] = {}
    with tempfile.TemporaryDirectory(prefix="tautwave-") as directory:
        library: Any = ctypes.CDLL(str(compile_text(scene_text(), Path(directory), FLAGS)))
        ratios = []
        for _ in range(rounds):
            spent = {}
            for way in ("in_turn", "side_by_side"):
                out = np.zeros((sets, 2))
                began = time.thread_time_ns()
                getattr(library, way)(
                    *(ctypes.c_int64(value) for value in (sets, steps)),
                    *(ctypes.c_void_p(array.ctypes.data) for array in (p, aims, out)),
                )
                spent[way] = (time.thread_time_ns() - began) / sets / steps
                best[way] = min(best.get(way, spent[way]), spent[way])
                results[way] = out
            ratios.append(spent["side_by_side"] / spent["in_turn"])
    equal = np.array_equal(results["in_turn"], results["side_by_side"])
    ratio = float(np.median(ratios))
    rows: list[list[Value]] = [
        [way.replace("_", " "), cost, "yes" if equal else "NO"] for way, cost in best.items()
    ]
    table = Table(
        f"{sets} sets of the plain wave-teleoperation scene, {steps} steps each",
        f"gcc {' '.join(FLAGS[:4])}; CPU time per set and step, best of {rounds}, one thread; "
        f"{LANES} sets side by side; equal: both ways give the same bits",
        ("sets", "step_ns", "equal"),
        rows,
    )
    return Suite("lanes", [table], [Goal(name, LIMIT, "times", ratio)])
