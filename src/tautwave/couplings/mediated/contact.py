"""What is known of the surfaces on either side of a device: where, how stiff, how damping.

A contact begins where the effort from outside leaves a band, on the side from which it pushes, and
ends at half of it. While it lasts a fit learns, and begins anew where a sample is off what it
expects by more than that band. What it has found counts once the interval of its stiffness is
narrow. Until then, where what is known explains less than half of the effort, the surface is the
line from the last sample before the contact to the newest one: it has the effort that there is. A
surface beyond which the device stands untouched was moved: it goes along.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

from tautwave.couplings.mediated.fit import WIDE, Fit, FitParams, begin_fit, half_width, learn
from tautwave.laws.limit import clamp

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
    """Know nothing, touch nothing, at a position [rad or m]."""
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
