"""Adversaries of the claim for a stalled host: an integrator of its own around `Stepper`.

Of tautwave it imports nothing else, so that laws, limits and books are those of a run while the
devices are none of ours: both levers are carried along a path, then the host stalls, the drive
holds what it was sent last, and the master's lever is let go: a mass of `inertia.lower` without
friction, or one that a hand drives along with the effort, at the velocity limit.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from tautwave import load_rig
from tautwave.errors import TautwaveError
from tautwave.simulation.stepper import Stepper

MASTER, SLAVE = "master.lever", "slave.lever"
PRESS_S, EVEN_S = 0.15, 0.006


class Stalled(NamedTuple):
    """What came of a stall: the effort that was held [N m], the velocity along it [rad/s] at its
    start, and what the motor then gave a lever let go, and one driven along [J]."""

    effort: float
    along: float
    let_go: float
    driven: float


def load(path: Any, *changes: str) -> Any:
    """Return a rig."""
    return load_rig(path, changes)


def carried(
    rig: Any, stepper: Stepper, *, speed: float, apart: float, side: int, dive: float = 0.0
) -> tuple[float, float]:
    """Press both levers `apart` [rad] and carry them; return the master's place and its effort.

    They are pressed at rest, then carried faster and faster in the direction `side` of the master's
    effort, at last evenly: the velocity [rad/s] is known well. `dive`: they come from there [rad].
    """
    engaged = rig.coupling.engage_ramp_s + 0.02
    run_up = 0.35 if speed else 0.0
    ramp = 2.0 * run_up / speed if speed else 0.0
    start = -0.5 * run_up * side
    time, push, place = 0.0, 0.0, 0.0
    while time < engaged + PRESS_S + ramp + (EVEN_S if speed else 0.0):
        pressed = apart * min(1.0, time / engaged)
        since = min(max(0.0, time - engaged - PRESS_S), ramp)
        even = max(0.0, time - engaged - PRESS_S - ramp)
        way = (0.5 * speed / ramp * since * since if ramp else 0.0) + speed * even
        way += dive * max(0.0, min(1.0, (engaged + 0.7 * PRESS_S - time) / (0.7 * PRESS_S)))
        place = start + side * way - side * pressed
        push = stepper.step({MASTER: place, SLAVE: start + side * way})[MASTER]
        time += stepper.period_s
    return place, push


def stall(
    rig: Any, gap_s: float, *, speed: float, apart: float, side: int = 1, dive: float = 0.0
) -> Stalled:
    """Carry both levers, and let go of the master's as the host stalls for `gap_s`."""
    axis = rig.master.axes["lever"]
    mass, rate, limit = axis.inertia.lower, axis.effort_rate_limit, axis.velocity_limit
    with Stepper(rig, outside=("master", "slave"), duration_s=5.0) as stepper:
        _, push = carried(rig, stepper, speed=speed, apart=apart, side=side, dive=dive)
    along = math.copysign(1.0, push) * side * speed
    let_go, driven = (work(abs(push), v, mass, rate, gap_s) for v in (along, limit))
    return Stalled(abs(push), along, let_go, driven)


def prompt(rig: Any, *, speed: float, apart: float, side: int = 1) -> float:
    """Carry both levers and let go of the master's; return what its port gave at most [J].

    From the start to the worst moment, the waves counted, with which the slave's hand pays for most
    of what the master's motor does; the host never misses a sample, and the slave is carried on.
    """
    mass = rig.master.axes["lever"].inertia.lower
    with Stepper(rig, outside=("master", "slave"), duration_s=5.0) as stepper:
        place, push = carried(rig, stepper, speed=speed, apart=apart, side=side)
        period, velocity, slave = stepper.period_s, side * speed, place + side * apart
        try:
            for _ in range(round(0.1 / period)):
                place += velocity * period + 0.5 * push / mass * period * period
                velocity += push / mass * period
                slave += side * speed * period
                push = stepper.step({MASTER: place, SLAVE: slave})[MASTER]
        except TautwaveError:
            pass  # it is too fast now, or at the end of its range: the run ends
        rows = stepper.rows
    return float((-rows["lever.port_master.absorbed"]).max())


def work(effort: float, along: float, mass: float, rate: float, gap_s: float) -> float:
    """Return what an effort, held and then taken away, does on a free mass [J]."""
    done, step = 0.0, 1e-6
    for index in range(round((gap_s + effort / rate) / step)):
        push = min(effort, max(0.0, effort - rate * ((index + 1) * step - gap_s)))
        done += push * (along * step + 0.5 * push / mass * step * step)
        along += push / mass * step
    return done
