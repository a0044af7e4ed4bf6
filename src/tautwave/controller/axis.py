"""One axis of the controller: the state around the laws, and its energy books.

Order in a cycle: `pass_slot` for every slot that went by, `close_axis` when a sample is there (else
`miss_sample`), the coupling's exchange, `decide_axis`. The formulas are those of `tautwave.laws`,
what passes to the other side and what it makes of it here are the coupling's `Steps`.
"""

from __future__ import annotations

import math
from collections.abc import MutableSequence

from tautwave.controller.braking import miss_axis, stop_axis, stop_coupled
from tautwave.controller.inertia import close_inertia, lighten, start_inertia
from tautwave.controller.records import PIPE, TAG, AxisParams, AxisState, Sample
from tautwave.controller.steps import Steps
from tautwave.laws.compensation import compensation_effort
from tautwave.laws.limit import (
    AT_LIMIT,
    CLIPPED,
    NOT_A_NUMBER,
    RAMPED,
    STALL_BOUND,
    clamp,
    guard_axis,
    limit_effort,
    limited_by,
    rising_bound,
    share_effort,
)
from tautwave.laws.ramp import stall_ceiling
from tautwave.laws.site import (
    clip_coupling,
    held_effort,
    limit_velocity,
    render_wall,
    velocity_limited,
    wall_ahead,
)
from tautwave.laws.velocity import track_velocity
from tautwave.laws.wall import wall_depth, wall_effort, wall_loss, wall_stored


def start_axis(s: AxisState, p: AxisParams, position: float, outside: float) -> None:
    """Begin at a measured position, nothing stored; the coupling's own part is its `start`."""
    s.position = position
    s.begun = position
    s.risen = 0.0
    s.outside = outside
    if math.isnan(outside):
        s.outside = 0.0
    s.velocity = 0.0
    s.wall_velocity = 0.0
    s.impulse = 0.0
    s.depth = 0.0
    if p.site.has_wall:
        s.depth = wall_depth(p.site.wall, position)
    s.wall_stored_at_start = wall_stored(p.site.wall, s.depth)
    s.command = 0.0
    s.asked = 0.0
    s.valid = True
    s.stopping = False
    s.total = 0.0
    s.port_effort = 0.0
    s.wall_effort = 0.0
    s.tag = 0.0
    s.alarm = 0
    s.limited = 0
    s.acted_total = 0.0
    s.acted_port = 0.0
    s.acted_wall = 0.0
    s.spread = 0.0
    s.count = 0
    s.waited = 1
    s.ramped = 0
    s.effort_sum = 0.0
    s.port_sum = 0.0
    s.wall_sum = 0.0
    s.port_energy = 0.0
    s.gross_flow = 0.0
    s.uncertainty = 0.0
    s.wall_absorbed = 0.0
    s.wall_dissipated = 0.0
    s.wall_contact_energy = 0.0
    s.wall_owes = False
    s.help_absorbed = 0.0
    start_inertia(s, p)


def pass_slot(s: AxisState, p: AxisParams, table: MutableSequence[float], steps: Steps) -> None:
    """One slot went by: the command that acted in it joins the open interval.

    Books need the effort that acted, which is not the one just sent: with a command delay it was
    sent `delay` slots ago (`pass_late`). Efforts are summed, and divided by the slots when a
    sample closes them: over an interval without a sample only the mean effort and the whole
    displacement are known. `tag`, the number that the coupling put beside the command, comes back
    to it in the slot in which that command acts; so a wave is booked with the motion it causes.
    """
    tag = s.tag
    if p.delay > 0 or p.late > 0.0:
        tag = pass_late(s, p, table)
    else:
        s.effort_sum += s.total
        s.port_sum += s.port_effort
        s.wall_sum += s.wall_effort
        if p.site.compensates_inertia:
            s.inertia.sum += s.inertia.effort
    s.count += 1
    steps.on_acted(s, p, tag)


