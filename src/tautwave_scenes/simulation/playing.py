"""A scene's network with given motions of its ports: compiled, or live in plain Python."""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.errors import ConfigError
from tautwave.simulation.kernel import compiled
from tautwave_scenes.networks.compiling import Arrays, as_arrays
from tautwave_scenes.networks.ledger import Ledger, take_ledger
from tautwave_scenes.networks.live import SceneModel
from tautwave_scenes.networks.network import Network
from tautwave_scenes.networks.schemes.exact import exact_islands
from tautwave_scenes.networks.schemes.stepping import pull_links
from tautwave_scenes.networks3d.live import Model3d
from tautwave_scenes.simulation import steps as network_steps
from tautwave_scenes.simulation.sources import SOURCES
from tautwave_scenes.simulation.steps import Flows, Lines
from tautwave_scenes.simulation.tick3d import tick_network3d

Floats = npt.NDArray[np.float64]
SCHEMES = {
    "symplectic": network_steps.SYMPLECTIC,
    "discrete_gradient": network_steps.GRADIENT,
    "exact": network_steps.EXACT,
    "rk4": network_steps.KUTTA,
}
ENGINES = ("compiled", "python")


class Played(NamedTuple):
    """Result of a network.

    `efforts` (rows, p) resisting [N], the mean over each row's steps; `places` (rows, n) positions
    of the masses and strings after them [m], (rows, 3 n) in three dimensions; its account at the
    end and at the start; CPU time of the steps [s].
    """

    efforts: Floats
    places: Floats
    ledger: Ledger
    start: Ledger
    cpu_s: float


def is_kept(*, scene3d: bool = False) -> bool:
    """Return whether the compiled steps are in the cache, so that using them compiles nothing.

    `scene3d`: those of three dimensions.
    """
    entry = tick_network3d if scene3d else network_steps.play_network
    return compiled.is_cached(entry, more=SOURCES)


@functools.cache
def compiled_play() -> Callable[..., int]:
    """Return `play_network` for numba; compiled at the first call, or read from the cache."""
    return compiled.cached(network_steps.play_network, more=SOURCES)


def play(
    model: SceneModel | Model3d,
    ports: Floats,
    pushes: Floats | None = None,
    *,
    engine: str = "compiled",
    stride: int = 1,
    seconds: float = float("inf"),
) -> Played:
    """Run a network from the state of a model, with given motions of its ports.

    Parameters
    ----------
    model : SceneModel
        The network, its scheme and period, and its initial state; strings start at rest. The Python
        engine advances it; the compiled one does not change it.
    ports : (steps, p)
        Positions of the ports [m], one row per step; a multiple of `stride` steps.
    pushes : (steps, f), optional
        External forces on `network.forced` [N].
    engine : str
        `compiled` (numba), or `python`: the live steps, with identical results, some hundred times
        slower.
    stride : int
        Steps per row.
    seconds : float
        CPU time after which the Python engine stops: fewer rows then.

    Raises
    ------
    ConfigError
        There is no such engine, or numba is not installed.
    """
    ports = np.ascontiguousarray(ports, np.float64)
    if pushes is None:
        pushes = np.zeros((len(ports), len(model.network.forced)))
    pushes = np.ascontiguousarray(pushes, np.float64)
    if engine == "python":
        return _live(model, ports, pushes, stride, seconds)
    if engine != "compiled":
        raise ConfigError(f"unknown engine {engine!r}; engines: {', '.join(ENGINES)}")
    if isinstance(model, Model3d):
        from tautwave_scenes.simulation.ticking3d import CompiledModel3d

        fast = CompiledModel3d(model.network, model.scheme, model.period)
        fast.take_state(model)
        return _live(fast, ports, pushes, stride, seconds)
    scheme = SCHEMES[model.scheme]
    arrays, lines = as_arrays(model.arrays), lines_of(model.network)
    flows = flows_of(model)
    forced = np.array([model.compiled.masses.index(n) for n in model.network.forced], np.int64)
    rows = len(ports) // stride
    efforts, places = np.zeros((rows, ports.shape[1])), np.zeros((rows, len(model.compiled.masses)))
    run = compiled_play()
    head = (arrays, lines, flows, scheme, model.period)
    run(*head, ports[:0], forced, pushes[:0], efforts, places, stride)  # loads, or compiles
    began = time.thread_time_ns()
    run(*head, ports, forced, pushes, efforts, places, stride)
    spent = 1e-9 * (time.thread_time_ns() - began)
    if model.scheme == "symplectic":
        pull_links(arrays)  # its account is a step behind
    ledger = take_ledger(arrays)
    for at in range(len(lines.node)):
        ledger = _with_string(ledger, arrays, lines, at, model.period)
    return Played(efforts, places, Ledger(*map(float, ledger)), model.start, spent)


