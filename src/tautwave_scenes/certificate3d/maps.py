"""The sampled linear part of a 3D network near its present position."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from tautwave_scenes.certificate.contacts import Pressed
from tautwave_scenes.networks.sampled import PortMap
from tautwave_scenes.networks3d.arrays import Arrays3d
from tautwave_scenes.networks3d.matrices import Tangent, tangent
from tautwave_scenes.networks3d.network import Network3d

Matrix = npt.NDArray[np.float64]


def network3d_map(
    s: Arrays3d,
    scheme: str,
    period: float,
    scales: Matrix,
    closed: Mapping[int, Pressed] | None = None,
    near: Tangent | None = None,
) -> PortMap:
    """Return the linearised step of a scheme at the present positions.

    `scales` are of the axes, or the matrix from them to the ports' coordinates, see `levers`.

    `closed` are contacts by the number of their link; `near` is `tangent` there, if it is known.
    """
    near = tangent(s) if near is None else near
    near = near._replace(damping=near.damping.copy(), stiffness=near.stiffness.copy())
    for link, one in (closed or {}).items():
        _close(near, s, link, one)
    n, axes = len(near.mass), scales.shape[-1]
    ways = near.ways * scales if scales.ndim == 1 else near.ways @ scales
    k, kp, kpp = _blocks(near.stiffness, n, ways)
    z, zp, zpp = _blocks(near.damping, n, ways)
    mass, eye = np.diag(near.mass), np.eye(n)
    # Over (x, v, strained, last q, q); a port's speed is its axes' motion since the last sample.
    # What a relaxing part is strained by lags behind x.
    own = (2 + len(near.branches)) * n
    rate = np.hstack([np.zeros((axes, own)), -np.eye(axes) / period, np.eye(axes) / period])
    place = np.hstack([np.zeros((axes, own + axes)), np.eye(axes)])
    at, speed, *strained = (
        (
            np.hstack([np.zeros((n, first)), eye, np.zeros((n, own - n - first + 2 * axes))])
            for first in range(0, own, n or 1)
        )
        if n
        else (np.zeros((0, 2 * axes)), np.zeros((0, 2 * axes)))
    )
    after = []
    if scheme == "symplectic":
        pull = k @ at + kp @ place + z @ speed + zp @ rate
        faster = speed - period * pull / near.mass[:, None]
        moved = period * faster
        effort = kp.T @ at + kpp @ place + zp.T @ speed + zpp @ rate
    else:
        whole = 2.0 * mass / period**2 + z / period + 0.5 * k
        given = 2.0 * mass @ speed / period - k @ at - kp @ place - zp @ rate
        eased = [1.0 / (1.0 + 0.5 * period / time) for time, _ in near.branches]
        for (_, stiff), part, ease in zip(near.branches, strained, eased, strict=True):
            whole = whole + 0.5 * ease * stiff
            given = given - ease * stiff @ part
        moved = np.asarray(np.linalg.solve(whole, given), np.float64)
        faster = 2.0 * moved / period - speed
        after = [
            2.0 * ease * (part + 0.5 * moved) - part
            for part, ease in zip(strained, eased, strict=True)
        ]
        effort = kp.T @ (at + 0.5 * moved) + kpp @ place + zp.T @ moved / period + zpp @ rate
    whole = np.vstack([at + moved, faster, *after, place])
    size = own + axes
    return PortMap(whole[:, :size], whole[:, size:], effort[:, :size], effort[:, size:], period)


def levers(network: Network3d, scales: Sequence[float]) -> Matrix:
    """Return what each port's coordinate moves by per motion of each axis, at the start.

    Also the share of a force on the coordinate that the axis bears: (coordinates, axes).
    """
    carried = network.carried()
    carried.spread([0.0] * len(network.axes))
    ways = [carried.gather(row) for row in np.eye(len(network.coordinates)).tolist()]
    return np.asarray(np.array(ways).reshape(-1, len(scales)) * np.array(scales), np.float64)


def _close(near: Tangent, s: Arrays3d, link: int, one: Pressed) -> None:
    """Add a closed contact to the matrices."""
    along = np.outer(one.way, one.way) if one.way is not None else np.eye(3)
    nodes = s.count[0] + s.count[1]
    for row, left in ((s.a[link], 1.0), (s.b[link], -1.0)):
        for column, right in ((s.a[link], 1.0), (s.b[link], -1.0)):
            if row < nodes and column < nodes:
                at = np.ix_(range(3 * row, 3 * row + 3), range(3 * column, 3 * column + 3))
                near.stiffness[at] += left * right * one.stiffness * along
                near.damping[at] += left * right * one.damping * along


def _blocks(whole: Matrix, n: int, ways: Matrix) -> tuple[Matrix, Matrix, Matrix]:
    """Return the blocks of masses, masses and axes, and axes."""
    return whole[:n, :n], whole[:n, n:] @ ways, ways.T @ whole[n:, n:] @ ways
