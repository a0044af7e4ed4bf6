"""What is known of the surfaces on either side of a device, and the fit that learns of them.

A contact begins where the effort from outside leaves a band, on the side from which it pushes, and
ends at half of it. While it lasts a fit learns, and begins anew where a sample is off what it
expects by more than that band. What it has found counts once the interval of its stiffness is
narrow. Until then, where what is known explains less than half of the effort, the surface is the
line from the last sample before the contact to the newest one: it has the effort that there is. A
surface beyond which the device stands untouched was moved: it goes along.

The fit: stiffness, damping and offset by recursive least squares, with intervals.

    y = K x + B v + f + e,  old samples forgotten by a factor per sample.

Guards: a sample that brings less than forgetting takes is left out (`brings`), so that a device
that rests forgets nothing and its covariance does not wind up. An interval is Student's, with the
covariance that the estimate itself has,

    C <- (I - L phi') C (I - L phi')' + L L',

and not the gain's P, which with forgetting is about twice as wide; both times the variance of the
noise, found from the errors of prediction. It is honest for noise that is white from one sample of
the regression to the next: take samples as far apart as the filter before it remembers.

Sources: Plackett, Biometrika 37, 1950 (the recursion); Hill, Comm. ACM 13(10), 1970 (Student's
quantile by an expansion); the covariance under forgetting is derived here. SI.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

from tautwave.laws.limit import clamp

NORMAL = 1.959963984540054
"""Of a normal distribution, the quantile of a two-sided interval of 95 %."""

WIDE = 1e11
"""Variance of K, B and f before anything is known, over that of the noise (SI)."""

ENOUGH = 1.5
"""What a sample has to bring, over what forgetting takes of one unknown: samples that say the same
again and again bring 1 in the end, those of a motion that shows all three unknowns 3."""

FEWEST = 4.0
"""Degrees of freedom below which nothing is said."""


class FitParams(NamedTuple):
    """Forgetting: what the weight of a sample is multiplied by when the next one is taken [1]."""

    forget: float


@dataclass(slots=True)
class Fit:
    """An estimate.

    stiffness, damping, offset [N m/rad, N m s/rad, N m or N/m, N s/m, N]; p.. of the gain and c..
    of the estimate: covariances over the noise's variance, by rows; weight, weight_square: sums of
    the weights of errors that count, and of their squares; square: of squared errors [(N m)**2].
    """

    stiffness: float = 0.0
    damping: float = 0.0
    offset: float = 0.0
    p11: float = 0.0
    p12: float = 0.0
    p13: float = 0.0
    p22: float = 0.0
    p23: float = 0.0
    p33: float = 0.0
    c11: float = 0.0
    c12: float = 0.0
    c13: float = 0.0
    c22: float = 0.0
    c23: float = 0.0
    c33: float = 0.0
    weight: float = 0.0
    weight_square: float = 0.0
    square: float = 0.0


def begin_fit(s: Fit) -> None:
    """Begin without an estimate."""
    s.stiffness = 0.0
    s.damping = 0.0
    s.offset = 0.0
    s.p11 = WIDE
    s.p22 = WIDE
    s.p33 = WIDE
    s.p12 = 0.0
    s.p13 = 0.0
    s.p23 = 0.0
    s.c11 = 0.0
    s.c12 = 0.0
    s.c13 = 0.0
    s.c22 = 0.0
    s.c23 = 0.0
    s.c33 = 0.0
    s.weight = 0.0
    s.weight_square = 0.0
    s.square = 0.0


def learn(p: FitParams, s: Fit, x: float, v: float, y: float) -> bool:
    """Take a sample; return whether it brought something.

    Parameters
    ----------
    p, s : FitParams, Fit
        Constants and estimate.
    x, v : float
        Position, best from where contact began [rad or m], and velocity [rad/s or m/s].
    y : float
        Resisting effort of the environment [N m or N].
    """
    u1 = s.p11 * x + s.p12 * v + s.p13
    u2 = s.p12 * x + s.p22 * v + s.p23
    u3 = s.p13 * x + s.p23 * v + s.p33
    brings = x * u1 + v * u2 + u3
    if brings < ENOUGH * (1.0 - p.forget):
        return False
    error = y - (s.stiffness * x + s.damping * v + s.offset)
    over = 1.0 / (p.forget + brings)
    g1 = u1 * over
    g2 = u2 * over
    g3 = u3 * over
    again = 1.0 / p.forget
    s.p11 = again * (s.p11 - g1 * u1)
    s.p12 = again * (s.p12 - g1 * u2)
    s.p13 = again * (s.p13 - g1 * u3)
    s.p22 = again * (s.p22 - g2 * u2)
    s.p23 = again * (s.p23 - g2 * u3)
    s.p33 = again * (s.p33 - g3 * u3)
    w1 = s.c11 * x + s.c12 * v + s.c13
    w2 = s.c12 * x + s.c22 * v + s.c23
    w3 = s.c13 * x + s.c23 * v + s.c33
    spread = 1.0 + x * w1 + v * w2 + w3
    s.c11 += spread * g1 * g1 - 2.0 * g1 * w1
    s.c12 += spread * g1 * g2 - g1 * w2 - g2 * w1
    s.c13 += spread * g1 * g3 - g1 * w3 - g3 * w1
    s.c22 += spread * g2 * g2 - 2.0 * g2 * w2
    s.c23 += spread * g2 * g3 - g2 * w3 - g3 * w2
    s.c33 += spread * g3 * g3 - 2.0 * g3 * w3
    s.stiffness += g1 * error
    s.damping += g2 * error
    s.offset += g3 * error
    if brings < 1.0:  # while something is unknown, an error says nothing of the noise
        s.square = p.forget * s.square + error * error / spread
        s.weight = p.forget * s.weight + 1.0
        s.weight_square = p.forget * p.forget * s.weight_square + 1.0
    return True


def freedom(s: Fit) -> float:
    """Return the degrees of freedom of the noise's variance [1]: the errors that count."""
    if s.weight_square <= 0.0:
        return 0.0
    return s.weight * s.weight / s.weight_square


