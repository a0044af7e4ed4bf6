"""Loops over the integrators, in the subset that plain Python, numba and the translator to C share.

One call runs a scene from several starts, again and again: crossing into compiled code costs more
than a coarse run. Nothing is carried from one run to the next but the count.
"""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence

from tautwave.models.foam import FoamParams
from tautwave.models.integrators.schemes import integrate_step
from tautwave.models.plant import plant_step
from tautwave.models.plant_params import PlantCache, PlantParams


def run_contact(
    plants: Sequence[PlantParams],
    foams: Sequence[FoamParams],
    starts: Sequence[float],
    out: MutableSequence[float],
    sizes: Sequence[int],
    t: float,
) -> int:
    """Throw a mass at 1 m/s from each start; `sizes`: starts, steps of `t` [s], repeats.

    `out` takes x and v of each start at the end.
    """
    plant = plants[0]
    foam = foams[0]
    for _ in range(sizes[2]):
        for i in range(sizes[0]):
            x = starts[i]
            v = 1.0
            for _ in range(sizes[1]):
                x, v, _, _, _, _, _ = integrate_step(plant, foam, x, v, 0.0, 0.0, 0.0, t)
            out[2 * i] = x
            out[2 * i + 1] = v
    return sizes[0]


def run_exact(
    plants: Sequence[PlantParams],
    caches: Sequence[PlantCache],
    starts: Sequence[float],
    out: MutableSequence[float],
    sizes: Sequence[int],
    t: float,
) -> int:
    """As `run_contact`, by closed forms between located events."""
    plant = plants[0]
    cache = caches[0]
    for _ in range(sizes[2]):
        for i in range(sizes[0]):
            x = starts[i]
            v = 1.0
            mode = 0
            for _ in range(sizes[1]):
                x, v, mode, _, _, _, _, _ = plant_step(plant, cache, x, v, mode, 0.0, 0.0, 0.0, t)
            out[2 * i] = x
            out[2 * i + 1] = v
    return sizes[0]


def run_matrix(matrix: Sequence[float], state: MutableSequence[float], n: int) -> int:
    """Multiply the state of two masses (x1, x2, v1, v2) by a 4 x 4 matrix, `n` times."""
    a = state[0]
    b = state[1]
    c = state[2]
    d = state[3]
    for _ in range(n):
        e = matrix[0] * a + matrix[1] * b + matrix[2] * c + matrix[3] * d
        f = matrix[4] * a + matrix[5] * b + matrix[6] * c + matrix[7] * d
        g = matrix[8] * a + matrix[9] * b + matrix[10] * c + matrix[11] * d
        d = matrix[12] * a + matrix[13] * b + matrix[14] * c + matrix[15] * d
        a = e
        b = f
        c = g
    state[0] = a
    state[1] = b
    state[2] = c
    state[3] = d
    return n


def pair_rates(p: Sequence[float], x: float, y: float, v: float, w: float) -> tuple[float, float]:
    """Accelerations of two masses with spring and damper to the ground each, and one between."""
    pull = p[6] * (x - y)
    return (-p[1] * x - p[2] * v - pull) / p[0], (-p[4] * y - p[5] * w + pull) / p[3]


def run_pair_euler(p: Sequence[float], state: MutableSequence[float], n: int, t: float) -> int:
    """Symplectic Euler on two masses; `p`: m, k, b of each, then the spring between."""
    x = state[0]
    y = state[1]
    v = state[2]
    w = state[3]
    for _ in range(n):
        a, b = pair_rates(p, x, y, v, w)
        v = v + t * a
        w = w + t * b
        x = x + t * v
        y = y + t * w
    state[0] = x
    state[1] = y
    state[2] = v
    state[3] = w
    return n


def run_pair_rk4(p: Sequence[float], state: MutableSequence[float], n: int, t: float) -> int:
    """Kutta's classical scheme on two masses; `p` as in `run_pair_euler`."""
    x = state[0]
    y = state[1]
    v = state[2]
    w = state[3]
    half = 0.5 * t
    sixth = t / 6.0
    for _ in range(n):
        a1, b1 = pair_rates(p, x, y, v, w)
        v2 = v + half * a1
        w2 = w + half * b1
        a2, b2 = pair_rates(p, x + half * v, y + half * w, v2, w2)
        v3 = v + half * a2
        w3 = w + half * b2
        a3, b3 = pair_rates(p, x + half * v2, y + half * w2, v3, w3)
        v4 = v + t * a3
        w4 = w + t * b3
        a4, b4 = pair_rates(p, x + t * v3, y + t * w3, v4, w4)
        x = x + sixth * (v + 2.0 * (v2 + v3) + v4)
        y = y + sixth * (w + 2.0 * (w2 + w3) + w4)
        v = v + sixth * (a1 + 2.0 * (a2 + a3) + a4)
        w = w + sixth * (b1 + 2.0 * (b2 + b3) + b4)
    state[0] = x
    state[1] = y
    state[2] = v
    state[3] = w
    return n
