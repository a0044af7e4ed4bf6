"""Cost of a step of a mass-interaction network: the granular scene, and from 1 to 1e4 masses."""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np

from tautwave.bench import compiled
from tautwave.bench.chunks import Cost, Work, costs
from tautwave.bench.result import Goal, Suite, Table, Value
from tautwave_scenes.networks.compiling import as_arrays
from tautwave_scenes.networks.ledger import take_ledger
from tautwave_scenes.networks.live import SceneModel
from tautwave_scenes.networks.network import Link, Mass, Network
from tautwave_scenes.networks.pruning import prune

AUDIO_HZ = 44_100.0
GRAINS = 10
SIZES = (1, 10, 100, 1000, 10_000)
GOALS = {"symplectic": 300.0, "discrete_gradient": 20.0}
Tell = Callable[[str], None]


def silent(_: str) -> None:
    """Say nothing about progress."""


def granular_network(grains: int = GRAINS) -> Network:
    """Return grains between linear springs on the floor and squared ones along a bar."""
    masses = tuple(Mass(f"grain{at}", 1e-3, -0.02 + 2e-4 * at) for at in range(grains))
    links = tuple(
        Link(f"floor{at}", "contact", f"grain{at}", "floor", stiffness=1e4, loss=0.1)
        for at in range(grains)
    ) + tuple(
        Link(f"bar{at}", "contact", "bar", f"grain{at}", stiffness=1e7, exponent=2.0, loss=0.1)
        for at in range(grains)
    )
    return Network(
        masses,
        links,
        ("bar",),
        (("ground", 0.0), ("floor", -0.02)),
        forced=tuple(mass.name for mass in masses),
        gravity=9.81,
    )


def chain_network(masses: int, spare: int = 0) -> Network:
    """Return a chain from a port to the ground, and `spare` masses that no port can feel."""
    names = [f"m{at}" for at in range(masses)]
    ends = ["hand", *names, "ground"]
    links = [
        Link(f"s{at}", "spring", one, two, stiffness=1e4, damping=0.1)
        for at, (one, two) in enumerate(pairwise(ends))
    ]
    lost = [f"x{at}" for at in range(spare)]
    links += [Link(f"{name}s", "spring", name, "ground", stiffness=1e4) for name in lost]
    every = tuple(Mass(name, 1e-2) for name in (*names, *lost))
    return Network(every, tuple(links), ("hand",))


def networks(*, rounds: int = 30, sizes: tuple[int, ...] = SIZES, tell: Tell = silent) -> Suite:
    """Measure the granular scene against real time, and the cost over the number of masses.

    Parameters
    ----------
    rounds : int
        Chunks per figure.
    sizes : tuple of int
        Masses of the chains.
    tell : callable
        Called with the name of each measurement as it starts.
    """
    fast = compiled.has_numba()
    tell("granular scene")
    works: dict[str, Work] = {}
    for scheme in GOALS:
        works[f"live/{scheme}"] = _live(scheme)
        if fast:
            works[f"compiled/{scheme}"] = _compiled(granular_network(), scheme, grains=True)
    found = costs(works, rounds)
    tables = [_granular_table(found)]
    goals = [
        Goal(
            f"granular scene, {scheme}, compiled",
            least,
            "times real time",
            1e9 / AUDIO_HZ / found[f"compiled/{scheme}"].median_ns if fast else None,
            at_least=True,
            why_not="" if fast else compiled.NO_NUMBA,
        )
        for scheme, least in GOALS.items()
    ]
    if fast:
        tell("from 1 to 1e4 masses")
        chains = {str(size): _compiled(chain_network(size), "symplectic") for size in sizes}
        chains["10, of 10 010"] = _compiled(prune(chain_network(10, 10_000)).network, "symplectic")
        spent = costs(chains, rounds)
        tables.append(_size_table(spent))
        per = [spent[str(size)].median_ns / size for size in sizes if size >= 100]
        goals.append(
            Goal(
                "cost per mass, greatest over least from 100 to 1e4 masses",
                2.0,
                "",
                max(per) / min(per) if per else None,
            )
        )
    return Suite("networks", tables, goals)