def student(degrees: float) -> float:
    """Return Student's two-sided quantile of 95 %; infinite below `FEWEST` degrees of freedom."""
    if degrees < FEWEST:
        return math.inf
    z = NORMAL
    z2 = z * z
    one = (z2 + 1.0) * z / 4.0
    two = ((5.0 * z2 + 16.0) * z2 + 3.0) * z / 96.0
    three = (((3.0 * z2 + 19.0) * z2 + 17.0) * z2 - 15.0) * z / 384.0
    over = 1.0 / degrees
    return z + over * (one + over * (two + over * three))


def half_width(s: Fit, covariance: float) -> float:
    """Return half the 95 % interval of what has this covariance over the noise's variance."""
    if s.weight_square <= 0.0 or not covariance >= 0.0:
        return math.inf
    return student(freedom(s)) * math.sqrt(covariance * s.square / s.weight)


STIFFEST = 30000.0
"""What counts as rigid [N m/rad or N/m]: a packet has no room for more."""


FELT = 1.5
"""Times `touch`, from which on an effort is a contact's without a fit: friction that changes its
sign shows twice the Coulomb friction for a moment."""


class ContactParams(NamedTuple):
    """Constants of what is learned at one device.

    touch [N m or N]: effort at which a contact begins; every: periods from one sample of the fit to
    the next; sure: greatest half-width of the stiffness' interval over it [1]; resolution: what two
    positions may be off by encoder step and noise [rad or m].
    """

    fit: FitParams
    touch: float
    every: float
    sure: float
    resolution: float


@dataclass(slots=True)
class Surface:
    """A spring and a damper from a position on; without stiffness there is none."""

    stiffness: float = 0.0
    damping: float = 0.0
    position: float = 0.0


@dataclass(slots=True)
class Contact:
    """Which side is touched, +1: above, -1: below, 0: none; what was found.

    `origin` [rad or m] where it began, `waited` periods since the last sample of the fit;
    `reported`: the side of which something was found last; half-widths of the intervals of
    stiffness, damping and of the surface's position. `place`, `effort`: last sample without any
    contact; `doubted`: no fit has been sure since it began.
    """

    side: float = 0.0
    origin: float = 0.0
    waited: float = 0.0
    reported: float = 0.0
    wide_stiffness: float = 0.0
    wide_damping: float = 0.0
    wide_position: float = 0.0
    place: float = 0.0
    effort: float = 0.0
    doubted: bool = True
    fit: Fit = field(default_factory=Fit)
    above: Surface = field(default_factory=Surface)
    below: Surface = field(default_factory=Surface)


