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
counted already, hold no more than F (blind T + ramp / 2). No effort works further than from one end
stop to the other, F S. W is lost once only, below the reserve twice: an overdrawn port sends no
effort in a stop, so that the claim holds to the last command.

It is of one axis, whatever requested the effort: what is sent is limited to F, so that the port and
a local wall beside it give W in a stall together. A wall repays what it gave in a stall before it
gives again (`laws.wall.control_wall`), but the port may be held in the next one: what a wall may
owe is `owed`, which only a run with several stalls can see.

Three numbers of the same sum say what that means to a person: what an axis supplies while its host
is `prompt`, a command delay and a period going by before the next command; in one `stall` of at
most `gap`; and while the host is `dead`, until the watchdog of the drive acts. A bound on the
effort (`laws.ramp.stall_bound`) makes the stall of a device that is `let_go` smaller. It says
nothing of one that is driven along with the effort from outside, and takes W from it.

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

NOTHING = 1e-12
"""[J] Less than this is nothing, also where nothing moved."""

DEVIATIONS = 5.0
"""z of the martingale term: one end in millions exceeds it."""


class Claim(NamedTuple):
    """Of one end, SI of the device.

    reserve E0 [J]; leak, feigned [W]; effort, rate, velocity limits [N m, N m/s, rad/s or N, N/s,
    m/s]; period T [s]; blind: periods whose effort acts before the guard can have stopped it;
    mass: lower bound [kg m**2 or kg];
    deviation, quantum, nonlinearity of the encoder [rad or m, 1]; peak: greatest spectrum of its
    noise over the mean [1]; stop_damping [N m s/rad];
    release: how long a stop lasts [s]; kinetic: energy at the velocity limit [J]; lag: of the leak,
    what is for an observer's lag, and steps: for the drive's effort steps, not for noise [W];
    spring: the stiffest that an axis that takes velocity may be driven into [N m/rad or N/m];
    late: command delay in periods; owed: what a wall on the axis may owe after stalls [J]; travel:
    from one end stop to the other [rad or m], inf: unknown; bounded: what a device let go may gain
    in a stall by the bound on the effort [J], inf: there is none; ramped: effort that a full tank
    lets be built up at the velocity limit, where it falls slowly (`laws.ramp`) [N m or N].
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
    peak: float
    quantum: float
    nonlinearity: float
    stop_damping: float
    release: float
    kinetic: float
    lag: float = 0.0
    steps: float = 0.0
    spring: float = 0.0
    late: float = 0.0
    owed: float = 0.0
    travel: float = math.inf
    bounded: float = math.inf
    ramped: float = math.inf

    @property
    def sample_error(self) -> float:
        """Return what one sample may be off, nbar [rad or m]."""
        return 0.5 * self.quantum + DEVIATIONS * self.deviation

    def held(self, periods: float) -> float:
        """Return what an effort that is held for `periods` can give, its ramp included [J]."""
        time = periods * self.period + 0.5 * self.effort / self.rate
        driven = 0.5 * self.effort * time * time / self.mass
        feigned = 2.0 * periods * self.sample_error
        reach = min(self.velocity * time + driven + feigned, self.travel + 2.0 * self.sample_error)
        if self.spring == 0.0:  # also where nothing bounds the velocity
            return self.effort * reach
        return self.effort * reach + 0.5 * self.spring * min(self.velocity * time, self.travel) ** 2

    @property
    def under_way(self) -> float:
        """Return W, what a stall can give whatever moves the device [J]."""
        return self.held(self.blind)

    @property
    def let_go(self) -> float:
        """Return what a device gains in a stall that nothing drives along from outside [J]."""
        return min(self._paid.held(self.blind), self.bounded)

    @property
    def gap(self) -> float:
        """Return for how long there may be no sample before the axis is stopped [s]."""
        return (self.blind - self.late) * self.period

    def at_once(self) -> float:
        """Return what a prompt host lets out whatever the time, 2 E0 + W of a period [J]."""
        return 2.0 * self.reserve + self._paid.held(self.late + 1.0)

    @property
    def _paid(self) -> Claim:
        """Return the claim with no more effort than a full tank pays for until it has fallen."""
        return self._replace(effort=min(self.effort, self.ramped))

    def prompt(self, seconds: float) -> float:
        """Return what is given out in a run in which no sample is late or missing [J]."""
        return self.at_once() + self.leak * seconds

    def dead(self, watchdog_s: float) -> float:
        """Return what a host that never comes back gives out until the drive acts by itself [J]."""
        if math.isinf(watchdog_s) and math.isinf(self.travel):
            return math.inf
        return self.held(self.late + watchdog_s / self.period)

    def safe_gap(self) -> float:
        """Return the longest gap between samples that gives no more than `kinetic` [s].

        One period at least: that is no gap, but what a prompt host leaves between two samples.
        """
        low, high = 1, max(1, math.floor(self.blind - self.late))
        while low < high:
            middle = (low + high + 1) // 2
            given = self._paid.held(self.late + middle)
            if given <= self.kinetic and given < math.inf:
                low = middle
            else:
                high = middle - 1
        return low * self.period

    def seen(self, seconds: float) -> float:
        """Return the bound on what the encoder sees of the energy given out [J]."""
        return 2.0 * self.reserve + self.under_way + self.owed + self.leak * seconds

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


class Stated(NamedTuple):
    """What is stated of one axis before its run [J, s], SI of the device.

    Attributes
    ----------
    claim_j : float
        In the whole run, whatever stalls it has.
    prompt_j : float
        In a run without any.
    stall_j, let_go_j : float
        In one gap between samples of at most `gap_s`: whatever moves the device; and where nothing
        drives it along from outside.
    dead_j : float or None
        By a host that never comes back, until the drive acts by itself; inf: it never does, None:
        nothing outlives the host.
    kinetic_j : float or None
        What the device has at its velocity limit; None of an axis that takes velocities.
    gap_s, safe_gap_s : float
        After which the axis is stopped at the latest; up to which a gap gives no more than
        `kinetic_j`, one period at least.
    """

    claim_j: float
    prompt_j: float
    stall_j: float
    let_go_j: float
    dead_j: float | None
    kinetic_j: float | None
    gap_s: float
    safe_gap_s: float


def stated_claim(claim: Claim, seconds: float, watchdog_s: float | None) -> Stated:
    """Return what is stated of an axis for a run of so many `seconds`.

    `watchdog_s` is the silence after which its drive acts by itself [s], None where there is
    nothing that outlives the host.
    """
    return Stated(
        claim_j=claim.seen(seconds),
        prompt_j=claim.prompt(seconds),
        stall_j=claim.under_way,
        let_go_j=claim.let_go,
        dead_j=None if watchdog_s is None else claim.dead(watchdog_s),
        kinetic_j=claim.kinetic or None,
        gap_s=claim.gap,
        safe_gap_s=claim.safe_gap(),
    )


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


def stall_words(claim: Claim) -> str:
    """Return what a stall may give as part of a sentence."""
    gap = f"{1e3 * claim.gap:.3g} ms without a sample"
    most = f"{joules(claim.under_way)} in {gap}"
    if claim.let_go < claim.under_way:
        return f"{most} (no more than {joules(claim.let_go)} if nothing drives it along)"
    return most
