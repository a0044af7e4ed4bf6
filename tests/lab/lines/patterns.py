"""Patterns to try a pair on, drawn or chosen, and what becomes of it; SI."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.laws.observer import observer_params
from tautwave.laws.port import port_params, port_reserve
from tautwave.laws.receiver import receiver_params
from tautwave.laws.wave_filter import filter_gain
from tautwave.link.network import network_places
from tautwave.link.receiver import PLACE, ring_size
from tautwave.models import network
from tautwave.models.network import NetworkParams, network_params
from tautwave.simulation.kernel.compiled import cached
from tautwave.simulation.kernel.tables import records_of
from tests.lab.lines import pair, rejected
from tests.lab.lines.pair import BUFFER, HOLD, NULL, PLAY_OUT, End, EndParams, run_pair

Array = npt.NDArray[np.float64]

DAYS = 1024
"""Ticks and slots that a network reaches ahead."""
REFERENCE_NS = 500_000
RESTED = 11.0
"""End of a pattern that is free [s]: a line of 0.1 s rings for seconds by itself."""
LIMIT = 0.5  # N m
NOISE, QUANTUM = 9e-5, 2.094e-5
"""Of the encoders [rad]: white noise and step."""

RECEIVERS = {
    "play-out": (PLAY_OUT, False, 0.0),
    "auto depth": (PLAY_OUT, False, 0.1),
    "newest": (PLAY_OUT, True, 0.0),
    "hold-last": (HOLD, False, 0.0),
    "null packets": (NULL, False, 0.0),
    "fixed buffer": (BUFFER, False, 0.0),
}
"""Receivers by name: which, whether it plays the newest, up to which depth [s] it follows."""


class Pattern(NamedTuple):
    """What a pair is tried on.

    Periods [s] of master and slave, clock offset of the slave [1], both directions of the network,
    wave impedance, play-out depth [s], slots repeated, corner of the wave filter [Hz], energy level
    [J], stiffness and place of the slave's wall, Coulomb friction, white noise of the encoders,
    their step; the master's hand follows a random motion until `rest` and is still until `end` [s];
    with a `push` [rad] it goes there instead, and stays.
    """

    periods: tuple[float, float]
    offset: float
    ways: tuple[NetworkParams, NetworkParams]
    impedance: float
    depth: float
    repeated: int
    corner: float
    level: float
    wall: float
    wall_at: float
    coulomb: float
    noise: float
    quantum: float
    push: float
    rest: float
    end: float
    seed: int


class Outcome(NamedTuple):
    """What became of a pair.

    violations: ticks on which the integers were false; excess [J]: most that came out of a receiver
    beyond what was sent, less its reserve; made [J]: most that both ports gave the devices; rms,
    rest [rad]: tracking error while the hand moves, and at the end; chatter, peak [N m]: standard
    deviation of the master's change of effort, and its greatest effort; force [N m]: its last.
    """

    violations: int
    excess: float
    made: float
    rms: float
    rest: float
    chatter: float
    peak: float
    force: float


def end_params(x: Pattern, side: int, receiver: str) -> EndParams:
    """Return the constants of one end."""
    period, far = x.periods[side], x.periods[1 - side]
    policy, newest, deepest = RECEIVERS[receiver]
    mass = 1.1e-3
    observer = observer_params(period, mass, 0.5)
    reserve = port_reserve(x.impedance, period, 0.0, observer.velocity * period, 15.0)
    # What sensor noise costs the account per period, b (observed velocity's noise)**2: generous,
    # and for the declared noise, whatever is simulated.
    leak = 2.0 * x.impedance * (NOISE**2 + QUANTUM**2 / 12.0) / period
    root = math.sqrt(2.0 * x.impedance)
    constants = receiver_params(
        period,
        sender_period=far,
        depth=x.depth,
        deepest=deepest,
        newest=newest,
        fastest=5.0 * root,
        level=x.level,
    )
    places = max(ring_size(constants), 256)
    size = PLACE * places + network_places(DAYS)
    return EndParams(
        port_params(
            period,
            x.impedance,
            mass,
            filter_gain=filter_gain(x.corner, period),
            drift_time=0.05,
            reserve=reserve,
            leak=leak,
        ),
        observer,
        constants,
        x.ways[side],
        round(period * 1e9 * (1.0 + side * x.offset)),
        1.584e-3 if side == 0 else 1.7e-3,
        2e-3 if side == 0 else 3e-3,
        x.coulomb,
        3.03 if side == 0 else 0.0,
        0.025 if side == 0 else 0.0,
        x.wall if side == 1 else 0.0,
        x.wall_at,
        x.noise,
        x.quantum,
        LIMIT,
        side * size,
        places,
        side * size + PLACE * places,
        DAYS,
        x.repeated,
        policy,
        x.seed,
    )


def hand_motion(x: Pattern) -> Array:
    """Return the hand's reference [rad]: some sines that fade in and out, then stillness."""
    if x.push > 0.0:
        return np.linspace(0.0, x.push, round(0.5e9 / REFERENCE_NS))
    rng = np.random.default_rng((x.seed, 1))
    t = np.arange(0.0, x.rest, 1e-9 * REFERENCE_NS)
    motion = sum(
        rng.uniform(0.05, 0.25) / hz**0.5 * np.sin(2.0 * np.pi * hz * t + rng.uniform(0.0, 6.3))
        for hz in (0.4, 0.9, 1.7, 2.6)
    )
    shape = np.minimum(1.0, np.minimum(t, x.rest - t) / 0.3)
    return np.append(shape * motion, 0.0)


