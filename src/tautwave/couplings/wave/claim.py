"""What an end of an observed pair may give out, in joules known before the run.

Two lines. *Seen*: as the encoder sees it, for any device, hand, noise and colour, 2 E0 + W + P t.
*True*: if the declared noise is true. E0 is the reserve, W what commands under way can give within
the limits until the guard has acted, P the leak. The true energy differs from the seen one by
sum F_k (n[k+1] - n[k]): what noise can feign of income, P+ t, a martingale of which z deviations
are counted, and the boundary. The sum of effort changes is bounded by `effort_rate_limit`.

W is what acts unseen: the command delay, `missing_limit` samples in a row and `overrun_limit` slots
of a stalled host, in which the held effort may drive the device beyond its velocity limit; and the
ramp on which `effort_rate_limit` lets a stop take the effort away. A longer stall is left to the
drive's watchdog, a blow from outside during one is not covered, and the claim ends where a stop
begins.

Source: derived here; see `tautwave.laws.port` and `analysis.wave_port.sensor_noise`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from tautwave.config import Rig
from tautwave.couplings.wave.from_keys import declared_noise, observer_of, port_impedance
from tautwave.couplings.wave.keys import WavePair
from tautwave.laws.port import port_reserve
from tautwave.rig import coupled_axis
from tautwave.types import CommandDelay

Delays = Mapping[str, CommandDelay]

DEVIATIONS = 5.0
"""z of the martingale term: one end in millions exceeds it."""


class Claim(NamedTuple):
    """Of one end, SI of the device.

    reserve E0 [J]; leak, feigned [W]; effort, rate, velocity limits [N m, N m/s, rad/s or N, N/s,
    m/s]; period T [s]; blind: periods whose effort acts before the guard can have stopped it;
    mass: lower bound [kg m**2 or kg]; deviation, quantum of the encoder [rad or m]; kinetic: energy
    at the velocity limit [J].
    """

    reserve: float
    leak: float
    feigned: float
    effort: float
    rate: float
    velocity: float
    period: float
    blind: float
    mass: float
    deviation: float
    quantum: float
    kinetic: float

    @property
    def sample_error(self) -> float:
        """Return what one sample may be off, nbar [rad or m]."""
        return 0.5 * self.quantum + DEVIATIONS * self.deviation

    @property
    def under_way(self) -> float:
        """Return W [J]."""
        unseen = self.blind * self.period
        way = self.velocity * unseen + 2.0 * self.blind * self.sample_error
        driven = 0.5 * self.effort * unseen * unseen / self.mass
        ramp = 0.5 * self.velocity * self.effort / self.rate
        return self.effort * (way + driven + ramp)

    def seen(self, seconds: float) -> float:
        """Return the bound on what the encoder sees of the energy given out [J]."""
        return 2.0 * self.reserve + self.under_way + self.leak * seconds

    def true(self, seconds: float) -> float:
        """Return the bound on the energy given out [J] if the declared noise is true."""
        step = min(self.rate * self.period, 2.0 * self.effort)
        change = step * math.sqrt(seconds / self.period)
        error = self.deviation + 0.5 * self.quantum
        drawn = DEVIATIONS * self.deviation * change + 2.0 * DEVIATIONS * error * self.effort
        return self.seen(seconds) + self.feigned * seconds + drawn


def claim_of(rig: Rig, axis_name: str, delays: Delays) -> Claim | str:
    """Return what the port of an axis may give out, or the key without which nothing bounds it."""
    side = axis_name.split(".")[0]
    axis, pair = rig.axes[axis_name], rig.coupling.pairs[axis_name.split(".")[1]]
    assert isinstance(pair, WavePair)
    assert axis.inertia is not None
    for key in ("velocity_limit", "effort_rate_limit"):
        if getattr(axis, key) is None:
            return key
    known = coupled_axis(rig, axis_name, delays[axis_name])
    observer = observer_of(pair, side, known.period, axis.inertia.lower)
    noise = declared_noise(pair, side, known)
    late = known.delay + known.late
    return Claim(
        reserve=port_reserve(
            port_impedance(pair, side),
            known.period,
            late,
            observer.velocity * known.period,
            known.velocity_limit,
        ),
        leak=noise.lost,
        feigned=noise.gained,
        effort=axis.effort_limit,
        rate=axis.effort_rate_limit or 0.0,
        velocity=known.velocity_limit,
        period=known.period,
        blind=1.0
        + late
        + rig.loop.missing_limit
        + math.ceil(rig.loop.overrun_limit / rig.axis_divisor(axis_name)),
        mass=axis.inertia.lower,
        deviation=axis.position_noise,
        quantum=axis.encoder_quantum,
        kinetic=0.5 * axis.inertia.value * known.velocity_limit**2,
    )


def claimed_joules(rig: Rig, axis_name: str, delays: Delays) -> float:
    """Return what an end may give out in a run, as its encoder sees it [J]; inf: no claim."""
    claim = claim_of(rig, axis_name, delays)
    return claim.seen(rig.duration_s) if isinstance(claim, Claim) else math.inf
