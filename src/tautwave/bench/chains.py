"""Cost of a serial chain of seven joints: kinematics, with gravity, with the mass matrix."""

from __future__ import annotations

import importlib
import math
import time
from collections.abc import Callable
from types import FunctionType
from typing import Any

from tautwave.bench.chunks import Work, calling, costs
from tautwave.bench.result import Table, Value
from tautwave.models.chain.build import Body, Link, build_chain, roll_pitch_yaw
from tautwave.models.chain.gravity import chain_gravity
from tautwave.models.chain.inertia import mass_matrix
from tautwave.models.chain.kinematics import chain_frames, chain_jacobian, fill_jacobian, tip_pose

JOINTS = 7
BODY = Body(0.4, (0.05, 0.01, 0.02), ((2e-3, 1e-4, 0), (1e-4, 3e-3, 0), (0, 0, 1e-3)))
CHAIN = build_chain(
    tuple(
        Link(f"j{n}", "turns", (0.1, 0.02, 0.2), roll_pitch_yaw(1.5 - n, 0.3, 0.1), body=BODY)
        for n in range(JOINTS)
    ),
    (0.0, 0.0, -9.81),
)
PLACES = tuple(0.3 * math.sin(n + 1.0) for n in range(JOINTS))


def kinematics(chain: Any, q: Any, jacobian: Any, weight: Any, matrix: Any) -> float:
    """Pose and Jacobian."""
    return chain_jacobian(chain, q, jacobian)[0]


def weighed(chain: Any, q: Any, jacobian: Any, weight: Any, matrix: Any) -> float:
    """Pose, Jacobian and gravity."""
    frames = chain_frames(chain, q)
    pose = tip_pose(chain, frames)
    fill_jacobian(frames, pose, jacobian)
    return chain_gravity(chain, frames, weight) + pose[0]


def moved(chain: Any, q: Any, jacobian: Any, weight: Any, matrix: Any) -> float:
    """Pose, Jacobian, gravity and mass matrix."""
    frames = chain_frames(chain, q)
    pose = tip_pose(chain, frames)
    screws = fill_jacobian(frames, pose, jacobian)
    return mass_matrix(chain, q, frames, screws, pose, matrix, weight) + pose[0]


FUNCTIONS: tuple[Callable[..., Any], ...] = (
    chain_frames,
    tip_pose,
    fill_jacobian,
    chain_jacobian,
    chain_gravity,
    mass_matrix,
)
PARTS = (
    ("forward kinematics with Jacobian", kinematics),
    ("the same with gravity", weighed),
    ("the same with the mass matrix", moved),
)


def chain_table(rounds: int, *, with_numba: bool) -> Table:
    """Measure a chain as plain Python, and compiled where numba is installed."""
    sizes = (6 * JOINTS, JOINTS, JOINTS * JOINTS)
    lists = [[0.0] * size for size in sizes]
    live = costs({name: calling(part, CHAIN, PLACES, *lists) for name, part in PARTS}, rounds)
    fast = {}
    if with_numba:
        fast = costs({name: compiled_work(part, sizes) for name, part in PARTS}, rounds)
    rows: list[list[Value]] = [
        [
            name,
            live[name].best_ns / 1e3,
            live[name].median_ns / 1e3,
            fast[name].best_ns / 1e3 if fast else None,
        ]
        for name, _ in PARTS
    ]
    return Table(
        f"Serial chain of {JOINTS} joints",
        "CPU time of one posture",
        ("part", "plain_us", "plain_median_us", "compiled_us"),
        rows,
    )


def compile_part(part: Callable[..., Any]) -> Any:
    """Return a part compiled with all that it calls.

    The functions are compiled anew: those of the kernel may not allocate, and frames are a list.
    """
    numba: Any = importlib.import_module("numba")
    known: dict[str, Any] = {}
    for function in (*FUNCTIONS, part):
        own = FunctionType(function.__code__, {**function.__globals__, **known})
        known[function.__name__] = numba.njit(error_model="numpy")(own)
    return known[part.__name__]


def compiled_work(part: Callable[..., float], sizes: tuple[int, ...]) -> Work:
    """Return the work of calling a part from compiled code, each call after the one before."""
    import numpy as np

    law = compile_part(part)

    def run(n: int, chain: Any, q: Any, jacobian: Any, weight: Any, matrix: Any) -> float:
        last = 0.0
        for _ in range(n):
            q[0] = q[0] + 1e-300 * last
            last = law(chain, q, jacobian, weight, matrix)
        return last

    numba: Any = importlib.import_module("numba")
    compiled = numba.njit(error_model="numpy")(run)
    arguments = (CHAIN, np.array(PLACES), *(np.zeros(size) for size in sizes))

    def work(n: int) -> float:
        began = time.thread_time_ns()
        compiled(n, *arguments)
        return (time.thread_time_ns() - began) * 1e-9

    return work