def pass_late(s: AxisState, p: AxisParams, table: MutableSequence[float]) -> float:
    """Let the command act that was sent `delay` slots ago; return its tag.

    A ring of `delay` entries in the pair's table: what stood at `head` acts now, and the last
    command takes its place. With a remainder `late` the command before acts for that share of the
    slot: when in it the device moved is unknown, so the swing between both goes to `spread`, from
    which `close_axis` makes an uncertainty of the books.
    """
    total = s.total
    port = s.port_effort
    wall = s.wall_effort
    tag = s.tag
    lift = s.inertia.effort
    if p.delay > 0:
        at = p.pipe + PIPE * s.head
        total = table[at]
        port = table[at + 1]
        wall = table[at + 2]
        tag = table[at + TAG]
        lift = table[at + 4]
        table[at] = s.total
        table[at + 1] = s.port_effort
        table[at + 2] = s.wall_effort
        table[at + TAG] = s.tag
        table[at + 4] = s.inertia.effort
        s.head += 1
        if s.head == p.delay:
            s.head = 0
        if p.late == 0.0:
            # Without a sample in between, the period in which the device moved is unknown.
            if s.count > 0:
                s.spread += math.fabs(total - s.acted_total)
            s.acted_total = total
    if p.late > 0.0:
        late = p.late
        early = 1.0 - late
        last_total = s.acted_total
        last_port = s.acted_port
        last_wall = s.acted_wall
        last_lift = s.inertia.acted
        s.acted_total = total
        s.acted_port = port
        s.acted_wall = wall
        s.inertia.acted = lift
        s.spread += math.fabs(total - last_total)
        total = late * last_total + early * total
        port = late * last_port + early * port
        wall = late * last_wall + early * wall
        lift = late * last_lift + early * lift
    s.effort_sum += total
    s.port_sum += port
    s.wall_sum += wall
    s.inertia.sum += lift
    return tag


def miss_sample(s: AxisState, p: AxisParams, steps: Steps) -> None:
    """Note a cycle without a sample: nothing leaves for the other side, the command stays."""
    s.valid = False
    steps.on_missing(s, p)


def take_sample(s: AxisState, p: AxisParams, m: Sample, steps: Steps) -> None:
    """Close the open interval with a fresh sample, or note that none came."""
    if m.valid:
        close_axis(s, p, m.position, m.effort, steps)
    else:
        miss_sample(s, p, steps)


def close_axis(s: AxisState, p: AxisParams, position: float, outside: float, steps: Steps) -> None:
    """Close all periods since the last sample: books, and what leaves for the other side.

    Before: `pass_slot` has filed `count` slots with their efforts. The energy that the motor took
    from the device is the mean effort times the displacement, exact for an effort held over the
    interval, whatever the motion was in it; where an effort changed within a slot, or was only
    sampled (admittance), the difference that this can make is added to `uncertainty` instead of
    being guessed. Velocity is corrected with the effort that acted, so that a push of the own motor
    does not look like one from outside. Afterwards the interval is empty, and the coupling has
    formed what leaves from the same displacement and effort that were booked.

    Parameters
    ----------
    s, p : AxisState, AxisParams
        The axis.
    position : float
        Measured position [rad or m].
    outside : float
        Measured external effort [N m or N], NaN where none is measured.
    steps : Steps
        Of the coupling.
    """
    site = p.site
    s.valid = True
    count = 1.0
    displacement = position - s.position
    s.position = position
    effort = s.effort_sum
    port = s.port_sum
    wall = s.wall_sum
    span = site.period
    if s.count != 1:
        count = float(s.count)
        effort = effort / count
        port = port / count
        wall = wall / count
        span = count * span
    energy = 0.0
    if p.impedance:
        expected = s.velocity - site.half_mobility * (s.impulse + s.effort_sum)
        s.velocity = track_velocity(site.gain, expected, displacement, span)
        s.impulse = s.effort_sum
        energy = effort * displacement
        if s.spread > 0.0:
            # Where in the interval the device moved is unknown: the whole swing is possible.
            s.uncertainty += s.spread * math.fabs(displacement)
            s.spread = 0.0
    else:
        mean = 0.5 * (s.outside + outside)
        s.uncertainty += 0.5 * math.fabs((outside - s.outside) * displacement)
        s.outside = outside
        s.velocity = displacement / span
        port = mean - wall
        s.port_effort = port
        energy = mean * displacement
    lift = 0.0
    if site.compensates_inertia:
        lift = close_inertia(s, p, displacement, count)
    if site.has_wall or site.compensates:
        s.wall_velocity += site.gain * (displacement / span - s.wall_velocity)
        if site.compensates:
            s.help_absorbed += (effort - port - wall - lift) * displacement
        if site.has_wall:
            before = s.depth
            after = wall_depth(site.wall, position)
            s.depth = after
            taken = wall * displacement
            s.wall_absorbed += taken
            s.wall_dissipated += wall_loss(site.wall, wall, displacement, before, after)
            # What an effort held over a gap between samples gave too much is owed, and is carried
            # from contact to contact; what a contact left over is not.
            balance = s.wall_contact_energy + taken
            if balance >= 0.0:
                s.wall_owes = False
            elif s.count > 1:
                s.wall_owes = True
            if after > 0.0 or s.wall_owes:
                s.wall_contact_energy = balance
            else:
                s.wall_contact_energy = 0.0
    s.port_energy += energy
    if energy < 0.0:
        energy = -energy
    s.gross_flow += energy
    steps.close(s, p, displacement, count, span, port)
    s.effort_sum = 0.0
    s.port_sum = 0.0
    s.wall_sum = 0.0
    s.waited = s.count
    s.count = 0


