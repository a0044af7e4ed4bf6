"""One end of a wave pair: observer and tank around their laws, and the books."""

from __future__ import annotations

import math
from collections.abc import MutableSequence

from tautwave.controller.records import PIPE, AxisParams, AxisState
from tautwave.controller.steps import OWN_GUARDS
from tautwave.couplings.wave.records import WaveEndParams
from tautwave.laws.admittance import admittance_velocity
from tautwave.laws.observer import observe
from tautwave.laws.port import port_brake, port_close, port_effort

PORT_OVERDRAWN = OWN_GUARDS
LIMP = OWN_GUARDS + 1
ASTRAY = OWN_GUARDS + 2
"""Codes of the reasons to stop."""

FORGOTTEN = 1e-4
"""Share of cut waves that is none."""

SHRUNK = 0.99
"""A gap below this share of what it was is being repaid."""


def start_end(s: AxisState, p: AxisParams, gap: float) -> None:
    """Begin at rest with a full tank; `gap` [rad or m] is an offset to mend."""
    e = s.end
    e.at = s.position
    e.velocity = 0.0
    e.push = 0.0
    e.account = p.end.port.reserve
    e.stored = 0.0
    e.gap = gap * p.end.port.root
    e.filtered = 0.0
    e.wanted = 0.0
    e.cut_share = 0.0
    e.least_gap = 0.0
    e.owing = 0
    e.leaving = 0.0
    e.wave_in = 0.0
    e.arrived = 0.0
    e.wave_sum = 0.0
    e.wave_energy = 0.0
    e.port_absorbed = 0.0
    e.damper_dissipated = 0.0
    e.leaked = 0.0
    e.spilled = 0.0
    e.rate_held = 0.0
    e.rate_mean = 0.0
    e.rate_absorbed = 0.0
    e.rate_dissipated = 0.0
    e.rate_left = 0
    e.rate_count = 0
    e.cut_left = 0
    e.watched = False


def receive_wave(s: AxisState, p: AxisParams, arriving: float) -> None:
    """Take the wave of this slot; it is booked with the command that it leads to."""
    e = s.end
    wave = p.end.wave * arriving
    e.arrived = arriving
    e.wave_in = wave
    s.tag = wave


def act(s: AxisState, p: AxisParams, tag: float) -> None:
    """Book the wave whose command acted in a slot."""
    e = s.end
    e.wave_sum += tag
    e.wave_energy += p.half_period * tag * tag


def close(
    s: AxisState, p: AxisParams, displacement: float, count: float, span: float, port: float
) -> None:
    """Correct the observer, close the tank, and form the leaving wave."""
    e = s.end
    k = p.end
    advance = displacement
    if p.impedance:
        if math.fabs(s.port_effort - e.wanted) > k.quantum:
            e.cut_left = k.delay + 2
            e.watched = True
        at, velocity, push = observe(
            k.observer, e.at, e.velocity, e.push, s.position, s.effort_sum / count, count
        )
        advance = at - e.at
        e.at = at
        e.velocity = velocity
        e.push = push
    slipped = 0.0
    if s.stopping:
        # A stop's damping acts on the device itself, not through the series damper.
        slipped = k.port.slip * port * span
    leaving, account, gap, filtered, absorbed, burnt, spilled = port_close(
        k.port,
        e.account,
        e.gap,
        e.filtered,
        displacement + slipped,
        advance + slipped,
        count,
        port,
        e.wave_sum,
        e.wave_energy,
        e.cut_left > 0,
    )
    if s.stopping:
        burnt = 0.0
    if e.watched or not account >= k.empty or not -k.astray < gap < k.astray:
        watch_port(s, k, account, gap)
    e.account = account
    e.stored = account - k.port.reserve
    e.gap = gap
    e.filtered = filtered
    e.leaving = leaving
    if k.wave != 1.0:
        e.leaving = leaving / k.wave
    e.port_absorbed += absorbed
    e.leaked += count * k.port.leak
    e.spilled += spilled
    if burnt != 0.0 and not s.stopping:
        e.damper_dissipated += burnt
    e.wave_sum = 0.0
    e.wave_energy = 0.0


def watch_port(s: AxisState, k: WaveEndParams, account: float, gap: float) -> None:
    """Look whether the port can still pay and follow; leave reasons to stop, with their numbers."""
    e = s.end
    if e.cut_left > 0:
        e.cut_left -= 1
        e.owing = 0
    elif not account >= k.empty:
        e.cut_share += k.watch
    e.cut_share -= k.watch * e.cut_share
    if not account >= -k.port.reserve:  # NaN is overdrawn
        s.alarm = PORT_OVERDRAWN
        s.found = -account
        s.allowed = k.port.reserve
    elif e.cut_share > k.limp:
        s.alarm = LIMP
        s.found = 100.0 * e.cut_share
        s.allowed = 100.0 * k.limp
    owed = math.fabs(gap)
    e.watched = e.cut_left > 0 or e.cut_share > FORGOTTEN or owed >= k.astray
    if owed < k.astray:
        e.owing = 0
        return
    if e.owing == 0 or owed < SHRUNK * e.least_gap:
        e.least_gap = owed
        e.owing = 0
    e.owing += 1
    if e.owing > k.patience and s.alarm == 0:
        s.alarm = ASTRAY
        s.found = owed / k.port.root
        s.allowed = k.astray / k.port.root


def brake(s: AxisState, p: AxisParams, effort: float) -> float:
    """Return what may act of a stop's effort: none unseen, none of an overdrawn tank."""
    if not s.valid:
        return 0.0
    return port_brake(p.end.port, s.end.account, effort)


def miss(s: AxisState, p: AxisParams) -> None:
    """Let nothing leave."""
    s.end.leaving = 0.0


def think(s: AxisState, p: AxisParams, coast: float) -> float:
    """Return the resisting effort of the port [N m or N]."""
    e = s.end
    k = p.end
    # Of the controller's prediction only what is known of efforts is used: those under way and
    # the wall's. A command that acts late leaves a share of the one before in front of it.
    under_way = s.velocity - p.site.half_mobility * s.impulse - coast
    pending = under_way / (2.0 * k.port.half_mobility)
    if k.late > 0.0:
        pending += k.late * s.acted_total
    effort = port_effort(k.port, e.account, e.velocity, e.push, pending, e.wave_in)
    e.wanted = effort
    return effort


def move(
    s: AxisState,
    p: AxisParams,
    pending: float,
    wall_push: float,
    wall_stiffness: float,
    wall_damping: float,
) -> float:
    """Return the velocity of an axis that takes velocity [rad/s or m/s]."""
    return admittance_velocity(
        p.end.admittance,
        s.outside,
        s.end.wave_in,
        pending,
        wall_push,
        wall_stiffness,
        wall_damping,
    )


def waiting_energy(s: AxisState, p: AxisParams, table: MutableSequence[float]) -> float:
    """Return the energy of waves that arrived but are not booked yet [J]."""
    total: float = s.end.wave_energy + p.half_period * s.tag * s.tag
    for i in range(p.delay):
        at = s.head + i
        if at >= p.delay:
            at = at - p.delay
        wave = table[p.pipe + PIPE * at + 3]
        total += p.half_period * wave * wave
    return total
