"""One end, and a pair of ends, of the observed port on devices of any kind; compiled, no product.

Only the laws are the product's; devices, line and limits are written out here a second time.
"""

from __future__ import annotations

import functools
import math
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from tautwave.laws import limit, observer, ramp
from tautwave.laws import port as port_law
from tautwave.laws.observer import ObserverParams, observer_params, plain_observer
from tautwave.laws.port import PortParams, port_params, port_reserve, recovery_params
from tautwave.laws.wave_filter import filter_gain

PERIOD = 0.5e-3
MASS = 1.1e-3
"""Lower bound of the bench's inertia [kg m**2]."""


class Ends(NamedTuple):
    """Constants of a port with its observer and whole periods of command delay."""

    port: PortParams
    observer: ObserverParams
    delay: int


def ends(
    impedance: float = 0.05,
    pole: float | None = 0.5,
    *,
    delay: int = 0,
    corner: float = 200.0,
    fastest: float = 15.0,
    leak: float = 0.0,
    mass: float = MASS,
    matched: bool = False,
    friction: float = 0.0,
) -> Ends:
    """Return a port at 2 kHz; `pole` None: without an observer; `leak` in W.

    `friction` [N m]: the most by which it recovers.
    """
    seen = plain_observer(PERIOD, mass) if pole is None else observer_params(PERIOD, mass, pole)
    reserve = port_reserve(impedance, PERIOD, delay, seen.velocity * PERIOD, fastest)
    port = port_params(
        PERIOD,
        impedance,
        mass,
        delay=delay,
        matched=matched,
        filter_gain=filter_gain(corner, PERIOD),
        reserve=reserve,
        leak=leak * PERIOD,
    )
    if friction > 0.0:
        found = recovery_params(
            PERIOD,
            mass,
            delay=delay,
            friction=friction,
            noise=0.0,
            quantum=0.0,
            gap=1e-4,
            reserve=reserve,
        )
        port = port._replace(recovery=found)
    return Ends(port, seen, delay)


@functools.cache
def compiled() -> Any:
    """Return `attack` and `pair`, compiled with the laws."""
    from numba import njit
    from numba.extending import register_jitable

    for function in (
        *(limit.clamp, limit.truncate, limit.share_effort),
        *(observer.observer_gains, observer.observe),
        *(port_law.repayment, port_law.port_brake, ramp.ramp_bound, ramp.ramped_effort),
        *(port_law.port_effort, port_law.port_bounded, port_law.port_close, port_law.port_repeat),
        port_law.recovery_friction,
        *(_move, _quantised),
    ):
        register_jitable(function)
    return SimpleNamespace(attack=njit(_attack), pair=njit(_pair))


class Attack(NamedTuple):
    """What moves a port, and its limits; arrays by slot.

    most, step [N m, per period], quantum of the effort; braking: damping of a stop; fastest: what
    the guard allows [rad/s]. A device of `mass` is moved by `moves` as efforts [N m]; without one
    they are ways [rad], and positive ones give way to the effort. Of its own leaving wave `back`
    returns after `line` slots. `noise` [rad] is on the samples, `walls` [N m] on the same motor.
    """

    most: float
    step: float
    quantum: float
    braking: float
    fastest: float
    mass: float
    damping: float
    spring: float
    back: float
    line: int
    moves: Any
    waves: Any
    valid: Any
    noise: Any
    walls: Any
    stops: bool