def pending_effort(s: AxisState, p: AxisParams, table: MutableSequence[float]) -> float:
    """Return the sum of the commands that are still to act, oldest first."""
    pending = 0.0
    for i in range(p.delay):
        at = s.head + i
        if at >= p.delay:
            at = at - p.delay
        pending += table[p.pipe + PIPE * at]
    return pending


def decide_command(
    s: AxisState,
    p: AxisParams,
    table: MutableSequence[float],
    ceiling: float,
    steps: Steps,
) -> int:
    """Decide the next command; return the guard's code (0: all is well).

    Range and velocity are guarded first, on what was measured: no law overrides the limits of an
    axis. A stop that has begun needs no law either. Everything else is computed for the period
    in which the command will act, `delay` periods ahead, so efforts under way are summed first.
    `ceiling` is the engage ramp's [N m, N or rad/s, m/s].
    """
    limit = p.site.limit
    guard = 0
    if not (
        limit.position_low < s.position < limit.position_high
        and -limit.velocity < s.velocity < limit.velocity
    ):
        guard = guard_axis(limit, s.position, s.velocity)  # most often it need not be asked
    if guard != 0 or s.stopping:
        stop_coupled(s, p, ceiling, steps)
        if guard == 0:
            guard = s.alarm
        return guard
    pending = 0.0
    if p.delay > 0:
        pending = pending_effort(s, p, table)
    if p.impedance:
        return decide_effort(s, p, pending, ceiling, steps)
    return decide_velocity(s, p, pending, ceiling, steps)


def decide_effort(s: AxisState, p: AxisParams, pending: float, ceiling: float, steps: Steps) -> int:
    """Decide the effort of an impedance axis; `pending` is the sum of those that act before it.

    Efforts are resisting: positive ones oppose positive motion, and the motor gets `-total`. Each
    element is given the mean velocity that the axis would have in the acting period with all that
    is known before it: first those under way, then the local wall, then compensation, last the
    coupling. So no two elements spend the same damping, and each one's books hold its own work.
    Limits come last and once, over the sum: what they take counts against the coupling, never the
    wall, because only the coupling has a tank that can pay for it. `asked` keeps what was wanted,
    `limited` which limit acted. An alarm of the coupling, or an effort that is not finite, ends in
    the stop's command instead.
    """
    site = p.site
    free_velocity = s.velocity - site.half_mobility * (s.impulse + 2.0 * pending)
    wall = 0.0
    if site.has_wall and s.depth > 0.0:
        energy = s.wall_contact_energy
        paying = s.wall_owes
        wall = render_wall(site, energy, paying, s.depth, s.wall_velocity, free_velocity, ceiling)
    known = wall
    support = 0.0
    if site.compensates:
        support = compensation_effort(site.compensation, s.wall_velocity)
        known = wall + support
    if site.compensates_inertia:
        lift = lighten(s, p, free_velocity - site.half_mobility * known, ceiling)
        support = support + lift
        known = known + lift
    port = steps.compute_effort(s, p, free_velocity - site.half_mobility * known)
    if port - port != 0.0:
        s.alarm = NOT_A_NUMBER
    if s.alarm != 0:
        stop_coupled(s, p, ceiling, steps)
        return s.alarm
    asked = port
    cut = 0.0
    if ceiling < p.ceiling or not -site.clip <= asked <= site.clip:
        port = clip_coupling(site, asked, ceiling, p.ceiling)
        cut = asked - port
    if site.compensates or site.compensates_inertia:
        port = port + support
    wanted = wall + port
    top = ceiling
    if ceiling < p.ceiling:
        top = rising_ceiling(s, p, wanted, free_velocity, ceiling)
    else:
        s.risen = ceiling
    bound = top
    if not -site.sure <= wanted <= site.sure:
        bound = stall_ceiling(site.stall, s.velocity, free_velocity, wanted, top)
    total = limit_effort(site.limit, wanted, s.total, bound)
    s.limited = 0
    if total != wanted:
        s.limited = limited_by(site.limit, wanted, s.total, top)
        if bound < top and math.fabs(wanted) > bound:
            s.limited = STALL_BOUND | limited_by(site.limit, clamp(wanted, bound), s.total, top)
        port = share_effort(wall, port, total)
        wall = total - port
    elif not -site.limit.effort < wanted < site.limit.effort:
        s.limited = AT_LIMIT
    if cut != 0.0:
        if not -site.clip <= asked <= site.clip:
            s.limited = s.limited | CLIPPED
        if ceiling < p.ceiling:
            s.limited = s.limited | RAMPED
        wanted = wanted + cut
    if site.compensates or site.compensates_inertia:
        port = port - support
    s.asked = wanted
    s.total = total
    s.port_effort = port
    s.wall_effort = wall
    s.command = -total
    return 0


