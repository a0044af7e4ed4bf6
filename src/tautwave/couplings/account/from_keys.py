"""From the keys of an account, and beliefs about an axis, to the constants of one end; SI."""

from __future__ import annotations

import math

from tautwave.config.keys.coupling import Account
from tautwave.contracts import CoupledAxis
from tautwave.errors import ConfigError
from tautwave.laws.account import (
    FULL,
    LEADER_SHARE,
    SMOOTHED_S,
    TANK_SHARE,
    AccountParams,
    planned_share,
)

SLOW = 50.0
"""Periods in which the leader's level damping would bring the device alone to rest."""

NOISE_MARGIN = 0.25
"""Share given beyond what noise and steps would take from an effort that acts at once."""

FRICTIONS = 2.0
"""Times its own Coulomb friction, what a leader resists with for a law that leaves it alone."""

MIN_SHARE = 0.01
"""Of its effort limit, what it resists with at least; its friction may not be identified."""


def late_periods(axis: CoupledAxis) -> int:
    """Return the whole periods until a command acts, a fraction rounded up."""
    return axis.delay + (1 if axis.late > 0.0 else 0)


def account_reserve(keys: Account, axis: CoupledAxis) -> float:
    """Return E0 [J]: as given, or by how much predictions can err in one reversal.

    (F_max (1 + n) T)**2 / m: the work of the greatest effort on the way that the device makes under
    an equal one from outside, until a command that takes it into account acts.
    """
    if keys.reserve is not None:
        return keys.reserve
    assert axis.inertia is not None
    impulse = axis.effort_limit * (1 + late_periods(axis)) * axis.period
    return impulse * impulse / axis.inertia


def model_reserve(keys: Account, axis: CoupledAxis) -> Account:
    """Return the keys with the reserve of an end that renders a model, where none is given.

    It hears of a surface when it is already in it, the deeper the longer the delay, and pays for
    pushing the hand out again: it begins with a quarter of a full tank.
    """
    if keys.reserve is not None:
        return keys
    assert axis.inertia is not None
    kinetic = 0.5 * axis.inertia * axis.velocity_limit**2
    full = TANK_SHARE * kinetic if keys.tank is None else keys.tank
    return keys.model_copy(update={"reserve": max(account_reserve(keys, axis), full / FULL)})


def level_resistance(keys: Account, axis: CoupledAxis, *, alone: bool) -> dict[str, float]:
    """Return friction and drag of a leader on its smoothed velocity, as in `AccountParams`.

    By default there are none, but for a law that leaves the leader `alone`: what feeds the follower
    has to come from the hand somehow. Both together damp the device to a fifth of critical at
    least, late as they are.
    """
    assert axis.inertia is not None
    friction = keys.level_friction
    if friction is None:
        least = MIN_SHARE * axis.effort_limit
        friction = max(FRICTIONS * axis.coulomb, least) if alone else 0.0
    if friction == 0.0:
        return {}
    return {
        "friction": friction,
        "slip": max(
            friction * SMOOTHED_S / (4.0 * axis.inertia), 2.0 * axis.position_noise / SMOOTHED_S
        ),
        "drag": 2.0 * axis.inertia / SMOOTHED_S,
    }


def noise_share(axis: CoupledAxis) -> float:
    """Return what noise takes in a period, per its variance and the gain of an effort [1].

    A sample that is off by n enters the effort as G n and the displacement of the period in which
    it acts as -n, if it acts at once: G s**2 (1 - rho_1). An effort that acts later is as likely to
    meet the one as the other.
    """
    if late_periods(axis) > 0:
        return 0.0
    return 1.0 - (axis.noise_lags[0] if axis.noise_lags else 0.0)


def noise_given(axis: CoupledAxis) -> float:
    """Return what is given for noise and steps in a period per gain [rad**2 or m**2]."""
    variance = axis.position_noise**2 + axis.encoder_quantum**2 / 12.0
    return (noise_share(axis) + NOISE_MARGIN) * variance


def account_params(
    keys: Account, side: str, axis: CoupledAxis, gain: float, *, alone: bool = False
) -> AccountParams:
    """Return the constants of one end, in its device's own units.

    `gain`: by how much the law's effort changes with its newest sample [N m/rad or N/m]; `alone`:
    it has no effort at all for where its own device is.

    Raises
    ------
    ConfigError
        The axis has no velocity limit, so the energy of its commands is unbounded.
    """
    if math.isinf(axis.velocity_limit):
        raise ConfigError(
            f"coupling.account: the {side}'s axis has no velocity_limit, and without it the law's "
            "energy output is unbounded; give its maximum safe velocity"
        )
    assert axis.inertia is not None
    reserve = account_reserve(keys, axis)
    ramp = 0.5 * axis.effort_limit / axis.effort_rate
    kinetic = 0.5 * axis.inertia * axis.velocity_limit**2
    full = max(FULL * reserve, TANK_SHARE * kinetic if keys.tank is None else keys.tank)
    leads = side == keys.leader
    slow = axis.inertia / (SLOW * axis.period)
    level, resistance = 0.0, {}
    if leads:
        level = slow if keys.level_damping is None else keys.level_damping
        resistance = level_resistance(keys, axis, alone=alone)
    late = late_periods(axis)
    edge = min(max(abs(gain) * axis.period, slow, level), axis.inertia / axis.period)
    steepest = max(gain + level / axis.period, edge / axis.period)
    return AccountParams(
        reserve=reserve,
        debt=reserve + axis.effort_limit * axis.velocity_limit * ramp,
        least=reserve if leads else max(reserve, keys.kept * full),
        mark=LEADER_SHARE * full if leads else full,
        full=full,
        capacity=full + kinetic,
        income=steepest * noise_given(axis),
        share=planned_share(late),
        level_damping=level,
        edge=edge,
        enough=1.0 if leads else LEADER_SHARE,
        window=round(1.0 / axis.period),
        felt=max(axis.coulomb, MIN_SHARE * axis.effort_limit),
        smoothing=axis.period / (axis.period + SMOOTHED_S),
        gain=steepest,
        **resistance,
    )
