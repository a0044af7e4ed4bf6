"""The same scenes by other people's software, where it is installed: SciPy and python-control.

Everything is imported on demand; tautwave needs none of it. MuJoCo is in `peers_mujoco`.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from typing import Any

import numpy as np

from tautwave.bench.precision.points import Point
from tests.lab.timing import cpu_time
from tests.lab.workprecision import linear as resonator
from tests.lab.workprecision.contact import Array, ContactScene

STARTS = 3
"""Entry phases that a slow peer is given; the median of three."""


def missing(name: str) -> str:
    """Return why a peer cannot be measured; "" if it can."""
    return "" if find_spec(name) is not None else f"{name} is not installed"


def scipy_contact(scene: ContactScene, tolerances: Sequence[float], rounds: int) -> Iterator[Point]:
    """Yield DOP853 and Radau, restarted at the located edges of the contact."""
    if missing("scipy"):
        return
    integrate: Any = importlib.import_module("scipy.integrate")
    starts = scene.starts()[:STARTS]
    for method in ("DOP853", "Radau"):
        for tolerance in tolerances:
            out = np.zeros(2 * len(starts))

            def run(method: str = method, rtol: float = tolerance, out: Array = out) -> None:
                for i, x in enumerate(starts):
                    out[2 * i : 2 * i + 2] = _throw(integrate, scene, method, rtol, float(x))

            spent = cpu_time(run, scene.span_s * len(starts), min(rounds, 2))
            error, energy = _some(scene, out)
            name = f"scipy {method}"
            yield Point(scene.name, name, tolerance, error, energy, spent, True, True)


def _throw(
    integrate: Any, scene: ContactScene, method: str, rtol: float, x: float
) -> tuple[float, float]:
    """Return x and v at the end of one throw; each stretch between edges is smooth."""
    k, a, mass = scene.stiffness, scene.exponent, scene.plant.mass

    def free(_: float, z: Array) -> list[float]:
        return [z[1], 0.0]

    def pressed(_: float, z: Array) -> list[float]:
        depth = z[0] if z[0] > 0.0 else 0.0
        return [z[1], -k * depth**a / mass]

    def surface(_: float, z: Array) -> float:
        return float(z[0])

    surface.terminal = True  # type: ignore[attr-defined]
    scale = np.array([scene.contact_s, 1.0])
    t, z, inside = 0.0, np.array([x, 1.0]), False
    while t < scene.span_s:
        surface.direction = -1.0 if inside else 1.0  # type: ignore[attr-defined]
        found = integrate.solve_ivp(
            pressed if inside else free,
            (t, scene.span_s),
            z,
            method,
            events=surface,
            rtol=max(rtol, 3e-14),
            atol=rtol * scale,
        )
        t, z = float(found.t[-1]), found.y[:, -1]
        if found.status != 1:
            break
        z[0] = 0.0
        inside = not inside
    return float(z[0]), float(z[1])


def _some(scene: ContactScene, out: Array) -> tuple[float, float]:
    """Return the errors of the first few starts."""
    x, v = out[0::2], out[1::2]
    want = -(scene.span_s + scene.starts()[: len(x)] - scene.contact_s)
    error = float(np.median(np.hypot((x - want) / scene.contact_s, v + 1.0)))
    return max(error, 1e-17), max(float(np.median(np.abs(v * v - 1.0))), 1e-17)


def scipy_linear(tolerances: Sequence[float], rounds: int) -> Iterator[Point]:
    """Yield DOP853 and Radau on the resonator."""
    if missing("scipy"):
        return
    integrate: Any = importlib.import_module("scipy.integrate")
    matrix = resonator.system()
    for method in ("DOP853", "Radau"):
        for tolerance in tolerances:

            def run(state: Array, method: str = method, rtol: float = tolerance) -> None:
                found = integrate.solve_ivp(
                    lambda _, z: matrix @ z,
                    (0.0, resonator.SPAN_S),
                    state,
                    method,
                    rtol=max(rtol, 3e-14),
                    atol=rtol * np.array([1e-3, 1e-3, 1.0, 1.0]),
                    **({"jac": matrix} if method == "Radau" else {}),
                )
                state[:] = found.y[:, -1]

            yield _linear_point(f"scipy {method}", tolerance, run, min(rounds, 2), adaptive=True)


def control_linear(counts: Sequence[int], rounds: int) -> Iterator[Point]:
    """Yield python-control's `initial_response` on the resonator, at the loop's steps."""
    if missing("control"):
        return
    control: Any = importlib.import_module("control")
    system = control.ss(resonator.system(), np.zeros((4, 1)), np.eye(4), np.zeros((4, 1)))
    for n in counts:
        times = np.linspace(0.0, resonator.SPAN_S, n + 1)

        def run(state: Array, times: Array = times) -> None:
            state[:] = control.initial_response(system, times, state).states[:, -1]

        yield _linear_point("python-control", resonator.SPAN_S / n, run, min(rounds, 3))


def _linear_point(
    name: str,
    step: float,
    run: Callable[[Array], object],
    rounds: int,
    *,
    adaptive: bool = False,
) -> Point:
    state, spent = resonator.timed(run, rounds)
    return Point(resonator.NAME, name, step, *resonator.errors(state), spent, adaptive, True)
