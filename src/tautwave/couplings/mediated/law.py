"""Law mediated: filters, the rendered model, the steps of both ends, and their constants.

The slave follows where it sees the master, and presses with what the master renders:

    R = K (x - x_far) + B (v - v_far) - g F_far.

In contact it presses with a little more than the master renders at most: what the hand feels may be
too soft, as the surface is not known yet or the account does not cover it, but not by much.

It learns the surface that it touches (`estimate`), and shows that in the place of its own motion:
position of the surface, its damping, its stiffness with the sign of its side. The master renders
the surfaces that it has heard of.

**Filters**: one on motion and effort, so that a regression of the one on the other has no phase.
An observer of external efforts (`laws.observer`, a triple pole p) shows of an effort f, held over
each period,

    H(z) f,  H = (1 - p)**3 / 2 z (z + 1) / (z - p)**3:

three first-order low-passes after the mean of two neighbouring periods. An environment K x + B v
that acts meanwhile has the mean K (x[k] + x[k+1]) / 2 + B (x[k+1] - x[k]) / T over a period. So
position and velocity that went the same way are (x[k] + 2 x[k-1] + x[k-2]) / 4 and
(x[k] - x[k-2]) / 2T, each through the same three low-passes: exact, whatever p. A measured effort
is filtered here as positions are.

**Model**: a surface that becomes stiffer, or moves, while it is pressed in by d puts d K d**2 / 2
into its spring, out of nothing. So the spring may hold at most what an account covers:

    K d**2 / 2 <= funds,

and a rise is taken from them, a fall returned. Not pressed, a surface becomes at once what is
known. Damping is what is known of the environment's, and what keeps a spring that is held over a
period from gaining energy on a device without friction: more than K T (1/2 + n).

Sources: Hannaford 1989 and Mitra & Niemeyer, Int. J. Robotics Research 27(2), 2008 (model-mediated
telemanipulation); one filter on all signals of a regression is Young's prefilter (1964); the filter
that the observer has, and the rule by the funds, are derived here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

from tautwave.columns import Column
from tautwave.config.keys.coupling import chosen
from tautwave.contracts import CoupledAxis
from tautwave.controller.records import AxisParams, AxisState
from tautwave.controller.seen import SeenEnd, seen_law
from tautwave.controller.steps import Holding
from tautwave.couplings.mediated.estimate import (
    Contact,
    ContactParams,
    FitParams,
    Surface,
    begin_contact,
    clear,
    touch,
)
from tautwave.couplings.mediated.keys import MediatedPair
from tautwave.couplings.outside import outside_effort
from tautwave.errors import ConfigError
from tautwave.laws.limit import clamp
from tautwave.laws.observer import ReactionParams, observe, reaction


class SignalParams(NamedTuple):
    """Of one axis: the filter's pole p [1] and 1 / 2T [1/s]."""

    pole: float
    per_two_periods: float


@dataclass(slots=True)
class Filter:
    """The last two samples of a signal, and what the three low-passes hold of its mean."""

    newest: float = 0.0
    before: float = 0.0
    first: float = 0.0
    second: float = 0.0
    mean: float = 0.0


@dataclass(slots=True)
class Slope:
    """What the three low-passes hold of a signal's derivative."""

    first: float = 0.0
    second: float = 0.0
    mean: float = 0.0


def begin_filter(s: Filter, sample: float) -> None:
    """Begin as if the signal had always been `sample`."""
    s.newest = sample
    s.before = sample
    s.first = sample
    s.second = sample
    s.mean = sample


def begin_slope(s: Slope) -> None:
    """Begin at rest."""
    s.first = 0.0
    s.second = 0.0
    s.mean = 0.0


def pass_slope(p: SignalParams, s: Slope, f: Filter, sample: float) -> None:
    """Filter the derivative, by the sample that comes next; before `pass_filter`."""
    rest = 1.0 - p.pole
    s.first += rest * ((sample - f.before) * p.per_two_periods - s.first)
    s.second += rest * (s.first - s.second)
    s.mean += rest * (s.second - s.mean)


def pass_filter(p: SignalParams, s: Filter, sample: float) -> None:
    """Filter the next sample."""
    rest = 1.0 - p.pole
    s.first += rest * (0.25 * (sample + 2.0 * s.newest + s.before) - s.first)
    s.second += rest * (s.first - s.second)
    s.mean += rest * (s.second - s.mean)
    s.before = s.newest
    s.newest = sample


class ModelParams(NamedTuple):
    """Constants of a rendered model.

    share: of what a pressed surface is off, what it adopts per period [1]; span [s]: damping that
    is rendered per stiffness at least; most [N m s/rad or N s/m]: damping at most.
    """

    share: float
    span: float
    most: float


