"""From a rig's keys to what takes friction and inertia of a device off the hand; SI."""

from __future__ import annotations

import math

from tautwave.allowance import AxisAllowance
from tautwave.analysis.claim import DEVIATIONS
from tautwave.config import Axis
from tautwave.contracts import CoupledAxis
from tautwave.laws.account import AccountParams, planned_share
from tautwave.laws.compensation import (
    NO_COMPENSATION,
    NO_INERTIA,
    CompensationParams,
    InertiaParams,
    inertia_gain,
)
from tautwave.laws.observer import observer_params

STILL = 1e-3
"""Least velocity from which on Coulomb friction is compensated in full [rad/s or m/s]."""

SLOWEST = 0.99
"""Greatest pole: a memory of a hundred periods."""


def compensation_params(axis: Axis, allowance: AxisAllowance) -> CompensationParams:
    """Return what of an axis' friction its motor takes off; Coulomb in full above the noise."""
    keys = axis.compensation
    if keys is None:
        return NO_COMPENSATION
    period = allowance.period
    noise = (axis.position_noise + axis.encoder_quantum) / period
    gain = period / (period + axis.velocity_filter_s)
    return CompensationParams(
        coulomb=allowance.compensated_coulomb,
        viscous=allowance.compensated_damping,
        soft=max(2.0 * gain * noise, STILL),
    )


def inertia_params(axis: Axis, known: CoupledAxis, most: float, paying: float) -> InertiaParams:
    """Return what takes inertia off an axis, and its account.

    The motor alone accelerates the device by at most F_max / m: the share of its inertia that is
    taken off asks for at most that share of F_max, `most` [N m or N]; `paying` is the friction that
    pays for it [N m or N].
    """
    keys = axis.compensation
    if keys is None or keys.inertia == 0.0:
        return NO_INERTIA
    assert axis.inertia is not None
    period, mass, lower = known.period, axis.inertia.value, axis.inertia.lower
    taken = keys.inertia * lower
    pole = min(SLOWEST, math.exp(-2.0 * math.pi * keys.inertia_hz * period))
    observer = observer_params(period, mass, pole)
    gain = inertia_gain(mass, taken)
    late = known.delay + (1 if known.late > 0.0 else 0)
    reserve = keys.inertia_reserve
    if reserve is None:
        reserve = 0.5 * taken * known.velocity_limit**2
    follows = known.noise_lags[0] if known.noise_lags else 0.0
    variance = axis.position_noise**2 * (1.0 - follows) + axis.encoder_quantum**2 / 12.0
    account = AccountParams(
        reserve=reserve,
        debt=(most * (1 + late) * period) ** 2 / lower,
        least=reserve,
        mark=reserve,
        full=reserve,
        capacity=reserve,
        income=-gain * observer.disturbance * variance,
        share=planned_share(late),
        level_damping=0.0,
        edge=lower / period,
    )
    play = 0.5 * axis.encoder_quantum + DEVIATIONS * axis.position_noise
    return InertiaParams(observer, gain, most, paying, play, account)
