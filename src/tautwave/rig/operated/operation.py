"""From a rig's `operate` block to the constants of its operation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from tautwave.config import Rig
from tautwave.config.keys.operate import Resting
from tautwave.controller.records import AxisParams
from tautwave.laws.rest.alignment import align_law
from tautwave.laws.rest.brake import BrakeParams
from tautwave.rig.allowance.filling import axis_allowance
from tautwave.rig.controller import make_control
from tautwave.rig.operated.brakes import brake_params, quantum_of
from tautwave.rig.scales import scaled
from tautwave.runtime.control import CoupledControl
from tautwave.runtime.operate.constants import Operation
from tautwave.runtime.operate.rest.pull import PullParams
from tautwave.types import CommandDelay

LOOK_HZ = 50.0
"""How often terminal and pipe are looked at."""

UNKNOWN_FRICTION = 0.5
"""Coulomb friction in the budget where the rig has none, as a share of the pull's effort."""

REACH = 0.5
"""Share of `engage_tolerance` to which a slave is brought."""


def operation_of(rig: Rig, plain: CoupledControl, delays: Mapping[str, CommandDelay]) -> Operation:
    """Return the constants of an operated rig [SI]; `plain` is its controller while engaged.

    Raises
    ------
    ValueError
        The rig has no `operate` block.
    """
    if rig.operate is None:
        raise ValueError("the rig has no operate block")
    pulls = {
        k: _pull(rig, rig.sites or rig.operate, name, plain.params[q.slave], q.tolerance)
        for k, (name, q) in enumerate(zip(plain.pair_names, plain.pairs, strict=True))
        if not q.at_engage
    }
    quanta = [quantum_of(rig, name.name) for name in plain.names]
    scales = {1.0: (plain.params, plain.pairs)}
    for factor in rig.operate.scales:
        other = make_control(scaled(rig, factor), delays, plain.run.cycles)
        scales[factor] = (other.params, other.pairs)
    return Operation(pulls, quanta, rig_brakes(rig, plain, delays), scales)


def rig_brakes(
    rig: Rig, plain: CoupledControl, delays: Mapping[str, CommandDelay]
) -> list[BrakeParams | None]:
    """Return what brakes a controller's axes at rest; of two sites each brakes its own."""
    names = [one.name for one in plain.names]
    return [brake_params(rig, name, delays[name]) if name in delays else None for name in names]


def site_pulls(rig: Rig, plain: CoupledControl) -> tuple[Mapping[int, PullParams], Sequence[float]]:
    """Return what brings the slaves of two sites into place, by pair, and by pair how near.

    The second are how far from its place a pair may begin [rad or m, slave]. An axis that takes
    velocities is not pulled.
    """
    assert rig.sites is not None
    pulls, tolerances = {}, []
    for k, (name, q) in enumerate(zip(plain.pair_names, plain.pairs, strict=True)):
        tolerance = min(q.tolerance, rig.sites.place_tolerance * math.fabs(q.ratio))
        tolerances.append(tolerance)
        if plain.params[q.slave].impedance:
            pulls[k] = _pull(rig, rig.sites, name, plain.params[q.slave], tolerance)
    return pulls, tolerances


def _pull(rig: Rig, keys: Resting, name: str, p: AxisParams, tolerance: float) -> PullParams:
    axis = rig.slave.axes[name]
    assert axis.inertia is not None
    period = p.site.period
    delay = CommandDelay(p.delay, p.late * period)
    has = axis_allowance(rig, f"slave.{name}", delay)
    law = align_law(
        has.inertia,
        has.rest_coulomb,
        keys.align_effort_share * p.site.limit.effort,
        min(keys.align_speed, p.site.limit.velocity),
        keys.align_acceleration,
        period,
        period * (p.delay + p.late),
        period * (1.0 / p.site.gain + p.delay + p.late),
        rate=p.site.limit.effort_step / period,
        fastest=p.site.limit.velocity if math.isfinite(p.site.limit.velocity) else 0.0,
        stalled=rig.overrun_limit * rig.period_s,
    )
    reach = REACH * tolerance
    friction = axis.coulomb.value or UNKNOWN_FRICTION * law.effort
    return PullParams(
        law,
        friction,
        axis.damping.value,
        axis.inertia.value,
        reach,
        p.site.limit.position_low,
        p.site.limit.position_high,
    )
