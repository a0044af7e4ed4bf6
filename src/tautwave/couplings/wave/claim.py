"""What an end of a wave pair may give out, in joules known before the run.

Two lines. *Seen*: as the encoder sees it, for any device, hand, noise and colour, 2 E0 + W + P t.
*True*: if the declared noise is true. E0 is the reserve, W what commands under way can give within
the limits until the guard has acted, P the leak. The true energy differs from the seen one by
sum F_k (n[k+1] - n[k]): what noise can feign of income, P+ t, a martingale of which z deviations
are counted, and the boundary. The sum of effort changes is bounded by `effort_rate_limit`. In a
stop F = B (y[k] - y[k-1]) / T instead, n periods late: |conj(G) (e^(j theta) - 1)| <= 4 B / T, so
any colour feigns at most 4 B / T**2 of the error's variance in watts while it lasts.

W is what acts between the last sample at which the tank was in order and the effort's end. The axis
stops after `missing_limit` periods without a sample, skipped slots included, or at a sample; before
the last of them a host may stall for `overrun_limit` slots more. With the command delay that is
`blind` periods, in which the held effort may drive the device beyond its velocity limit; and the
ramp on which `effort_rate_limit` takes the effort away. Against a local wall on the same axis the
port's share may be the limit and the wall's effort (the *true* line is then of both). A longer
stall is left to the drive's watchdog. W is lost once only, below the reserve twice: an
overdrawn port sends no effort in a stop, so that the claim holds to the last command.

One engagement: pairs engage once in a run, and nothing but what comes in fills the tank again. A
device faster than its velocity limit was hit: the work of the motor in these periods is a blow,
judged by what was measured (`report.ends`). In a gap between samples with commands under way, or
where commands act a fraction of a period late, the encoder does not show in which period the device
moved: the recorded `uncertainty` stands beside both lines.

An encoder that is not linear reads dy = (1 + e) dx, |e| <= `encoder_nonlinearity`; what of F dx it
hides is F (dy - dx), at most e / (1 - e) of the energy that passes to and fro. No run can see it.

An axis that takes velocity stops at once and is driven by nothing but its command; the greatest
effort that it meets is believed to be its `effort_limit`. What its effort did between two samples
is not seen: there the claim is of energy as encoder and force sensor see it.

Source: derived here; see `tautwave.laws.port` and `analysis.wave_port.sensor_noise`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from tautwave.config import Rig, local_wall
from tautwave.couplings.wave.from_keys import (
    declared_noise,
    observer_of,
    port_impedance,
    servo_port,
)
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
    m/s]; wall: greatest effort of a wall on the same axis [N m or N]; period T [s]; blind: periods
    whose effort acts before the guard can have stopped it; mass: lower bound [kg m**2 or kg];
    deviation, quantum, nonlinearity of the encoder [rad or m, 1]; stop_damping [N m s/rad];
    release: how long a stop lasts [s]; kinetic: energy at the velocity limit [J].
    """

    reserve: float
    leak: float
    feigned: float
    effort: float
    rate: float
    velocity: float
    wall: float
    period: float
    blind: float
    mass: float
    deviation: float
    quantum: float
    nonlinearity: float
    stop_damping: float
    release: float
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
        fade = self.effort / self.rate  # of a stop, which begins at the speed that was driven
        fastest = self.velocity + self.effort * unseen / self.mass
        ramp = 0.5 * fastest * fade + 0.125 * self.effort * fade * fade / self.mass
        return (self.effort + self.wall) * (way + driven + ramp)

    def seen(self, seconds: float) -> float:
        """Return the bound on what the encoder sees of the energy given out [J]."""
        return 2.0 * self.reserve + self.under_way + self.leak * seconds

    def true(self, seconds: float) -> float:
        """Return the bound on the energy given out [J] if the declared noise is true."""
        step = min(self.rate * self.period, 2.0 * self.effort)
        change = step * math.sqrt(seconds / self.period)
        error = self.deviation + 0.5 * self.quantum
        drawn = DEVIATIONS * self.deviation * change + 2.0 * DEVIATIONS * error * self.effort
        return self.seen(seconds) + self.feigned * seconds + drawn + self.stopping

    @property
    def stopping(self) -> float:
        """Return what noise can feign of income while the stop's own damping acts [J]."""
        variance = self.deviation**2 + 0.25 * self.quantum**2
        return 4.0 * self.stop_damping * variance / self.period**2 * self.release

    def hidden(self, passed: float) -> float:
        """Return what the encoder's nonlinearity hides of the energy `passed` to and fro [J]."""
        return self.nonlinearity / (1.0 - self.nonlinearity) * passed

    @property
    def strongest(self) -> float:
        """Return the greatest power that can pass within the limits [W]."""
        return self.effort * self.velocity