def _live(
    model: SceneModel | Model3d, ports: Floats, pushes: Floats, stride: int, seconds: float
) -> Played:
    """Advance a live model."""
    efforts: list[list[float]] = []
    places: list[list[float]] = []
    given = list(zip(ports.tolist(), pushes.tolist(), strict=True))
    limit_ns = min(1e9 * seconds, 1e18)
    count = len(model.compiled.masses) * (3 if isinstance(model, Model3d) else 1)
    began = time.thread_time_ns()
    for at in range(0, len(given) - stride + 1, stride):
        total = [0.0] * ports.shape[1]
        for where, push in given[at : at + stride]:
            advanced = model.advance(where, push)
            total = [sum_ + one / stride for sum_, one in zip(total, advanced, strict=True)]
        efforts.append(total)
        places.append(list(model.arrays.x[:count]))
        if time.thread_time_ns() - began > limit_ns:
            break
    spent = 1e-9 * (time.thread_time_ns() - began)
    if model.scheme == "symplectic":
        model.residual()  # its account is a step behind
    shape = (len(efforts), -1)
    return Played(
        np.array(efforts, np.float64).reshape(shape),
        np.array(places, np.float64).reshape(shape),
        model.ledger(),
        model.start,
        spent,
    )


def lines_of(network: Network) -> Lines:
    """Return the strings of a network at rest, as arrays."""
    strings = network.strings
    sizes = [size for string in strings for size in (string.near, string.far)]
    halves = len(sizes)
    first = len(network.masses)
    return Lines(
        node=np.arange(first, first + len(strings), dtype=np.int64),
        root=np.array([math.sqrt(2.0 * s.impedance) for s in strings], np.float64),
        size=np.array(sizes, np.int64),
        first=np.array([sum(sizes[:at]) for at in range(halves)], np.int64),
        at=np.zeros(halves, np.int64),
        returns=np.repeat(np.array([s.reflection for s in strings], np.float64), 2),
        gain=np.repeat(np.array([s.smoothing for s in strings], np.float64), 2),
        arriving=np.zeros(halves),
        back=np.zeros(halves),
        state=np.zeros(halves),
        lost=np.zeros(halves),
        out=np.zeros(sum(sizes)),
        home=np.zeros(sum(sizes)),
    )


def flows_of(model: SceneModel) -> Flows:
    """Return the islands of the exact scheme as arrays; none for any other scheme."""
    islands = exact_islands(model.arrays, model.period) if model.scheme == "exact" else ()
    sizes: list[int] = []
    parts: list[int] = []
    change: list[float] = []
    loss: list[float] = []
    for island in islands:
        sizes += [len(island.masses), len(island.ports), len(island.links)]
        sizes += [len(parts), len(change), len(loss)]
        parts += [*island.masses, *island.ports, *island.links]
        change += [value for row in island.change for value in row]
        loss += [value for row in island.loss for value in row]
    longest = max((len(island.loss) for island in islands), default=0)
    return Flows(
        np.array(sizes, np.int64),
        np.array(parts, np.int64),
        np.array(change, np.float64),
        np.array(loss, np.float64),
        np.zeros(longest),
    )


def _with_string(ledger: Ledger, s: Arrays, lines: Lines, at: int, period: float) -> Ledger:
    """Return a ledger in which energy from a string's node counts as stored on its lines."""
    stored = 0.0
    lost = 0.0
    for half in (2 * at, 2 * at + 1):
        waves = slice(lines.first[half], lines.first[half] + lines.size[half])
        waiting = lines.arriving[half] ** 2 + lines.back[half] ** 2
        waiting += np.sum(lines.out[waves] ** 2) + np.sum(lines.home[waves] ** 2)
        stored += 0.5 * period * waiting
        gain = lines.gain[half]
        if gain < 1.0:
            stored += 0.5 * period * (1.0 - gain) / gain * lines.state[half] ** 2
        lost += lines.lost[half]
    node = lines.node[at]
    return ledger._replace(
        stored=ledger.stored + stored,
        lost=ledger.lost - s.dragged[node] + lost,
        pumped=ledger.pumped - s.pumped[node],
    )
