"""A resonator behind a coupling spring, held by a hand: two masses, everything linear.

Device and hand 0.143 kg, 5 N s/m, 538 N/m; resonator 0.004 kg, 0.01 N s/m, 14.2 N/mm; between them
3 N/mm. Source: Berdahl, Smith, Niemeyer (the second seed), eqs 7-8.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from tautwave.bench.precision.points import Point, Scene
from tests.lab.timing import cpu_time
from tests.lab.workprecision import runs
from tests.lab.workprecision.contact import compiled

Array = npt.NDArray[np.float64]

NAME = "resonator"
PAIR = np.array([0.143, 538.0, 5.0, 0.004, 14200.0, 0.01, 3000.0])
"""m, k, b of device and hand, of the resonator, and the spring between."""

START = np.array([0.0, 1e-3, 0.0, 0.0])
SPAN_S = 0.1
LOOP_S = 1e-3
_TAYLOR = 18


def system() -> Array:
    """Return the matrix of d/dt (x, y, v, w) [SI]."""
    m, k, b, n, hard, c, s = PAIR
    return np.array(
        [
            [0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
            [-(k + s) / m, s / m, -b / m, 0.0],
            [s / n, -(hard + s) / n, 0.0, -c / n],
        ]
    )


def exponential(matrix: Array) -> Array:
    """Return the exponential of a matrix: Taylor series of a 2**-n-th of it, squared n times."""
    halvings = max(0, int(np.ceil(np.log2(max(np.abs(matrix).sum(axis=1).max(), 1e-300)))) + 3)
    small = matrix / 2.0**halvings
    # Of exp - 1, so that slow modes keep their digits.
    term = small.copy()
    result = small.copy()
    for i in range(2, _TAYLOR):
        term = term @ small / i
        result = result + term
    for _ in range(halvings):
        result = 2.0 * result + result @ result
    return np.asarray(np.eye(len(matrix)) + result)


def balanced(t: float) -> Array:
    """Return `exponential` of the system over `t` [s], in scaled states for its digits."""
    scale = np.array([1.0, 1.0, 2000.0, 2000.0])
    inner = exponential(system() * t * scale / scale[:, None])
    return np.asarray(inner * scale[:, None] / scale)


def cayley(t: float) -> Array:
    """Return one step of implicit midpoint: on a linear system the discrete gradient too."""
    half = 0.5 * t * system()
    one = np.eye(4)
    return np.asarray(np.linalg.solve(one - half, one + half))


def energy(state: Array) -> float:
    """Return the energy of both masses and all springs [J]."""
    m, k, _, n, hard, _, s = PAIR
    x, y, v, w = state
    return float(0.5 * (m * v * v + n * w * w + k * x * x + hard * y * y + s * (x - y) ** 2))


def errors(state: Array) -> tuple[float, float]:
    """Return the error after `SPAN_S` in the energy norm, and that of the energy."""
    want = balanced(SPAN_S) @ START
    whole = energy(START)
    if not np.isfinite(state).all():
        return np.inf, np.inf
    error = (energy(state - want) / whole) ** 0.5
    return max(error, 1e-17), max(abs(energy(state) - energy(want)) / whole, 1e-17)


def linear_scene(counts: Sequence[int], max_error: float, rounds: int) -> Scene:
    """Return all schemes on the resonator; `counts` are steps of the whole scene."""
    points = []
    for n in counts:
        t = SPAN_S / n
        for name, run in _methods(t, n).items():
            state, spent = timed(run, rounds)
            points.append(Point(NAME, name, t, *errors(state), spent))
    state, spent = timed(_methods(LOOP_S, round(SPAN_S / LOOP_S))["exact"], rounds)
    chosen = Point(NAME, "exact", LOOP_S, *errors(state), spent)
    what = (
        f"the paper's resonator on its coupling spring, let go at 1 mm, {SPAN_S:g} s; error: of "
        "the state at the end, square root of its energy over that at the start"
    )
    why = (
        "exact: no error at any step and four products per state, the cheapest step too; "
        f"meets {max_error:g} at {1e3 * LOOP_S:g} ms"
    )
    notes = ("discrete_gradient is implicit_midpoint on a linear system: one curve for both",)
    return Scene(NAME, what, tuple(points), chosen, why, notes)


def _methods(t: float, n: int) -> dict[str, Callable[[Array], Any]]:
    exact, middle = balanced(t).ravel(), cayley(t).ravel()
    matrix = compiled(runs.run_matrix)
    euler, rk4 = compiled(runs.run_pair_euler), compiled(runs.run_pair_rk4)
    return {
        "exact": lambda state: matrix(exact, state, n),
        "implicit_midpoint": lambda state: matrix(middle, state, n),
        "symplectic_euler": lambda state: euler(PAIR, state, n, t),
        "rk4": lambda state: rk4(PAIR, state, n, t),
    }


def timed(run: Callable[[Array], Any], rounds: int) -> tuple[Array, float]:
    """Return the end of the scene and CPU time per simulated second [s]."""
    state = START.copy()

    def once() -> None:
        state[:] = START
        run(state)

    spent = cpu_time(once, SPAN_S, rounds)
    return state.copy(), spent
