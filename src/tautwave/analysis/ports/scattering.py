"""Wave out per wave in of what is implemented: ports on a device, the wave filter; |S| bounded.

A wave line with |S| <= 1 at both ends is stable behind any delay and, end by end, passive. Each
element here is written down as a rational function with exact coefficients, and the greatest |S|
on the unit circle is proved by the same algebra as the wall's bound (no grid decides).

Against any passive hand whatever no sampled port has |S| <= 1: its prediction rests on a mass. On
a spring k to ground, not predicted, |S| <= 1 requires damping, see `spring_damping`. Beyond that
the port's energy account, which is exact, keeps it passive; the law then no longer is linear.

Sources: Niemeyer & Slotine 1991 (waves); `tautwave.laws.tracked_port`, `tautwave.laws.admittance`
(proofs for a free mass and for a spring); written out here for the other cases.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from tautwave.analysis.exact.bounds import common_integers, is_schur, reduce_fraction
from tautwave.analysis.exact.polynomials import Poly, trim
from tautwave.analysis.exact.rational import Rational, constant
from tautwave.analysis.ports.sampled_loop import Device, Site
from tautwave.analysis.walls.passivity import LeakForm, square_series
from tautwave.analysis.walls.sampled import PulseTransfer, split_delay
from tautwave.models.linear import flow_rows

TIGHT = 1e-9
"""Excess of |S|**2 over 1 that still counts as passive: rounding of the device's map."""

ONE = Rational((Fraction(1),), (Fraction(1),))
Q = Rational((Fraction(1), Fraction(0)), (Fraction(1),))
"""One period of delay, 1 / z."""


class Gain(NamedTuple):
    """Greatest magnitude of a pulse transfer on the unit circle.

    Attributes
    ----------
    greatest : float
        sup |S| [1]; inf if the transfer itself is unstable.
    upper : float
        Proved upper bound of it, within 1e-10 as a rule.
    theta : float
        Where it is, w T in [0, pi]; for an unstable transfer the angle of its worst pole.
    stable : bool
        Whether all poles are inside the unit circle.
    """

    greatest: float
    upper: float
    theta: float
    stable: bool

    @property
    def passive(self) -> bool:
        """Whether no wave leaves larger than it came, to rounding."""
        return self.stable and self.upper * self.upper <= 1.0 + TIGHT

    def frequency(self, period: float) -> float:
        """Return where the magnitude is greatest [Hz]."""
        return self.theta / (2.0 * math.pi * period)


def greatest_gain(transfer: PulseTransfer) -> Gain:
    """Return the greatest |S(e^(j theta))|, proved; see `Gain`."""
    top, bottom = reduce_fraction(transfer.numerator, transfer.denominator)
    if not is_schur(bottom):
        poles = np.roots([float(value) for value in bottom])
        worst = poles[np.argmax(np.abs(poles))]
        return Gain(math.inf, math.inf, abs(float(np.angle(worst))), stable=False)
    if not any(top):
        return Gain(0.0, 0.0, 0.0, stable=True)
    form = LeakForm(*common_integers(square_series(top), square_series(bottom), [Fraction(0)]))
    square, upper, theta = form.greatest()
    return Gain(math.sqrt(square), math.sqrt(upper), theta, stable=True)


# -- the wave port of an impedance axis ------------------------------------------------------------


def port_scattering(device: Device, site: Site, *, filter_gain: float = 1.0) -> PulseTransfer:
    """Return S(z), leaving per arriving wave, of a wave port on a device; the account is full.

    Parameters
    ----------
    device : Device
        Truth: mass, damping and stiffness to ground with hand or environment, command delay with
        a fraction.
    site : Site
        Belief: port with mass bound, matching damper and repayment of drift, velocity tracker,
        delay that the driver declares.
    filter_gain : float
        Step of the wave filter on what leaves; 1: none.
    """
    port = site.port
    impedance, mobility = _whole(port.impedance), _whole(port.half_mobility)
    slip, repay, gain = _whole(port.slip), _whole(port.repay), _whole(site.gain)
    late = _whole(site.late_share)
    moved = displacement_transfer(device, port.period)
    acted = _power(Q, site.delay_periods + 1) * ((ONE - late) + late * Q)
    pending = sum((_power(Q, at) for at in range(1, site.delay_periods + 1)), constant(0))
    believed = mobility * (ONE + Q) * acted
    tracked = (gain * moved + (ONE - gain) * believed) / (ONE - (ONE - gain) * Q)
    divisor = ONE + impedance * (
        mobility + slip + tracked + mobility * (acted + constant(2) * pending)
    )
    repaid = repay / (ONE - (ONE - repay) * Q) * (moved - tracked)
    out = constant(2) * impedance / divisor * (tracked + slip * acted + repaid)
    total = out - _power(Q, site.delay_periods + 1)
    return as_pulse(total * _filter(filter_gain))


