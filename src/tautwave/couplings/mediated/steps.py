"""The steps of law mediated.

The slave follows where it sees the master, and presses with what the master renders:

    R = K (x - x_far) + B (v - v_far) - g F_far.

In contact it presses with a little more than the master renders at most: what the hand feels may be
too soft, as the surface is not known yet or the account does not cover it, but not by much.

It learns the surface that it touches, and shows that in the place of its own motion: position of
the surface, its damping, its stiffness with the sign of its side. The master renders the surfaces
that it has heard of.
"""

from __future__ import annotations

import math

from tautwave.contracts import Row
from tautwave.controller.records import AxisParams, AxisState
from tautwave.controller.seen import seen_law
from tautwave.controller.steps import Holding
from tautwave.couplings.mediated.contact import Surface, begin_contact, clear, touch
from tautwave.couplings.mediated.model import adopt, depth_in, push_of, stored_in
from tautwave.couplings.mediated.records import MediatedEnd, MediatedEndParams
from tautwave.couplings.mediated.signals import begin_filter, begin_slope, pass_filter, pass_slope
from tautwave.laws.limit import clamp
from tautwave.laws.observer import observe, reaction

SETTLED = 12.0
"""Filter memories 1 / (1 - p) after a missing sample until a fit takes a sample again."""


def begin(s: AxisState) -> None:
    """Begin at rest, with nothing known."""
    e = s.end
    e.at = s.position
    e.velocity = 0.0
    e.push = 0.0
    e.smooth = 0.0
    begin_filter(e.place, s.position)
    begin_slope(e.speed)
    begin_filter(e.force, 0.0)
    begin_contact(e.contact, s.position)
    clear(e.above)
    clear(e.below)
    e.paid = 0.0
    e.count = 1.0
    e.funds = math.inf


def keep(
    s: AxisState, p: AxisParams, displacement: float, count: float, span: float, port: float
) -> None:
    """Learn what is touched, or adopt what was reported."""
    e = s.end
    share = p.end.smoothing * count
    e.smooth += share / (1.0 + share) * (s.velocity - e.smooth)
    if p.end.follows:
        learn_surface(s, p, displacement, count)
        return
    hear_surface(s, p)
    s.end.count = count
    if s.end.funds == math.inf:  # no account covers it
        render(s, p, math.inf)


def learn_surface(s: AxisState, p: AxisParams, displacement: float, count: float) -> None:
    """Observe the effort from outside, filter it with the motion, and learn."""
    e = s.end
    k = p.end
    at, velocity, push = observe(
        k.outside.observer, e.at, e.velocity, e.push, s.position, s.effort_sum / count, count
    )
    e.at = at
    e.velocity = velocity
    e.push = push
    step = displacement / count
    x = s.position - displacement
    passed = 0.0
    while passed < count:  # a sample that is missing lay between its neighbours
        x += step
        passed += 1.0
        pass_slope(k.signals, e.speed, e.place, x)
        pass_filter(k.signals, e.place, x)
        pass_filter(k.signals, e.force, s.outside)
    if count != 1.0:
        e.contact.waited = -SETTLED / (1.0 - k.signals.pole)
    against = -reaction(k.outside, velocity, push)
    if k.measures:
        against = -e.force.mean
    touch(k.contact, e.contact, e.place.mean, e.speed.mean, against, count)
    e.effort = 0.0
    if e.contact.reported > 0.0:
        e.effort = e.contact.above.stiffness
    elif e.contact.reported < 0.0:
        e.effort = -e.contact.below.stiffness


def shown(s: AxisState) -> tuple[float, float]:
    """Show the surface that was found last and its damping; before, position and velocity."""
    c = s.end.contact
    if c.reported > 0.0:
        return c.above.position, c.above.damping
    if c.reported < 0.0:
        return c.below.position, c.below.damping
    return s.position, s.end.smooth


def hear_surface(s: AxisState, p: AxisParams) -> None:
    """Take what the far side tells of a surface; without stiffness it tells of none."""
    e = s.end
    k = p.end
    stiffness = k.read_stiffness * e.far_effort
    if stiffness > 0.0:
        hear(
            e.contact.above,
            clamp(stiffness, k.stiffest),
            k.read_damping * e.far_velocity,
            e.far_position,
        )
    elif stiffness < 0.0:
        hear(
            e.contact.below,
            clamp(-stiffness, k.stiffest),
            k.read_damping * e.far_velocity,
            e.far_position,
        )