def _attack(port: Any, seen: Any, n: int, a: Any) -> tuple[float, bool, int]:
    """One end against an adversary or on a device; a port below the floor stops and brakes.

    Returns the most that it gave out in any window as its encoder sees it, blows apart [J], whether
    it stopped, and in how many slots friction helped it. Efforts: columns port, total; what is on
    its way still acts.
    """
    period = port.period
    account, gap, filtered = port.reserve, 0.0, 0.0
    x = speed = at = velocity = outside = sample = given = worst = lowest = last = wanted = 0.0
    efforts, totals = np.zeros(n + 1), np.zeros(n + 1)
    arrived, cuts = np.zeros(n + 1), np.zeros(n + 1)
    ring = np.zeros(a.line + 1)
    count = port_sum = total_sum = wave_sum = wave_energy = was_cut = 0.0
    stopped, helped, smooth = False, 0, 0.0
    for k in range(len(a.moves)):
        effort, total, wave = efforts[0], totals[0], arrived[0]
        if a.mass > 0.0:
            x, speed = _move(x, speed, a.moves[k] - total, a.mass, a.damping, a.spring, 0.0)
        elif effort > 0.0:
            x -= a.moves[k]
        else:
            x += a.moves[k]
        given -= 0.5 * period * wave * wave
        count += 1.0
        port_sum += effort
        total_sum += total
        wave_sum += wave
        wave_energy += 0.5 * period * wave * wave
        was_cut += cuts[0]
        leaving = 0.0
        known = a.valid[k]
        fast = False
        if known:
            now = x + a.noise[k]
            moved, span = now - sample, count * period
            fast = abs(moved) > a.fastest * span
            taken = port_sum / count * moved
            slipped = port.slip * (port_sum / count) * span
            if fast and taken < 0.0:
                given += taken  # a blow, judged by what was measured
            given -= taken
            tracked = moved / span
            known_sum = total_sum if seen.pole < 0.0 else port_sum
            ahead, velocity, outside = observer.observe(
                seen, at, velocity, outside, now, known_sum / count, count
            )
            smooth += port.recovery.smoothing * (velocity - smooth)
            shift = 0.0
            if stopped:
                shift = slipped
            leaving, account, gap, filtered, _, _, _ = port_law.port_close(
                port, account, gap, filtered, moved + shift, ahead - at + shift, count,
                port_sum / count, wave_sum, wave_energy, was_cut > 0.0,
            )  # fmt: skip
            at, sample = ahead, now
            count = port_sum = total_sum = wave_sum = wave_energy = was_cut = 0.0
        elif not stopped:
            leaving, account, gap = port_law.port_repeat(port, account, gap, filtered)
        given += 0.5 * period * leaving * leaving
        if known:
            # In any window: what it began with is the reserve and the filter's at most.
            worst = max(worst, given - lowest)
            lowest = min(lowest, given + port.kept * filtered * filtered)
        if a.stops and (account < -port.reserve or fast):
            stopped = True
        came = a.waves[k] + a.back * ring[0]
        for i in range(a.line):
            ring[i] = ring[i + 1]
        ring[a.line] = leaving
        asked = sent = last
        wall = bounded = 0.0
        if stopped:
            asked = port_law.port_brake(port, account, a.braking * tracked) if known else 0.0
            sent = asked
        elif known:
            pending = 0.0
            for i in range(1, n + 1):
                pending += totals[i] if seen.pole < 0.0 else efforts[i]
            wall = a.walls[k]
            if seen.pole < 0.0:
                pending += 0.5 * wall
            effort = port_law.port_effort(port, account, velocity, outside, pending, came)
            if gap != 0.0:
                free_velocity = velocity + port.ahead * outside - 2.0 * port.half_mobility * pending
                rubs = port_law.recovery_friction(port, account, gap, smooth, free_velocity, effort)
                effort += rubs
                helped += rubs != 0.0
            if account > 0.0 and a.quantum > 0.0:
                effort += limit.clamp(wanted - efforts[n], a.quantum)
            wanted = effort
            asked = effort + wall
            bounded = port_law.port_bounded(port, account, velocity, outside, pending, effort)
            sent = bounded + wall
        if stopped or known:
            sent = limit.clamp(sent, a.most)
            sent = min(max(sent, last - a.step), last + a.step)
            sent = limit.truncate(sent, a.quantum)
        else:
            wall = totals[n] - efforts[n]
        share = sent
        if wall != 0.0:
            share = limit.share_effort(wall, bounded, sent) if known else efforts[n]
        last = sent
        for i in range(n):
            efforts[i], totals[i] = efforts[i + 1], totals[i + 1]
            arrived[i], cuts[i] = arrived[i + 1], cuts[i + 1]
        efforts[n], totals[n], arrived[n] = share, sent, came
        cuts[n] = 1.0 if abs(sent - asked) > 1.001 * a.quantum else 0.0
    return worst, stopped, helped