def depth_in(s: Surface, side: float, x: float) -> float:
    """Return how far a device is in a surface [rad or m], 0 outside."""
    depth = side * (x - s.position)
    if s.stiffness > 0.0 and depth > 0.0:
        return depth
    return 0.0


def stored_in(s: Surface, side: float, x: float) -> float:
    """Return what a surface's spring holds [J]."""
    depth = depth_in(s, side, x)
    return 0.5 * s.stiffness * depth * depth


def adopt(
    p: ModelParams, s: Surface, known: Surface, side: float, x: float, periods: float, funds: float
) -> float:
    """Bring a rendered surface towards what is known; return what its spring then holds more [J].

    Parameters
    ----------
    p : ModelParams
        Constants.
    s, known : Surface
        As rendered, and as known.
    side, x : float
        Of the surface, +1 or -1; position of the device that feels it [rad or m].
    periods : float
        Since the last time.
    funds : float
        What the spring may hold [J].
    """
    before = stored_in(s, side, x)
    if s.stiffness == 0.0 or side * (x - s.position) <= 0.0:
        if side * (x - known.position) <= 0.0:
            s.stiffness = known.stiffness
            s.damping = known.damping
            s.position = known.position
            return -before
        if s.stiffness == 0.0:
            s.position = known.position
    share = p.share * periods
    if share > 1.0:
        share = 1.0
    s.stiffness += share * (known.stiffness - s.stiffness)
    s.damping += share * (known.damping - s.damping)
    s.position += share * (known.position - s.position)
    depth = depth_in(s, side, x)
    if funds < 0.0:
        funds = 0.0
    if 0.5 * s.stiffness * depth * depth > funds:
        s.stiffness = 2.0 * funds / (depth * depth)
    return stored_in(s, side, x) - before


def damping_of(p: ModelParams, s: Surface) -> float:
    """Return the damping that a surface is rendered with [N m s/rad or N s/m]."""
    least = p.span * s.stiffness
    damping = s.damping
    if damping < least:
        damping = least
    if damping > p.most:
        damping = p.most
    return damping


def push_of(p: ModelParams, s: Surface, side: float, x: float, v: float) -> float:
    """Return the resisting effort of a surface [N m or N], which never pulls."""
    depth = depth_in(s, side, x)
    if depth == 0.0:
        return 0.0
    push = s.stiffness * depth + damping_of(p, s) * (side * v)
    if push > 0.0:
        return side * push
    return 0.0


class MediatedEndParams(NamedTuple):
    """Constants of one end.

    stiffness, damping [N m/rad, N m s/rad or N/m, N s/m], force [1]: how it follows; press [N m or
    N], lead [1]: in contact it presses with that and that share of what is rendered; follows,
    measures; read_stiffness, read_damping [1]: what the far side's are here, of the numbers that
    come; greatest [N m/rad or N/m], of the stiffness that it renders; smoothing: of velocities, per
    period [1].
    """

    follows: bool
    measures: bool
    stiffness: float
    damping: float
    force: float
    press: float
    lead: float
    read_stiffness: float
    read_damping: float
    stiffest: float
    outside: ReactionParams
    signals: SignalParams
    contact: ContactParams
    model: ModelParams
    smoothing: float