def hear(surface: Surface, stiffness: float, damping: float, position: float) -> None:
    """Know a surface as reported."""
    surface.stiffness = stiffness
    surface.damping = damping
    surface.position = position


def render(s: AxisState, p: AxisParams, funds: float) -> None:
    """Bring both rendered surfaces towards what is known, as far as the funds [J] cover them."""
    e = s.end
    k = p.end
    x = s.position
    c = e.contact
    e.effort = 0.0
    if c.above.stiffness > 0.0:  # else nothing is known there, and nothing rendered
        below = stored_in(e.below, -1.0, x)
        e.paid += adopt(k.model, e.above, c.above, 1.0, x, e.count, funds - below)
        e.effort = e.above.stiffness * depth_in(e.above, 1.0, x)
    if c.below.stiffness > 0.0:
        above = stored_in(e.above, 1.0, x)
        e.paid += adopt(k.model, e.below, c.below, -1.0, x, e.count, funds - above)
        e.effort -= e.below.stiffness * depth_in(e.below, -1.0, x)


def cover(s: AxisState, p: AxisParams, funds: float) -> None:
    """Render as much as an account covers."""
    if not p.end.follows:
        s.end.funds = funds
        render(s, p, funds)


def held(s: AxisState) -> float:
    """Return what the rendered springs hold [J]."""
    return stored_in(s.end.above, 1.0, s.position) + stored_in(s.end.below, -1.0, s.position)


def presses(e: MediatedEnd, effort: float) -> bool:
    """Return whether a resisting effort presses a slave into what it touches, or knows of there."""
    c = e.contact
    if effort < 0.0:
        return c.side > 0.0 or depth_in(c.above, 1.0, e.far_position) > 0.0
    return c.side < 0.0 or depth_in(c.below, -1.0, e.far_position) > 0.0


def effort(s: AxisState, p: AxisParams, free_velocity: float) -> float:
    """Return the resisting effort: of following, or of the model [N m or N]."""
    e = s.end
    k = p.end
    if k.follows:
        asked: float = k.stiffness * (s.position - e.far_position)
        asked += k.damping * (e.smooth - e.far_velocity)
        asked -= k.force * e.far_effort
        if presses(e, asked):
            return clamp(asked, k.press + k.lead * math.fabs(e.far_effort))
        return asked
    push: float = push_of(k.model, e.above, 1.0, s.position, e.smooth)
    return push + push_of(k.model, e.below, -1.0, s.position, e.smooth)


def whole(s: AxisState, p: AxisParams, effort: float) -> float:
    """Return the resisting effort of the surfaces that are known, whoever pays for them [N m or N].

    No more than the slave may press with, given `effort`. A follower's, `effort`, needs no cover.
    """
    if p.end.follows:
        return effort
    k = p.end
    c = s.end.contact
    push: float = push_of(k.model, c.above, 1.0, s.position, s.velocity)
    push += push_of(k.model, c.below, -1.0, s.position, s.velocity)
    return clamp(push, k.press + k.lead * math.fabs(effort))


def gain(end: MediatedEndParams, tracker: float, period: float) -> float:
    """Return by how much the effort changes at most with the newest sample [N m/rad or N/m]."""
    if end.follows:
        return end.stiffness + tracker * end.damping / period
    return end.stiffest + tracker * end.model.most / period


SIGNALS = ("model_stiffness", "model_position", "model_interval", "model_paid")


def fill_signals(out: Row, at: int, s: AxisState, p: AxisParams) -> int:
    """Write the surface that a slave found last, or that a master renders."""
    e = s.end
    out[at + 2] = e.contact.wide_stiffness
    out[at + 3] = e.paid
    if p.end.follows:
        place, _ = shown(s)
        out[at] = e.effort
        out[at + 1] = place
        return at + 4
    surface = e.above
    side = 1.0
    if depth_in(e.above, 1.0, s.position) == 0.0 and e.below.stiffness > 0.0:
        surface = e.below
        side = -1.0
    out[at] = side * surface.stiffness
    out[at + 1] = surface.position
    return at + 4


law = seen_law(
    "mediated",
    effort,
    end=MediatedEnd,
    begin=begin,
    keep=keep,
    shown=shown,
    holding=Holding(cover, held, gain, whole),
    signals=SIGNALS,
    fill_signals=fill_signals,
)
