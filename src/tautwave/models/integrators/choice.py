"""Which integrator is the cheapest that meets an error, found by trying each on the worst bounce.

The bounce is that of the plain mass at the greatest speed expected. What a scheme loses at the
edges of a contact depends on where in a step the mass enters and where it leaves: at a step that
divides the contact's time RK4 may look 300 times better than at 1 % more. So entry phases and
neighbouring steps are tried together, and the worst counts. The smooth rest (grip, spring,
friction) is tried against its exact flow. SI of the axis.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tautwave.laws.limit import clamp
from tautwave.models.foam import FoamParams
from tautwave.models.integrators.bounds import (
    contact_slope,
    contact_stiffness_limit,
    greatest_depth,
    greatest_stiffness,
    step_growth,
)
from tautwave.models.integrators.schemes import (
    DISCRETE_GRADIENT,
    DORMAND_PRINCE,
    EXACT,
    IMPLICIT_MIDPOINT,
    RK4,
    SCHEMES,
    SYMPLECTIC_EULER,
    integrate_step,
)
from tautwave.models.linear import linear_flow
from tautwave.models.plant_params import PlantParams

COST_NS = {
    SYMPLECTIC_EULER: 40.0,
    RK4: 90.0,
    IMPLICIT_MIDPOINT: 95.0,
    DISCRETE_GRADIENT: 140.0,
    EXACT: 90.0,
    DORMAND_PRINCE: 1000.0,
}
"""Time of one sub-step, compiled, in ns: rounded figures of `python -m tests.lab workprecision`.
Only their ratios matter. Exact and Dormand-Prince: of a whole step at a contact, at 1e-3."""

MAX_SUBSTEPS = 1024
_PHASES: tuple[float, ...] = (0.07, 0.31, 0.56, 0.83)
_LATTICE = (13, 8)
"""Entry phases times neighbouring steps: (i + 1/2) / 13 of a step, and 8 i modulo 13 likewise."""

_LATTICE_LONG = (5, 2)
_LONG = 400  # steps of a bounce beyond which fewer have to do
_CLIMBS = 2  # rounds of four neighbours of the worst, each half as far as the last
_LONGEST = 5000  # most steps tried; beyond, the error is extrapolated from these
FOUND = 0.75
"""Share of the worst error of a bounce that `bounce_error` finds at least; trials count on it."""

_ORDER = 2.0  # across a contact, where no smoothness helps
_LABELS = {scheme: name for name, scheme in SCHEMES.items()}


class Trial(NamedTuple):
    """One scheme with as many sub-steps as it needs: worst error [1], cost a step [ns].

    `substeps` 0: none was tried, since one would cost too much already.
    """

    scheme: int
    substeps: int
    tolerance: float
    error: float
    cost_ns: float


class Choice(NamedTuple):
    """What was chosen, what else was tried, and why in a sentence."""

    best: Trial
    tried: tuple[Trial, ...]
    why: str


def plain_mass(plant: PlantParams) -> PlantParams:
    """Return the mass alone, without grip, spring, wall and friction [SI]."""
    return PlantParams(plant.mass, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


def bounce_error(plant: PlantParams, foam: FoamParams, speed: float, h: float) -> float:
    """Return the worst error of a bounce by the scheme and sub-steps of `foam`, loop step `h` [s].

    That of the exit speed over the impact's, or of the position after it over speed times contact
    time, whichever is greater; against Dormand-Prince at 1e-11. Over entry phases, and over steps
    with half a step more or less to the contact: of the worst on a fine grid it finds three
    quarters at least (`tests/models/test_schemes_choice.py`).
    """
    if not (foam.stiffness > 0.0 and speed > 0.0):
        return 0.0
    mass = plain_mass(plant)
    near = foam._replace(position=0.0, side=1.0)
    exit_speed, length = exact_bounce(mass, near, speed)
    one = near._replace(substeps=1)
    # A step coarser than the contact cannot tell a good scheme from a lucky one.
    t = h / near.substeps
    if length < 2.0 * t:
        if near.scheme != DORMAND_PRINCE:
            return math.inf
        worst = 0.0
        for phase in _PHASES:
            error = one_bounce(mass, one, speed, t, phase, exit_speed, length)
            if error > worst:
                worst = error
        return worst
    share = 1.0
    if length > _LONGEST * t:
        # Every scheme is of order 1 at least, so extrapolating never understates the error.
        coarse = length / _LONGEST
        if near.scheme != DORMAND_PRINCE:
            share = t / coarse
        t = coarse
    count = length / t
    points, turns = _LATTICE
    if count > _LONG:
        points, turns = _LATTICE_LONG
    worst = 0.0
    at = (0.0, 0.0)
    for i in range(points):
        phase = (i + 0.5) / points
        more = (turns * i % points + 0.5) / points - 0.5
        error = one_bounce(mass, one, speed, length / (count + more), phase, exit_speed, length)
        if error > worst:
            worst = error
            at = (phase, more)
    far = 1.0 / points
    for _ in range(_CLIMBS):
        middle, steps = at
        for phase, more in (
            (middle + far, steps),
            (middle - far, steps),
            (middle, steps + far),
            (middle, steps - far),
        ):
            t = length / (count + clamp(more, 0.5))
            error = one_bounce(mass, one, speed, t, phase % 1.0, exit_speed, length)
            if error > worst:
                worst = error
                at = (phase % 1.0, clamp(more, 0.5))
        far = 0.5 * far
    return worst * share


def one_bounce(
    mass: PlantParams,
    foam: FoamParams,
    speed: float,
    t: float,
    phase: float,
    exit_speed: float,
    length: float,
) -> float:
    """Return the error of one bounce at the step `t` [s] that begins `phase` of a step before it.

    `exit_speed` and `length` are those of `exact_bounce`.
    """
    steps = int(length / t) + 3
    x = -phase * t * speed
    v = speed
    for _ in range(steps):
        x, v, _, _, _, _, _ = integrate_step(mass, foam, x, v, 0.0, 0.0, 0.0, t)
    after = steps * t - phase * t - length
    gone = math.fabs(x + exit_speed * after) / (speed * length)
    off = math.fabs(v + exit_speed) / speed
    error = math.sqrt(gone * gone + off * off)
    return error if math.isfinite(error) else math.inf


def exact_bounce(plant: PlantParams, foam: FoamParams, speed: float) -> tuple[float, float]:
    """Return exit speed [m/s or rad/s] and length of the contact [s] of a free mass."""
    depth = greatest_depth(plant, foam, speed, 0.0)
    oracle = foam._replace(scheme=DORMAND_PRINCE, tolerance=1e-11, substeps=1)
    # pi/2 sqrt(..): no contact of a mass lasts longer than ten times depth over speed on its way
    # in; on its way out damping makes it slow, so it is looked at again.
    h = 10.0 * depth / speed
    x = 0.0
    v = speed
    t = 0.0
    for _ in range(60):
        x, v, _, _, _, _, _ = integrate_step(plant, oracle, x, v, 0.0, 0.0, 0.0, h)
        t = t + h
        if x <= 0.0 and v < 0.0:
            return -v, t + x / -v
    return math.fabs(v), t


def smooth_error(plant: PlantParams, scheme: int, speed: float, t: float) -> float:
    """Return the error of the motion without contact over its fastest radian [1]; sub-step `t`."""
    stiffness = plant.grip_stiffness + plant.spring_stiffness
    damping = plant.viscous + plant.grip_damping
    rate = math.sqrt(stiffness / plant.mass)
    if damping / plant.mass > rate:
        rate = damping / plant.mass
    if not (rate > 0.0 and speed > 0.0):
        return 0.0
    free = plant._replace(coulomb=0.0, spring_position=0.0)
    none = FoamParams(0.0, 1.0, 0.0, 0.0, 1.0, 1, 0.0, scheme)
    radian = int(1.0 / (rate * t)) + 1
    steps = min(radian, _LONGEST)
    x = 0.0
    v = speed
    for _ in range(steps):
        x, v, _, _, _, _, _ = integrate_step(free, none, x, v, 0.0, 0.0, 0.0, t)
    at, then, _ = linear_flow(stiffness, damping, plant.mass, 0.0, 0.0, 0.0, speed, steps * t)
    error = math.sqrt(((x - at) * rate) ** 2 + (v - then) ** 2) / speed
    return error * (radian / steps)  # it grows with time at least


def try_scheme(
    plant: PlantParams,
    foam: FoamParams,
    scheme: int,
    speed: float,
    h: float,
    max_error: float,
    budget_ns: float,
) -> Trial:
    """Return the fewest sub-steps with which a scheme meets `max_error` [1] within a cost a step.

    A trial that fails has an infinite cost: its error is that of the last number tried.
    """
    cost = COST_NS[scheme]
    if scheme == EXACT:
        return Trial(scheme, 1, 0.0, 0.0, cost)
    one = foam._replace(scheme=scheme, substeps=1)
    error = math.inf
    if scheme == DORMAND_PRINCE:
        tolerance = 0.1 * max_error
        for _ in range(5):
            tolerance = 0.1 * tolerance
            error = bounce_error(plant, one._replace(tolerance=tolerance), speed, h) / FOUND
            if error <= max_error:
                cost = cost * math.pow(1e-3 / tolerance, 1.0 / 6.0)  # as measured
                return Trial(scheme, 1, tolerance, error, cost)
        return Trial(scheme, 1, tolerance, error, math.inf)
    substeps = 1
    last = 0
    while substeps <= MAX_SUBSTEPS and cost * substeps < budget_ns:
        t = h / substeps
        error = math.inf
        if refusal(plant, one, scheme, speed, t) == "":
            error = bounce_error(plant, one._replace(substeps=substeps), speed, h) / FOUND
            smooth = smooth_error(plant, scheme, speed, t)
            if smooth > error:
                error = smooth
            stop = plant.coulomb * t / (plant.mass * speed)
            if stop > error:
                error = stop  # friction turns the motion somewhere in a sub-step
        if error <= max_error:
            return Trial(scheme, substeps, 0.0, error, cost * substeps)
        # Jump nearly as far as the order promises, so that few numbers are tried.
        last = substeps
        doublings = 1
        if math.isfinite(error):
            ratio = math.log(error / max_error) / (_ORDER * math.log(2.0))
            if ratio > 2.0:
                doublings = int(ratio)
        substeps = substeps << doublings
    return Trial(scheme, last, 0.0, error, math.inf)


def refusal(plant: PlantParams, foam: FoamParams, scheme: int, speed: float, t: float) -> str:
    """Return why a scheme cannot hold a rig at the sub-step `t` [s], with numbers; "" if it can."""
    stiffness = plant.grip_stiffness + plant.spring_stiffness
    damping = plant.viscous + plant.grip_damping
    name = _LABELS[scheme]
    if step_growth(scheme, stiffness, damping, plant.mass, t) > 1.0 + 1e-12:
        limit = greatest_stiffness(scheme, damping, plant.mass, t)
        return (
            f"{name} holds a spring of at most {limit:.4g} on {plant.mass:.4g} with damping "
            f"{damping:.4g} at a step of {t:.4g} s, and grip and spring are {stiffness:.4g}"
        )
    depth = greatest_depth(plant, foam, speed, 0.0)
    slope = contact_slope(foam, depth)
    drag = damping + foam.damping + foam.loss * foam.stiffness * math.pow(depth, foam.exponent)
    limit = contact_stiffness_limit(scheme, damping, plant.mass, t)
    if slope > limit:
        return (
            f"{name} holds a contact of at most {limit:.4g} on {plant.mass:.4g} at a step of "
            f"{t:.4g} s, and this one is {slope:.4g} at {depth:.4g} deep, where an impact at "
            f"{speed:.4g} a second ends"
        )
    if step_growth(scheme, stiffness + slope, drag, plant.mass, t) > 1.0 + 1e-12:
        return (
            f"{name} does not hold a contact of {slope:.4g} with damping {drag:.4g} on "
            f"{plant.mass:.4g} at a step of {t:.4g} s"
        )
    return ""


def choose_scheme(
    plant: PlantParams,
    foam: FoamParams,
    speed: float,
    h: float,
    max_error: float,
    linear: bool,
) -> Choice:
    """Return the cheapest scheme that meets `max_error` [1] at the loop step `h` [s], and why.

    Parameters
    ----------
    speed : float
        Greatest speed expected [m/s or rad/s].
    linear : bool
        The surroundings are piecewise linear, so that `exact` applies.
    """
    tried = []
    best = Trial(DORMAND_PRINCE, 1, 1e-14, math.inf, math.inf)
    # The two that meet any error come first: dearer ones need not be tried at all.
    for scheme in (
        EXACT,
        DORMAND_PRINCE,
        SYMPLECTIC_EULER,
        RK4,
        DISCRETE_GRADIENT,
        IMPLICIT_MIDPOINT,
    ):
        if scheme != EXACT or linear:
            trial = try_scheme(plant, foam, scheme, speed, h, max_error, best.cost_ns)
            tried.append(trial)
            if trial.error <= max_error and trial.cost_ns < best.cost_ns:
                best = trial
    others = [
        f"{_LABELS[trial.scheme]} {finding(trial)}"
        for trial in tried
        if trial.scheme != best.scheme
    ]
    steps = "sub-step" if best.substeps == 1 else "sub-steps"
    why = (
        f"{_LABELS[best.scheme]} in {best.substeps} {steps}: worst error {best.error:.2g} <= "
        f"{max_error:g} at about {best.cost_ns:.0f} ns a step; " + ", ".join(others)
    )
    if not best.error <= max_error:
        why = f"nothing meets {max_error:g}; {why}"
    return Choice(best, tuple(tried), why)


def finding(trial: Trial) -> str:
    """Return the outcome of a trial as a phrase [ns]."""
    if math.isfinite(trial.cost_ns):
        return f"needs {trial.substeps} and {trial.cost_ns:.0f} ns"
    if trial.substeps == 0:
        return "costs more even in one"
    if math.isfinite(trial.error):
        return f"has an error of {trial.error:.2g} with {trial.substeps}, more would cost more"
    return f"fails with {trial.substeps}, more would cost more"