def clear(s: Surface) -> None:
    """Forget a surface."""
    s.stiffness = 0.0
    s.damping = 0.0
    s.position = 0.0


def begin_contact(s: Contact, x: float) -> None:
    """Begin without contact and without an estimate, at a position [rad or m]."""
    s.place = x
    s.effort = 0.0
    s.doubted = True
    s.side = 0.0
    s.origin = 0.0
    s.waited = 0.0
    s.reported = 0.0
    s.wide_stiffness = 0.0
    s.wide_damping = 0.0
    s.wide_position = 0.0
    begin_fit(s.fit)
    clear(s.above)
    clear(s.below)


def surface_variance(s: Fit) -> float:
    """Return the variance of -f / K, where the surface is, over that of the noise."""
    k = s.stiffness
    slope = s.offset / k
    return (s.c33 - 2.0 * slope * s.c13 + slope * slope * s.c11) / (k * k)


def take_fit(p: ContactParams, s: Contact, surface: Surface) -> None:
    """Make a surface what the fit has found, if that is sure."""
    fit = s.fit
    stiffness = fit.stiffness
    wide = half_width(fit, fit.c11)
    if stiffness <= 0.0 or not wide <= p.sure * stiffness:
        return
    s.wide_stiffness = wide
    s.wide_damping = half_width(fit, fit.c22)
    s.wide_position = half_width(fit, surface_variance(fit))
    s.reported = s.side
    s.doubted = False
    surface.stiffness = clamp(stiffness, STIFFEST)
    surface.damping = fit.damping if fit.damping > 0.0 else 0.0
    surface.position = s.origin - fit.offset / stiffness


def take_secant(p: ContactParams, s: Contact, surface: Surface, x: float, effort: float) -> None:
    """Make a surface the line from where nothing was touched to here, if it is known too soft."""
    known = s.side * surface.stiffness * (x - surface.position)
    if s.side * effort < FELT * p.touch or 2.0 * known > s.side * effort:
        return
    rise = s.side * (effort - s.effort)
    way = s.side * (x - s.place) + p.resolution
    if rise <= 0.0 or way <= 0.0:
        return
    stiffness = clamp(rise / way, STIFFEST)
    s.reported = s.side
    surface.stiffness = stiffness
    surface.damping = 0.0
    surface.position = x - effort / stiffness


def leave_behind(p: ContactParams, s: Contact, surface: Surface, side: float, x: float) -> None:
    """Move a surface to where the device stands beyond it, untouched."""
    beyond = side * (x - surface.position)
    if surface.stiffness > 0.0 and beyond * surface.stiffness > p.touch:
        surface.position = x
        s.reported = side


def touch(p: ContactParams, s: Contact, x: float, v: float, effort: float, periods: float) -> None:
    """Learn from filtered signals at a sample.

    Parameters
    ----------
    p, s : ContactParams, Contact
        Constants and what is known.
    x, v : float
        Position [rad or m] and velocity [rad/s or m/s].
    effort : float
        With which the environment resists [N m or N], filtered as they are.
    periods : float
        Since the sample before.
    """
    s.waited += periods
    if s.side == 0.0:
        if effort > p.touch:
            s.side = 1.0
        elif effort < -p.touch:
            s.side = -1.0
        else:
            leave_behind(p, s, s.above, 1.0, x)
            leave_behind(p, s, s.below, -1.0, x)
            if math.fabs(effort) < 0.5 * p.touch:
                s.place = x
                s.effort = effort
            return
        s.waited = 0.0
    if s.side * effort < 0.5 * p.touch:
        s.side = 0.0
        return
    if s.doubted:
        if s.side > 0.0:
            take_secant(p, s, s.above, x, effort)
        else:
            take_secant(p, s, s.below, x, effort)
    if s.waited < p.every:
        return
    s.waited = 0.0
    fit = s.fit
    expected = fit.stiffness * (x - s.origin) + fit.damping * v + fit.offset
    strange = fit.weight > 0.0 and math.fabs(effort - expected) > p.touch
    if strange or fit.p33 >= WIDE:
        s.origin = x
        s.doubted = True
        begin_fit(fit)
    if learn(p.fit, s.fit, x - s.origin, v, effort):
        if s.side > 0.0:
            take_fit(p, s, s.above)
        else:
            take_fit(p, s, s.below)