def claim_of(rig: Rig, axis_name: str, delays: Delays) -> Claim | str:
    """Return what the port of an axis may give out, or the key without which nothing bounds it."""
    side = axis_name.split(".")[0]
    axis, pair = rig.axes[axis_name], rig.coupling.pairs[axis_name.split(".")[1]]
    assert isinstance(pair, WavePair)
    for key in ("velocity_limit", "effort_rate_limit"):
        if getattr(axis, key) is None and (axis.inertia is not None or key == "velocity_limit"):
            return key
    known = coupled_axis(rig, axis_name, delays[axis_name])
    blind = (
        known.delay
        + known.late
        + rig.loop.missing_limit
        + math.ceil(rig.loop.overrun_limit / rig.axis_divisor(axis_name))
    )
    wall = 0.0 if local_wall(rig, axis_name) is None else axis.effort_limit
    if axis.inertia is None:
        port = servo_port(pair, side, known)
        return Claim(
            reserve=port.reserve,
            leak=port.leak / port.period,
            feigned=0.0,
            effort=axis.effort_limit,
            rate=math.inf,
            velocity=known.velocity_limit,
            wall=wall,
            period=known.period,
            blind=blind,
            mass=math.inf,
            deviation=axis.position_noise,
            quantum=axis.encoder_quantum,
            nonlinearity=axis.encoder_nonlinearity,
            stop_damping=0.0,
            release=0.0,
            kinetic=0.0,
        )
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
        wall=wall,
        period=known.period,
        blind=blind,
        mass=axis.inertia.lower,
        deviation=axis.position_noise,
        quantum=axis.encoder_quantum,
        nonlinearity=axis.encoder_nonlinearity,
        stop_damping=axis.damping.lower,
        release=rig.coupling.release_ramp_s,
        kinetic=0.5 * axis.inertia.value * known.velocity_limit**2,
    )


def claimed_joules(rig: Rig, axis_name: str, delays: Delays) -> float:
    """Return what an end may give out in a run, as its encoder sees it [J]; inf: no claim."""
    claim = claim_of(rig, axis_name, delays)
    return claim.seen(rig.duration_s) if isinstance(claim, Claim) else math.inf


def claimed_sentence(axis_name: str, claim: Claim, seconds: float) -> str:
    """Return what an end may give out in a run, as a sentence."""
    seen, true = joules(claim.seen(seconds)), joules(claim.true(seconds))
    moving = ""
    if claim.kinetic > 0.0:
        moving = f"; at its velocity limit the device has {joules(claim.kinetic)}"
    return (
        f"{axis_name} port: whatever moves it, in {seconds:g} s it gives out at most {seen} as "
        f"its encoder sees it (reserve {joules(claim.reserve)} twice, {joules(claim.under_way)} "
        f"under way, {1e3 * claim.leak:.3g} mW), {true} in fact, if the noise is as "
        f"declared{moving}."
    )


def joules(value: float) -> str:
    """Return an energy [J] with its unit."""
    for factor, unit in ((1.0, "J"), (1e-3, "mJ"), (1e-6, "uJ")):
        if value >= factor:
            return f"{value / factor:.3g} {unit}"
    return f"{value / 1e-9:.3g} nJ"
