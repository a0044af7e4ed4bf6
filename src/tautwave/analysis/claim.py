"""What an end of a pair may supply, in joules known before the run.

Two lines. *Seen*: as the encoder sees it, for any hand, noise and colour and any device of at least
the stated inertia, 2 E0 + W + P t. *True*: if the declared noise is true. E0 is the reserve, W what
commands under way can give within the limits until the guard has acted, P the leak. The true energy
differs from the seen one by sum F_k (n[k+1] - n[k]): what noise can feign of income, P+ t, a sum of
effort changes times noise of which z deviations are counted, and the boundary. The effort changes
are bounded by `effort_rate_limit`; of noise of spectrum S the sum of c_k n_k has at most max S
times the variance that it has of white noise (an undeclared colour is believed to have as many lags
as one may declare). In a stop F = B (y[k] - y[k-1]) / T instead, n periods late: |conj(G) (e^(j
theta) - 1)| <= 4 B / T, so any colour feigns at most 4 B / T**2 of the error's variance in watts
while it lasts.

W is what acts between the last sample at which the tank was in order and the effort's end. The axis
stops after `missing_limit` periods without a sample, skipped slots included, or at a sample; before
the last of them a host may stall for `overrun_limit` slots more. With the command delay that is
`blind` periods, in which the held effort may drive the device beyond its velocity limit; and the
ramp on which `effort_rate_limit` takes the effort away. What an impulse I gives a device that it
drives from a velocity v on is v I + I**2 / 2m, whenever it acts; the ramp goes by slots and not by
cycles (`controller.braking.brake_axis`), so that stalls within it, none longer than the one that is
counted already, hold no more than F (blind T + ramp / 2). Against a local wall on the same axis the
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

An axis that takes velocity stops at once and is driven by nothing but its command. It meets its
`effort_limit` at most while it is measured; unseen, its command may press it further into a spring,
of at most `environment_stiffness_upper`, whose energy counts in W. What its effort did between two
samples is not seen: there the claim is of energy as encoder and force sensor see it.

Source: derived here; see `tautwave.laws.port` and `analysis.wave_port.sensor_noise`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

DEVIATIONS = 5.0
"""z of the martingale term: one end in millions exceeds it."""


class Claim(NamedTuple):
    """Of one end, SI of the device.

    reserve E0 [J]; leak, feigned [W]; effort, rate, velocity limits [N m, N m/s, rad/s or N, N/s,
    m/s]; wall: greatest effort of a wall on the same axis [N m or N]; period T [s]; blind: periods
    whose effort acts before the guard can have stopped it; mass: lower bound [kg m**2 or kg];
    deviation, quantum, nonlinearity of the encoder [rad or m, 1]; peak: greatest spectrum of its
    noise over the mean [1]; stop_damping [N m s/rad];
    release: how long a stop lasts [s]; kinetic: energy at the velocity limit [J]; lag: of the leak,
    what is for an observer's lag, and steps: for the drive's effort steps, not for noise [W];
    spring: the stiffest that an axis that takes velocity may be driven into [N m/rad or N/m].
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
    peak: float
    quantum: float
    nonlinearity: float
    stop_damping: float
    release: float
    kinetic: float
    lag: float = 0.0
    steps: float = 0.0
    spring: float = 0.0

    @property
    def sample_error(self) -> float:
        """Return what one sample may be off, nbar [rad or m]."""
        return 0.5 * self.quantum + DEVIATIONS * self.deviation

    @property
    def under_way(self) -> float:
        """Return W [J]."""
        held = self.blind * self.period + 0.5 * self.effort / self.rate  # and its ramp
        driven = 0.5 * self.effort * held * held / self.mass
        feigned = 2.0 * self.blind * self.sample_error
        pressed = 0.5 * self.spring * (self.velocity * held) ** 2
        return (self.effort + self.wall) * (self.velocity * held + driven + feigned) + pressed

    def seen(self, seconds: float) -> float:
        """Return the bound on what the encoder sees of the energy given out [J]."""
        return 2.0 * self.reserve + self.under_way + self.leak * seconds

    def true(self, seconds: float) -> float:
        """Return the bound on the energy given out [J] if the declared noise is true."""
        step = min(self.rate * self.period, 2.0 * self.effort)
        changes = math.hypot(step * math.sqrt(seconds / self.period), self.effort)  # and a stop's
        walk = DEVIATIONS * self.deviation * math.sqrt(self.peak) * changes
        error = self.deviation + 0.5 * self.quantum
        drawn = walk + 2.0 * DEVIATIONS * error * self.effort
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


def short(ratio: float) -> str:
    """Return a ratio with two digits, or as a whole number."""
    if 0.995 <= ratio < 9.95:
        return f"{ratio:.1f}"
    if ratio >= 1e6:
        return f"{ratio:.2g}"
    return f"{ratio:.2g}" if ratio < 100.0 else f"{ratio:,.0f}"


def joules(value: float) -> str:
    """Return an energy [J] with its unit."""
    for factor, unit in ((1e6, "MJ"), (1e3, "kJ"), (1.0, "J"), (1e-3, "mJ"), (1e-6, "uJ")):
        if value >= factor:
            return f"{value / factor:.3g} {unit}"
    return f"{value / 1e-9:.3g} nJ"


def watts(value: float) -> str:
    """Return a power [W] with its unit."""
    return joules(value).replace("J", "W")