def rising_ceiling(
    s: AxisState, p: AxisParams, asked: float, free_velocity: float, ceiling: float
) -> float:
    """Return the bound of an effort under a ceiling that is not at its end [N m or N].

    One that falls, in a release or because it is tuned, is the bound itself.
    """
    risen = s.risen
    s.risen = ceiling
    if not ceiling > risen:
        s.risen = p.ceiling  # for good: none but the engage ramp lets an effort exceed it
        return ceiling
    site = p.site
    moved = s.position - s.begun
    moved = moved - clamp(moved, site.still)
    bound = rising_bound(
        site.limit, asked, s.total, moved, free_velocity, site.half_mobility, ceiling
    )
    if bound > p.ceiling:
        return p.ceiling
    return bound


def decide_velocity(
    s: AxisState, p: AxisParams, pending: float, ceiling: float, steps: Steps
) -> int:
    """Decide the velocity of an admittance axis; `pending` is the sum of those that act before.

    The mirror of `decide_effort`: the coupling answers a measured effort with a velocity, in one
    equation with the local wall's spring and damper where the axis will be when it acts. They
    cannot follow one after the other here: each would see a motion that the other one changes.
    """
    site = p.site
    push, stiffness, damping = wall_ahead(site, s.position, pending)
    asked = steps.move(s, p, pending, push, stiffness, damping)
    if asked - asked != 0.0:
        s.alarm = NOT_A_NUMBER
    if s.alarm != 0:
        stop_coupled(s, p, ceiling, steps)
        return s.alarm
    velocity = limit_velocity(site, asked, ceiling)
    s.asked = asked
    s.limited = 0
    if velocity != asked:
        s.limited = velocity_limited(site, asked, ceiling, velocity)
    s.command = velocity
    s.total = velocity
    s.wall_effort = 0.0
    if stiffness > 0.0:
        s.wall_effort = held_effort(site, push, stiffness, damping, velocity)
    return 0


def render_axis(s: AxisState, p: AxisParams, effort: float, ceiling: float) -> int:
    """Send a resisting effort from elsewhere [N m or N], within limits; return the guard's code."""
    guard = guard_axis(p.site.limit, s.position, s.velocity)
    if guard != 0 or s.stopping:
        stop_axis(s, p, ceiling)
        return guard
    total = limit_effort(p.site.limit, effort, s.total, ceiling)
    s.limited = 0
    if total != effort or math.fabs(effort) >= p.site.limit.effort:
        s.limited = limited_by(p.site.limit, effort, s.total, ceiling)
    s.asked = effort
    s.total = total
    s.port_effort = total
    s.command = -total
    return 0


def decide_axis(
    s: AxisState,
    p: AxisParams,
    table: MutableSequence[float],
    valid: bool,
    ramp: float,
    steps: Steps,
) -> int:
    """Decide the next command; without a sample keep the last one, or let go in a stop."""
    if valid:
        return decide_command(s, p, table, ramp * p.ceiling, steps)
    return miss_axis(s, p, ramp * p.ceiling)


def is_due(p: AxisParams, slot: int) -> bool:
    """Return whether this slot is one in which the axis is read and written."""
    return p.divisor == 1 or slot % p.divisor == p.divisor - 1


def stored_in_wall(s: AxisState, p: AxisParams) -> float:
    """Return the energy in the wall's spring [J]."""
    return wall_stored(p.site.wall, s.depth)


def is_balanced(s: AxisState, p: AxisParams) -> bool:
    """Return whether friction alone may balance what is measured, while no motor acts."""
    return s.outside * s.outside <= p.rest_effort * p.rest_effort


def is_calm(s: AxisState, p: AxisParams, share: float) -> bool:
    """Return True if the wall's effort at the axis' position is below `share` of the limit."""
    if p.site.has_wall:
        effort = wall_effort(p.site.wall, s.depth, 0.0)
        limit = share * p.site.limit.effort
        if effort * effort > limit * limit:
            return False
    return True
