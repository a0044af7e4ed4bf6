"""The allowance of one axis: plain numbers in SI of its device, per the axis' own period.

Effort and its rate. What a carried load needs is kept for it, and half of the rate. Wall,
compensation and coupling share the rest: together they get what the controller's last limit lets
pass. Within it the wall comes first, for a law whose energy is accounted: such a law knows what was
taken from it. A law that is passive by its tuning relies on its effort, so there the wall gets no
more than half, and what is left is the coupling's for certain. A brake and a stop act alone: they
may take all that is shared.

Damping and Coulomb friction are lower bounds and are spent once: what compensation takes off, what
holding a load takes, and what a wall takes are not there for the coupling. At rest neither wall nor
compensation acts, so a brake or a stop may use what they spend; a load is carried all the while.
"""

from __future__ import annotations

import math
from typing import NamedTuple

LOAD_SHARE = 0.5
"""Of an axis' effort rate that its load may take; the rest is shared."""

MAX_WALL_SHARE = 0.5
"""Of what wall and coupling share that a wall gets beside a law which relies on its effort."""


class Device(NamedTuple):
    """What an axis has.

    Attributes
    ----------
    period : float
        From one exchange with the axis to the next [s].
    delay : float
        From a sample until its command acts, with its fraction [s].
    blind : float
        For how long the last command may act unseen before the axis is stopped [s].
    effort, effort_rate, quantum : float
        Greatest effort [N m or N], its greatest rate [N m/s or N/s], its step (0: none).
    damping, coulomb : float
        Sure lower bounds [N m s/rad or N s/m; N m or N].
    velocity : float
        Limit at which the run stops [rad/s or m/s]; inf: none.
    inertia : float
        Sure lower bound [kg m^2 or kg]; inf where the device takes velocities.
    mechanical_range : float, optional
        Between the device's end stops [rad or m]; None: not stated.
    """

    period: float
    delay: float
    blind: float
    effort: float
    effort_rate: float = math.inf
    quantum: float = 0.0
    damping: float = 0.0
    coulomb: float = 0.0
    velocity: float = math.inf
    inertia: float = math.inf
    mechanical_range: float | None = None


class Spending(NamedTuple):
    """What a rig's features ask of an axis; all 0 for a bare one.

    Attributes
    ----------
    carries : bool
        A load is carried, or felt, at the axis.
    load_effort : float
        Effort to be kept for it [N m or N].
    load_damping, load_coulomb : float
        What carrying it takes of the device's damping and, by encoder steps, of its friction.
    compensated_coulomb, compensated_damping : float
        Friction that the motor takes off.
    damper_damping : float
        What a damper in the motor needs of the device's damping, for its own loop.
    lent_damping : float
        What it gives to a wall beyond the damping that is left by that.
    load_lent : float
        What of it carries a load, beside what that takes of the device's own damping.
    paying_coulomb : float
        Friction that pays for the inertia which the motor takes off [N m or N].
    lift_effort : float
        Greatest effort that takes inertia off [N m or N].
    wall_effort, wall_rate : float
        The most that a local wall asks for [N m or N], and how fast it changes [N m/s or N/s].
    wall_limit : float
        The most that it is given, where the rig says so [N m or N]; inf: not said.
    wall_damping : float
        What the wall takes of the device's damping; inf if no damping makes it passive.
    wall_controlled : bool
        A passivity controller replaces the damping where it is too little.
    relies : bool
        The coupling is passive by its tuning only: it relies on the effort that it asks for.
    """

    carries: bool = False
    load_effort: float = 0.0
    load_damping: float = 0.0
    load_coulomb: float = 0.0
    compensated_coulomb: float = 0.0
    compensated_damping: float = 0.0
    damper_damping: float = 0.0
    lent_damping: float = 0.0
    load_lent: float = 0.0
    paying_coulomb: float = 0.0
    lift_effort: float = 0.0
    wall_effort: float = 0.0
    wall_rate: float = 0.0
    wall_limit: float = math.inf
    wall_damping: float = 0.0
    wall_controlled: bool = False
    relies: bool = False