def _motion(rows: int) -> tuple[Any, Any]:
    """Return a bar that comes down on the grains, and noise that shakes them."""
    time_s = np.arange(rows) / AUDIO_HZ
    bar = -0.012 + 0.006 * np.sin(2.0 * np.pi * 2.0 * time_s)
    push = 0.3 * np.random.default_rng(1).standard_normal((rows, GRAINS))
    return bar[:, None].copy(), push


def _live(scheme: str) -> Work:
    bar, push = _motion(int(AUDIO_HZ))
    model = SceneModel(granular_network(), scheme, 1.0 / AUDIO_HZ)
    model.reset([float(bar[0, 0])])
    rows = list(zip(bar.tolist(), push.tolist(), strict=True))
    at = 0

    def work(n: int) -> float:
        nonlocal at
        began = time.thread_time_ns()
        for _ in range(n):
            model.advance(*rows[at])
            at = (at + 1) % len(rows)
        return (time.thread_time_ns() - began) * 1e-9

    return work


def _compiled(network: Network, scheme: str, *, grains: bool = False) -> Work:
    from tautwave_scenes.simulation import playing

    rows = int(AUDIO_HZ)
    bar, push = _motion(rows)
    if not grains:
        bar, push = 1e-3 * (bar - bar[0]), np.zeros((rows, 0))
    model = SceneModel(network, scheme, 1.0 / AUDIO_HZ)
    model.reset([float(bar[0, 0])])
    arrays = as_arrays(model.arrays)
    forced = np.arange(len(network.forced), dtype=np.int64)
    kept = np.zeros((1, 1)), np.zeros((1, len(model.compiled.masses)))  # of the last step
    run, number = playing.compiled_play(), playing.SCHEMES[scheme]
    head = (arrays, playing.lines_of(network), playing.flows_of(model), number, model.period)
    run(*head, bar[:1], forced, push[:1], *kept, 1)
    at = 0

    def work(n: int) -> float:
        nonlocal at
        left, spent = n, 0
        while left:
            to = min(at + left, rows)
            part = bar[at:to], forced, push[at:to], *kept, to - at
            began = time.thread_time_ns()
            run(*head, *part)
            spent += time.thread_time_ns() - began
            left -= to - at
            at = to % rows
        if not np.isfinite(take_ledger(arrays).kinetic):
            raise ArithmeticError("the scene is not finite")
        return spent * 1e-9

    return work


def _granular_table(found: dict[str, Cost]) -> Table:
    rows: list[list[Value]] = []
    for name, cost in found.items():
        engine, _, scheme = name.partition("/")
        times = 1e9 / AUDIO_HZ / cost.median_ns
        rows.append([scheme, engine, cost.median_ns, cost.best_ns, times])
    return Table(
        "Granular scene: ten grains, a moving bar, noise on every grain, 44.1 kHz",
        "One step with its energy books, in flight and in contact as it comes; live is plain "
        "Python, compiled the same source by numba. CPU time in chunks of 1 ms between two "
        "calibrations, chunks on a slowed core left out.",
        ("scheme", "engine", "step_ns", "best_ns", "times_real_time"),
        rows,
    )


def _size_table(spent: dict[str, Cost]) -> Table:
    rows: list[list[Value]] = []
    for name, cost in spent.items():
        masses = int(name.partition(",")[0])
        rows.append([name, cost.median_ns, cost.median_ns / masses])
    return Table(
        "Chain of springs and dampers under a port, symplectic, compiled",
        "One step with its energy books. The last row is a chain of 10 with 10 000 masses that no "
        "port can feel: they are pruned before it runs.",
        ("masses", "step_ns", "per_mass_ns"),
        rows,
    )