@dataclass(slots=True)
class MediatedEnd(SeenEnd):
    """One end: its observer (position, velocity, acceleration) and filtered signals, and a model.

    Of a slave `contact` is what it found; of a master the surfaces in it are what it heard, and
    `above` and `below` as they are rendered. `paid` [J]: what rises of their stiffness have cost
    so far, less what falls gave back. `funds` [J]: what they may hold; `count`: periods of this
    sample. `smooth` [rad/s or m/s]: velocity, smoothed.
    """

    at: float = 0.0
    velocity: float = 0.0
    push: float = 0.0
    smooth: float = 0.0
    place: Filter = field(default_factory=Filter)
    speed: Slope = field(default_factory=Slope)
    force: Filter = field(default_factory=Filter)
    contact: Contact = field(default_factory=Contact)
    above: Surface = field(default_factory=Surface)
    below: Surface = field(default_factory=Surface)
    paid: float = 0.0
    count: float = 1.0
    funds: float = math.inf


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
    """Observe the external effort, filter it with the motion, and update the estimate."""
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
    """Store the surface that the far side reports; a stiffness of 0 reports none."""
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
    """Store a surface as the far side reported it."""
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
    """Return whether a resisting effort presses a slave into a touched or known surface."""
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
    """Return the resisting effort of the known surfaces, covered or not [N m or N].

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


def renders_below(s: AxisState) -> bool:
    """Return whether a master shows the surface that fills what is below."""
    e = s.end
    return depth_in(e.above, 1.0, s.position) == 0.0 and e.below.stiffness > 0.0


def model_stiffness(s: AxisState, p: AxisParams) -> float:
    """Return the stiffness of the surface that is found or rendered [N m/rad or N/m]."""
    e = s.end
    stiffness: float = e.effort
    if not p.end.follows:
        stiffness = e.above.stiffness
        if renders_below(s):
            stiffness = -e.below.stiffness
    return stiffness


def model_position(s: AxisState, p: AxisParams) -> float:
    """Return where that surface is [rad or m]."""
    e = s.end
    place: float = e.above.position
    if p.end.follows:
        place, _ = shown(s)
    elif renders_below(s):
        place = e.below.position
    return place


SIGNALS = (
    Column(
        "model_stiffness",
        "N m/rad, N/m",
        "stiffness of the surface last found by the slave or rendered by the master; negative: it "
        "fills what is below",
        model_stiffness,
    ),
    Column("model_position", "rad, m", "where that surface is", model_position),
    Column(
        "model_interval",
        "N m/rad, N/m",
        "half-width of the 95 % interval of the stiffness estimated at the slave",
        lambda s, p: s.end.contact.wide_stiffness,
    ),
    Column(
        "model_paid",
        "J",
        "energy paid by the account so far for changes of a surface in contact",
        lambda s, p: s.end.paid,
    ),
)
"""What is recorded of an axis."""


law = seen_law(
    "mediated",
    effort,
    end=MediatedEnd,
    begin=begin,
    keep=keep,
    shown=shown,
    holding=Holding(cover, held, gain, whole),
    signals=SIGNALS,
)


APART = 5.0
"""Memories 1 / (1 - p) of the filter from one sample of the fit to the next: three low-passes then
keep a tenth of white noise."""

SMOOTHED_S = 3e-3
"""Time over which velocities are smoothed [s]: a twentieth of a period of the spring, 16 Hz."""

PRESSES = 2.5
"""Times `touch`, which a slave in contact presses with whatever the master renders: enough to learn
from, and more than what begins a first estimate (`estimate.FELT`)."""

LEAD = 1.3
"""Times what the master renders, which it presses with beyond that. More than 1, so that it does
not get stuck on a friction that it takes for a contact."""

STEADY = 2.0
"""Rendered damping over what a spring on a device without friction needs: K T (1/2 + n)."""


def end_constants(pair: MediatedPair, side: str, axis: CoupledAxis) -> MediatedEndParams:
    """Return the constants of one end.

    Raises
    ------
    ConfigError
        `effort: measured`, and the slave has no sensor.
    """
    follows = side == "slave"
    measures = follows and pair.effort == "measured"
    if measures and not axis.senses:
        raise ConfigError(
            "effort: measured: the slave has no effort_sensor; add one, or use effort: observed"
        )
    outside = outside_effort(axis, pair.observer_hz)
    pole = outside.observer.pole
    every = math.ceil(APART / (1.0 - pole))
    stiffest = chosen(pair, "stiffest")
    press = PRESSES * chosen(pair, "touch")
    scale = pair.position_scale
    late = axis.delay + (1 if axis.late > 0.0 else 0)
    span = STEADY * axis.period * (0.5 + late)
    return MediatedEndParams(
        follows=follows,
        measures=measures,
        stiffness=pair.in_device_units(side, chosen(pair, "stiffness")) if follows else 0.0,
        damping=pair.in_device_units(side, chosen(pair, "damping")) if follows else 0.0,
        force=pair.force_gain if follows else 0.0,
        press=press if follows else press / pair.effective_force_scale,
        lead=LEAD,
        read_stiffness=scale,
        read_damping=pair.sign * scale * scale / pair.effective_force_scale,
        stiffest=pair.in_device_units(side, stiffest),
        outside=outside,
        signals=SignalParams(pole, 0.5 / axis.period),
        contact=ContactParams(
            fit=FitParams(math.exp(-every * axis.period / pair.memory_s)),
            touch=chosen(pair, "touch"),
            every=every,
            sure=pair.sure,
            resolution=axis.encoder_quantum + 2.0 * axis.position_noise,
        ),
        model=ModelParams(
            share=-math.expm1(-axis.period / pair.adopt_s), span=span, most=span * stiffest
        ),
        smoothing=axis.period / SMOOTHED_S,
    )