@functools.cache
def compiled_pair() -> Callable[..., int]:
    """Return `run_pair` compiled, or from the cache."""
    return cached(run_pair, more=(rejected, pair))


def run_pattern(
    x: Pattern, receiver: str = "play-out", *, compiled: bool = True
) -> tuple[Outcome, Array]:
    """Run a pattern with a receiver of `RECEIVERS`; return what became of it, and the rows."""
    params = [end_params(x, side, receiver) for side in (0, 1)]
    size = params[1].calendar + network_places(DAYS)
    until_ns = round(x.end * 1e9)
    reference = hand_motion(x)
    noise = np.random.default_rng((x.seed, 2)).standard_normal(8192)
    out = np.zeros(5 * (until_ns // params[0].period_ns + 2))
    if compiled:
        ends: Any = records_of(End, [End(), End()])
        rows = compiled_pair()(
            records_of(EndParams, params), ends, np.zeros(size), reference, REFERENCE_NS, noise,
            until_ns, out,
        )  # fmt: skip
    else:
        ends = [End(), End()]
        table, kept = [0.0] * size, [0.0] * len(out)
        rows = run_pair(
            params, ends, table, reference.tolist(), REFERENCE_NS, noise.tolist(), until_ns, kept
        )
        ends = records_of(End, ends)
        out = np.array(kept)
    seen = out.reshape(-1, 5)[:rows]
    return outcome(x, ends, seen, params), seen


def outcome(x: Pattern, ends: Any, rows: Array, params: list[EndParams]) -> Outcome:
    """Return the figures of a run."""
    period = x.periods[0]
    moving = rows[: round(x.rest / period)]
    resting = rows[-max(1, round(0.2 / period)) :]
    reserve = 2.0**-40 * params[0].receiver.reserve if params[0].policy == PLAY_OUT else 0.0
    return Outcome(
        int(ends["violations"].sum()),
        float(ends["excess"].max()) - reserve,
        float(rows[:, 4].max()),
        float(np.sqrt(np.mean((moving[:, 0] - moving[:, 1]) ** 2))),
        float(np.abs(np.mean(resting[:, 0] - resting[:, 1]))),
        float(np.std(np.diff(rows[:, 2]))),
        float(np.abs(rows[:, 2]).max()),
        float(np.mean(resting[:, 2])),
    )


def draw_way(rng: np.random.Generator) -> NetworkParams:
    """Draw what one direction does."""
    return network_params(
        rng.uniform(0.0, 0.1),
        jitter=rng.uniform(0.0, 0.05) * rng.integers(0, 2),
        kind=int(rng.integers(network.UNIFORM, network.SPIKES + 1)),
        loss=rng.uniform(0.0, 0.5) * rng.integers(0, 2),
        burst=float(rng.integers(1, 21)),
        duplicates=rng.uniform(0.0, 0.2) * rng.integers(0, 2),
        reorders=bool(rng.integers(0, 2)),
        outage_at=rng.uniform(0.3, 1.5),
        outage=rng.uniform(0.0, 0.4) * rng.integers(0, 2),
    )


RATES = ((0.5e-3, 0.5e-3), (0.5e-3, 2e-3), (2e-3, 0.5e-3))


def draw_pattern(seed: int) -> Pattern:
    """Draw a pattern of the range that `python -m tests.lab network` states."""
    rng = np.random.default_rng((seed, 0))
    noisy = bool(rng.integers(0, 4))
    drawn = Pattern(
        periods=RATES[int(rng.integers(0, 3))],
        offset=float(rng.uniform(-200e-6, 200e-6) * rng.integers(0, 2)),
        ways=(draw_way(rng), draw_way(rng)),
        impedance=float(rng.uniform(0.02, 0.1)),
        depth=float(rng.choice([0.0, 0.004, 0.02, 0.05])),
        repeated=int(rng.integers(0, 8)),
        corner=float(rng.choice([50.0, 100.0, 200.0])),
        level=float(rng.choice([0.0, 1e-4, 1e-3])),
        wall=float(rng.choice([0.0, 1.0, 8.0, 20.0, 200.0])),
        wall_at=0.05,
        coulomb=float(rng.choice([0.0, 1e-3])),
        noise=NOISE * noisy,
        quantum=QUANTUM * noisy,
        push=0.0,
        rest=1.0,
        end=3.0,
        seed=seed,
    )
    return drawn._replace(end=RESTED) if is_free(drawn) else drawn


def is_free(x: Pattern) -> bool:
    """Return whether nothing keeps both devices apart in the end: no wall, no dry friction."""
    return x.wall == 0.0 and x.coulomb == 0.0


def clean_of(x: Pattern) -> Pattern:
    """Return a pattern on lines that only delay, as much as its networks on average."""
    mean = {network.UNIFORM: 0.5, network.EXPONENTIAL: 1.0, network.SPIKES: 0.02}
    one, two = (
        way._replace(
            delay_ns=way.delay_ns + round(mean[way.jitter] * way.jitter_ns),
            jitter_ns=0,
            begin=0.0,
            duplicates=0.0,
            outage_ns=0,
        )
        for way in x.ways
    )
    return x._replace(ways=(one, two), offset=0.0)