def displacement_transfer(device: Device, period: float) -> Rational:
    """Return the mean velocity of the last period per resisting effort, negated, in q = 1/z.

    Exact for a held effort that begins to act `command_delay` periods after its sample.
    """
    whole, rest = split_delay(device.command_delay)
    state, late, prompt = _motion(device, period, rest)
    acting = [_power(Q, whole) * constant(p) + _power(Q, whole + 1) * constant(r)
              for p, r in zip(prompt, late, strict=True)]  # fmt: skip
    span = constant(Fraction(period))
    if device.stiffness == 0.0:
        speed = Q * acting[1] / (ONE - constant(1 + state[1][1]) * Q)
        return (constant(state[0][1]) * Q * speed + Q * acting[0]) / span
    (a, b), (c, d) = ((constant(value) for value in row) for row in state)
    # Rows of 1 - q (1 + state): position and velocity at the sample.
    own_x, own_v = ONE - Q - a * Q, ONE - Q - d * Q
    position = Q * (own_v * acting[0] + b * Q * acting[1]) / (own_x * own_v - b * c * Q * Q)
    return (ONE - Q) * position / span


def spring_damping(site: Site, stiffness: float) -> float:
    """Return the device damping [N s/m or N m s/rad] a port needs on a spring for |S| <= 1.

    b mu k T / (1 + 2 b mu), mu = T / (2 mass bound): the spring's pull within a period that the
    prediction leaves out. Without delay, from theta -> 0, where it is worst; small: 2e-2 N s/m
    for b = 20 N s/m, 0.25 kg, 538 N/m at 1 kHz.
    """
    port = site.port
    loading = port.impedance * port.half_mobility
    return loading * stiffness * port.period / (1.0 + 2.0 * loading)


# -- the wave port of an admittance axis, and the filter -------------------------------------------


def as_pulse(transfer: Rational) -> PulseTransfer:
    """Return a function of q = 1/z with its coefficients by falling powers of z."""
    length = max(len(transfer.num), len(transfer.den))
    return PulseTransfer(_by_z(transfer.num, length), _by_z(transfer.den, length))


# -- helpers ---------------------------------------------------------------------------------------


def _whole(value: float) -> Rational:
    """Return a float as the binary fraction that it is."""
    return constant(Fraction(value))


def _power(base: Rational, count: int) -> Rational:
    if base is Q:
        return Rational((Fraction(1), *[Fraction(0)] * count), (Fraction(1),))
    out = ONE
    for _ in range(count):
        out = out * base
    return out


def _filter(gain: float) -> Rational:
    step = _whole(gain)
    return step / (ONE - (ONE - step) * Q)


def _by_z(p: Poly, length: int) -> tuple[Fraction, ...]:
    rising = tuple(reversed(p))
    padded = rising + (Fraction(0),) * (length - len(rising))
    return trim(padded) or (Fraction(0),)


def _motion(
    device: Device, period: float, rest: float
) -> tuple[list[list[Fraction]], list[Fraction], list[Fraction]]:
    """Return the gains of x and v over a period: of (x, v), of the late and the prompt effort.

    The late effort acts for the first `rest` of the period.
    """
    early, late = _part(device, Fraction(rest) * Fraction(period))
    later, prompt = _part(device, (1 - Fraction(rest)) * Fraction(period))
    both = [
        [early[i][j] + later[i][j] + sum(later[i][k] * early[k][j] for k in (0, 1)) for j in (0, 1)]
        for i in (0, 1)
    ]
    carried = [late[i] + sum(later[i][k] * late[k] for k in (0, 1)) for i in (0, 1)]
    return both, carried, prompt


def _part(device: Device, span: Fraction) -> tuple[list[list[Fraction]], list[Fraction]]:
    """Return the gains of (x, v) over `span` [s] and those of a unit of held effort."""
    k, b, m = Fraction(device.stiffness), Fraction(device.damping), Fraction(device.mass)
    if device.stiffness == device.damping == 0.0:
        # No rounding: a lossless end must be exactly lossless.
        return [[Fraction(0), span], [Fraction(0)] * 2], [span * span / (2 * m), span / m]
    rows = flow_rows(device.stiffness, device.damping, device.mass, float(span))
    xv, xn, vv, vn = (Fraction(rows[at]) for at in (0, 1, 3, 4))
    return [[-xn * k, xv - xn * b], [-vn * k, vv - vn * b]], [xn, vn]