def _quantised(value: float, step: float) -> float:
    if step > 0.0:
        return float(step * math.floor(value / step + 0.5))
    return value


def _move(
    x: float, v: float, effort: float, mass: float, damping: float, spring: float, rest: float
) -> tuple[float, float]:
    """One period of a damped mass on a spring to `rest`, symplectic in 20 steps."""
    span = 0.5e-3 / 20.0
    for _ in range(20):
        v += span / mass * (effort - damping * v - spring * (x - rest))
        x += span * v
    return x, v


def _pair(
    one: Any,
    two: Any,
    seen: Any,
    n: int,
    samples: int,
    push: Any,
    wall: float,
    noise: Any,
    quantum: float,
    most: float,
    mass: float,
    damping: float,
) -> tuple[Any, Any]:
    """A pair: `push` [N m] on the master, a spring `wall` at the slave; rows, shares of waves cut.

    Columns: both positions, both efforts, both accounts, true energy given by each end [J].
    """
    ports = (one, two)
    period = one.period
    steps = len(push)
    rows = np.zeros((steps, 8))
    x, v, sample = np.zeros(2), np.zeros(2), np.zeros(2)
    at, velocity, outside = np.zeros(2), np.zeros(2), np.zeros(2)
    account = np.array([one.reserve, two.reserve])
    gap, filtered, leaving = np.zeros(2), np.zeros(2), np.zeros(2)
    efforts, arrived, cuts = np.zeros((2, n + 1)), np.zeros((2, n + 1)), np.zeros((2, n + 1))
    line = np.zeros((2, max(samples, 1)))
    given, lost = np.zeros(2), np.zeros(2)
    place = 0
    for k in range(steps):
        for e in range(2):
            port = ports[e]
            effort, wave = efforts[e, 0], arrived[e, 0]
            before = x[e]
            force = push[k] if e == 0 else 0.0
            spring = 0.0 if e == 0 else wall
            x[e], v[e] = _move(x[e], v[e], force - effort, mass, damping, spring, 0.0)
            now = _quantised(x[e] + noise[k, e], quantum)
            ahead, velocity[e], outside[e] = observer.observe(
                seen, at[e], velocity[e], outside[e], now, effort, 1.0
            )
            energy = 0.5 * period * wave * wave
            out, account[e], gap[e], filtered[e], _, _, _ = port_law.port_close(
                port, account[e], gap[e], filtered[e], now - sample[e], ahead - at[e], 1.0, effort,
                wave, energy, cuts[e, 0] > 0.0,
            )  # fmt: skip
            if abs(out) < 0.999999 * abs(filtered[e]):
                lost[e] += 1.0 / steps
            at[e], sample[e], leaving[e] = ahead, now, out
            given[e] -= effort * (x[e] - before) + energy - 0.5 * period * out * out
        for e in range(2):
            came = leaving[1 - e]
            if samples > 0:
                came, line[e, place] = line[e, place], came
            pending = 0.0
            for i in range(1, n + 1):
                pending += efforts[e, i]
            asked = port_law.port_effort(
                ports[e], account[e], velocity[e], outside[e], pending, came
            )
            sent = limit.clamp(asked, most)
            for i in range(n):
                efforts[e, i], arrived[e, i] = efforts[e, i + 1], arrived[e, i + 1]
                cuts[e, i] = cuts[e, i + 1]
            efforts[e, n], arrived[e, n] = sent, came
            cuts[e, n] = 1.0 if sent != asked else 0.0
        if samples > 0:
            place = (place + 1) % samples
        for e in range(2):
            rows[k, e], rows[k, 2 + e] = x[e], efforts[e, 0]
            rows[k, 4 + e], rows[k, 6 + e] = account[e], given[e]
    return rows, lost