class AxisAllowance(NamedTuple):
    """What an axis has, who spends it, and what is left for the coupling.

    Units and the first fields are those of `Device`. `..._effort`, `..._rate` and `..._step` (of
    the effort in one period) are shares: `load`, `wall`, `compensation` and `coupling` get theirs
    for certain; `shared` is what wall, compensation and coupling get together, the limit that the
    controller applies last. `lift_effort` at most takes inertia off, where there is room.
    `compensated_`, `damper_`, `load_`, `wall_damping` and `_coulomb` are spent; `paying_coulomb`
    pays for the inertia that is taken off; `sampled_damping` is what any sampled law finds at
    least: `free_damping`, and what a damper in the motor lends; `load_lent` of that carries loads.
    """

    period: float
    delay: float
    blind: float
    effort: float
    effort_rate: float
    quantum: float
    load_effort: float
    load_rate: float
    shared_effort: float
    shared_rate: float
    wall_effort: float
    wall_rate: float
    compensation_effort: float
    compensation_rate: float
    lift_effort: float
    coupling_effort: float
    coupling_rate: float
    damping: float
    compensated_damping: float
    damper_damping: float
    sampled_damping: float
    load_lent: float
    load_damping: float
    wall_damping: float
    coulomb: float
    compensated_coulomb: float
    paying_coulomb: float
    load_coulomb: float
    velocity: float
    inertia: float
    mechanical_range: float | None

    @property
    def effort_step(self) -> float:
        """[N m or N] By how much the motor's effort may change in one period."""
        return self.effort_rate * self.period

    @property
    def load_step(self) -> float:
        """[N m or N] The load's share of `effort_step`."""
        return self.load_rate * self.period

    @property
    def shared_step(self) -> float:
        """[N m or N] What of `effort_step` wall, compensation and coupling get together."""
        return self.shared_rate * self.period

    @property
    def free_damping(self) -> float:
        """[N m s/rad or N s/m] Sure damping that compensation and a damper in the motor leave."""
        return max(self.damping - self.compensated_damping - self.damper_damping, 0.0)

    @property
    def loaded_damping(self) -> float:
        """[N m s/rad or N s/m] What wall and compensation leave for carrying the load."""
        return max(self.free_damping - self.wall_damping, 0.0) + self.load_lent

    @property
    def own_load_damping(self) -> float:
        """[N m s/rad or N s/m] What of `load_damping` is the device's own, not its motor's."""
        return max(self.load_damping - self.load_lent, 0.0)

    @property
    def coupling_damping(self) -> float:
        """[N m s/rad or N s/m] What compensation, load and wall leave of the device's damping."""
        return max(self.free_damping - self.wall_damping - self.own_load_damping, 0.0)

    @property
    def brake_damping(self) -> float:
        """[N m s/rad or N s/m] For a brake or a stop, beside which no wall or compensation acts."""
        return max(self.damping - self.own_load_damping - self.damper_damping, 0.0)

    @property
    def loaded_coulomb(self) -> float:
        """[N m or N] Sure Coulomb friction that compensation leaves."""
        return max(self.coulomb - self.compensated_coulomb - self.paying_coulomb, 0.0)

    @property
    def rest_coulomb(self) -> float:
        """[N m or N] Sure friction where neither wall nor compensation acts, beside the load."""
        return max(self.coulomb - self.load_coulomb, 0.0)

    @property
    def coupling_coulomb(self) -> float:
        """[N m or N] Sure Coulomb friction that compensation and load leave to wall or coupling."""
        return max(self.loaded_coulomb - self.load_coulomb, 0.0)

    @property
    def starved(self) -> bool:
        """A load is carried, and neither share of the rate makes one effort step in a period."""
        return self.load_rate > 0.0 and min(self.load_step, self.shared_step) < self.quantum


def share_out(has: Device, asks: Spending) -> AxisAllowance:
    """Return the allowance of an axis.

    Efforts and rates are given out in the order load, wall, compensation, coupling, each what is
    left at most; so shares never add up to more than the motor has. Spent damping and friction are
    what is asked for, also where that is more than there is: then nothing is left, and a
    certificate fails.
    """
    load_effort = min(asks.load_effort, has.effort) if asks.carries else 0.0
    load_rate = LOAD_SHARE * has.effort_rate if asks.carries else 0.0
    shared_effort = has.effort - load_effort
    shared_rate = (1.0 - LOAD_SHARE if asks.carries else 1.0) * has.effort_rate

    most = MAX_WALL_SHARE * shared_effort if asks.relies else shared_effort
    if math.isfinite(asks.wall_limit):
        most = min(asks.wall_limit, shared_effort)
    wall = min(asks.wall_effort, most)
    friction = 0.0
    if asks.compensated_damping > 0.0:
        friction = asks.compensated_damping * has.velocity
    friction += asks.compensated_coulomb
    compensation = min(friction + asks.lift_effort, shared_effort - wall)

    # It changes by twice itself where the motion is reversed between two samples.
    left = shared_rate
    wall_rate = min(asks.wall_rate, wall / has.period, left)
    left = _without(left, wall_rate)
    compensation_rate = min(2.0 * compensation / has.period, left)
    left = _without(left, compensation_rate)

    free = max(has.damping - asks.compensated_damping - asks.damper_damping, 0.0)
    spared = asks.wall_controlled and asks.wall_damping > free
    return AxisAllowance(
        period=has.period,
        delay=has.delay,
        blind=has.blind,
        effort=has.effort,
        effort_rate=has.effort_rate,
        quantum=has.quantum,
        load_effort=load_effort,
        load_rate=load_rate,
        shared_effort=shared_effort,
        shared_rate=shared_rate,
        wall_effort=wall,
        wall_rate=wall_rate,
        compensation_effort=compensation,
        compensation_rate=compensation_rate,
        lift_effort=asks.lift_effort,
        coupling_effort=shared_effort - wall - compensation,
        coupling_rate=left,
        damping=has.damping,
        compensated_damping=asks.compensated_damping,
        damper_damping=asks.damper_damping,
        sampled_damping=free + asks.lent_damping,
        load_lent=asks.load_lent,
        load_damping=asks.load_damping,
        wall_damping=0.0 if spared else asks.wall_damping,
        coulomb=has.coulomb,
        compensated_coulomb=asks.compensated_coulomb,
        paying_coulomb=asks.paying_coulomb,
        load_coulomb=asks.load_coulomb,
        velocity=has.velocity,
        inertia=has.inertia,
        mechanical_range=has.mechanical_range,
    )


def _without(rate: float, taken: float) -> float:
    """Return what is left of a rate, infinite or not."""
    return rate if math.isinf(rate) else rate - taken
