"""A scene's linear part as a sampled system, and its loop with device and hand.

The map is found by probing: the same steps as in the live loop, on the network without its
nonlinear links, weight and rest lengths, from every unit state. So what is said of it covers the
code that runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.models.linear import flow_rows
from tautwave_scenes.models.link_kinds import is_linear
from tautwave_scenes.networks.live import SceneModel
from tautwave_scenes.networks.network import Network

Matrix = npt.NDArray[np.float64]


class PortMap(NamedTuple):
    """s' = a s + b q, u = c s + d q: positions of the axes in, resisting efforts out, in SI.

    The state is positions and velocities of the masses, and the axes' last positions.
    """

    a: Matrix
    b: Matrix
    c: Matrix
    d: Matrix
    period: float


class LinearScene(NamedTuple):
    """s' = a s + b p, u = c s + d p: position of one port in, resisting effort out, SI of the axis.

    The state is positions and velocities of the masses and the port's last position.
    """

    a: Matrix
    b: Matrix
    c: Matrix
    d: float
    period: float


def linear_part(network: Network) -> Network:
    """Return a network without nonlinear links, strings, weight, rest and start."""
    gone = {string.name for string in network.strings}
    return network._replace(
        masses=tuple(mass._replace(position=0.0, velocity=0.0) for mass in network.masses),
        links=tuple(
            link._replace(rest=0.0)
            for link in network.links
            if is_linear(link.kind) and not gone & {link.a, link.b}
        ),
        grounds=tuple((name, 0.0) for name, _ in network.grounds),
        strings=(),
        forced=(),
        gravity=0.0,
    )


def linear_scene(
    network: Network, scheme: str, period: float, port: str, scale: float = 1.0
) -> LinearScene:
    """Return the sampled linear part of a network at one port, the others held still.

    `scale` is the scene's motion per motion of the axis.
    """
    at = network.ports.index(port)
    scales = [scale if one == at else 1.0 for one in range(len(network.ports))]
    return one_port(scene_map(linear_part(network), scheme, period, scales), at)


def one_port(law: PortMap, at: int) -> LinearScene:
    """Return a map at one port, the others held still."""
    ports = len(law.d)
    masses = len(law.a) - ports
    keep = [*range(masses), masses + at]
    a, b, c = law.a[np.ix_(keep, keep)], law.b[keep, at], law.c[at, keep]
    return LinearScene(a, b, c, float(law.d[at, at]), law.period)


def scene_map(network: Network, scheme: str, period: float, scales: Sequence[float]) -> PortMap:
    """Return the step of a linear network at all its ports; `scales` as for `linear_scene`."""
    model = SceneModel(network, scheme, period)
    masses, ports = len(network.masses), len(network.ports)
    size = 2 * masses + ports
    after, effort = np.zeros((size, size + ports)), np.zeros((ports, size + ports))
    for given in range(size + ports):
        after[:, given], effort[:, given] = _probe(model, given, masses)
    # The last positions are in the axes' units, so only inputs and outputs are scaled.
    units = np.array(scales)
    after[: 2 * masses, 2 * masses : size] *= units
    after[: 2 * masses, size:] *= units
    effort *= units[:, None]
    effort[:, 2 * masses : size] *= units
    effort[:, size:] *= units
    return PortMap(after[:, :size], after[:, size:], effort[:, :size], effort[:, size:], period)


def _probe(model: SceneModel, unit: int, masses: int) -> tuple[Matrix, Matrix]:
    """Return the state after one step, and the efforts, from one unit of a state or an input."""
    ports = len(model.network.ports)
    given = [0.0] * (2 * (masses + ports))
    given[unit] = 1.0
    first = 2 * masses + ports
    model.reset(given[2 * masses : first])
    s = model.arrays
    for mass in range(masses):
        s.x[mass], s.v[mass] = given[mass], given[masses + mass]
    for i in range(s.count[2]):
        d = s.x[s.a[i]] - s.x[s.b[i]]
        s.stretch[i] = d
        s.stored[i] = 0.5 * s.k[i] * d * d
    efforts = model.advance(given[first:])
    return np.array([*s.x[:masses], *s.v[:masses], *given[first:]]), np.array(efforts)


def loop_poles(
    scene: LinearScene,
    mass: float,
    damping: float,
    stiffness: float,
    delay: int,
) -> npt.NDArray[np.complex128]:
    """Return the poles in z of a scene under a held device, its effort `delay` periods late."""
    period = scene.period
    xv, xn, _, vv, vn, _ = flow_rows(stiffness, damping, mass, period)[:6]
    device = np.array(
        [
            [1.0 - stiffness * xn, xv - damping * xn],
            [-stiffness * vn, 1.0 + vv - damping * vn],
        ]
    )
    push = np.array([-xn, -vn])
    a, b, c = seen_states(scene)
    n = len(b)
    size = 2 + n + delay
    whole = np.zeros((size, size))
    effort = np.zeros(size)
    effort[0], effort[2 : 2 + n] = scene.d, c
    whole[:2, :2] = device
    whole[2 : 2 + n, 0], whole[2 : 2 + n, 2 : 2 + n] = b, a
    if delay == 0:
        whole[:2] += np.outer(push, effort)
    else:
        whole[:2, 2 + n + delay - 1] = push
        whole[2 + n] = effort
        for at in range(1, delay):
            whole[2 + n + at, 2 + n + at - 1] = 1.0
    return np.asarray(np.linalg.eigvals(whole), np.complex128)


def seen_states(scene: LinearScene) -> tuple[Matrix, Matrix, Matrix]:
    """Return the states that the port can observe and control."""
    a, b, c = scene.a, scene.b, scene.c
    # The port's last position matters only if a damper is at the port.
    if not np.any(a[:-1, -1]) and c[-1] == 0.0:
        a, b, c = a[:-1, :-1], b[:-1], c[:-1]
    near: set[int] = {i for i in range(len(b)) if c[i] != 0.0}
    while True:
        more = {j for i in near for j in range(len(b)) if a[i, j] != 0.0} - near
        if not more:
            break
        near |= more
    keep = sorted(near)
    return a[np.ix_(keep, keep)], b[keep], c[keep]
