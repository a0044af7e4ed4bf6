"""SciPy's adaptive methods on a scene's network, from independently written equations."""

from __future__ import annotations

import importlib
import math
import time
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tautwave.bench.precision.points import Point
from tautwave_scenes.networks.network import Network
from tautwave_scenes.simulation.playing import Floats, Played
from tests.lab.peers.scipy_control import missing

if TYPE_CHECKING:
    from tautwave_scenes.bench.precision import Stage

KINDS = ("spring", "damper", "contact")
METHODS = ("DOP853", "Radau")
LONGEST_S = 6.0
"""CPU time of a run above which a peer gets no smaller tolerance."""


def scipy_network(stage: Stage, oracle: Played, tolerances: Sequence[float]) -> Iterator[Point]:
    """Yield DOP853 and Radau on a network of springs, dampers and contacts; once each.

    Every slot of the rig is a stretch of its own: forces have a kink there.
    """
    network = stage.network
    if missing("scipy") or not isinstance(network, Network) or network.strings:
        return
    if any(link.kind not in KINDS for link in network.links):
        return
    integrate: Any = importlib.import_module("scipy.integrate")
    rates = equations(stage, network)
    start = [mass.position for mass in network.masses] + [mass.velocity for mass in network.masses]
    travel = float(np.ptp(oracle.places, axis=0).max())
    count = len(network.masses)
    size = np.repeat([travel, travel / 1e-2], count)
    slots = (np.arange(stage.slots) + 1) * stage.rig.period_s
    for method in METHODS:
        for tolerance in tolerances:
            began = time.thread_time()
            found = integrate.solve_ivp(
                rates,
                (0.0, float(slots[-1])),
                np.array(start),
                method,
                t_eval=slots,
                rtol=max(tolerance, 3e-14),
                atol=tolerance * size,
                # Half a contact is not to be stepped over.
                max_step=10.0 * stage.rig.period_s,
            )
            spent = time.thread_time() - began
            error = math.inf
            if found.status == 0:
                error = stage.error(found.y[:count].T, oracle)
            yield Point(
                stage.scene.name, f"scipy {method}", tolerance, error, math.nan,
                spent / stage.span_s, adaptive=True, peer=True,
            )  # fmt: skip
            if spent > LONGEST_S:
                break


def equations(stage: Stage, network: Network) -> Callable[[float, Floats], Floats]:
    """Return d/dt of (positions, velocities) of all masses."""
    count = len(network.masses)
    mass = np.array([part.mass for part in network.masses])
    drag = np.array([part.damping for part in network.masses])
    names = [name for name in network.nodes() if name not in dict(network.grounds)]
    index = {name: at for at, name in enumerate([*names, *(n for n, _ in network.grounds)])}
    ground = np.array([at for _, at in network.grounds])
    forced = [index[name] for name in network.forced]
    ends, laws = _laws(network, index)
    pressed = np.array([link.kind == "contact" for link in network.links])

    def rates(t: float, z: Floats) -> Floats:
        at, speed, push = stage.moment(t)
        x = np.concatenate([z[:count], at, ground])
        v = np.concatenate([z[count:], speed, np.zeros(len(ground))])
        d = x[ends[0]] - x[ends[1]] - laws[2]
        w = v[ends[0]] - v[ends[1]]
        depth = np.maximum(-d, 0.0)
        bounce = -laws[0] * depth ** laws[3] * np.maximum(1.0 - laws[4] * w, 0.0)
        pull = np.where(pressed, bounce, laws[0] * d + laws[1] * w)
        force = np.zeros(len(x))
        np.subtract.at(force, ends[0], pull)
        np.add.at(force, ends[1], pull)
        total = force[:count] - drag * z[count:] - mass * network.gravity
        total[forced] += push
        return np.concatenate([z[count:], total / mass])

    return rates


def _laws(network: Network, index: dict[str, int]) -> tuple[Any, Floats]:
    """Return both ends of every link, and its stiffness, damping, rest, exponent and loss."""
    ends = np.array([[index[link.a], index[link.b]] for link in network.links]).T
    laws = [(k.stiffness, k.damping, k.rest, k.exponent, k.loss) for k in network.links]
    return ends, np.array(laws).T
