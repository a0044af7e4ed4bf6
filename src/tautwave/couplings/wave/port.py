"""One end of a wave pair: observer and tank around their laws, and the books."""

from __future__ import annotations

import math
from collections.abc import MutableSequence
from dataclasses import dataclass
from typing import NamedTuple

from tautwave.controller.records import PIPE, TAG, AxisParams, AxisState
from tautwave.controller.steps import OWN_GUARDS
from tautwave.laws.limit import clamp
from tautwave.laws.observer import ObserverParams, observe
from tautwave.laws.port import (
    PortParams,
    port_bounded,
    port_brake,
    port_close,
    port_effort,
    port_repeat,
    recovery_friction,
)
from tautwave.laws.servo.admittance import AdmittanceParams, admittance_velocity
from tautwave.laws.wave_filter import filter_gain


class WaveEndParams(NamedTuple):
    """Constants of one end.

    `admittance` is the law of an axis that takes velocity, which has no observer; `wave` is device
    wave per line wave: sign * sqrt(power ratio); `quantum` by which a command may be off without
    counting as cut, and `step` of the effort [N m or N]; `late` the share of a period for which the
    command before still acts; `window` the periods of a second, `port_starved` the share of its
    waves' energy that may be cut [1]; below `empty` [J] a tank could not pay for its wave;
    `position_debt` the gap [W**0.5 s] that may be owed for `patience` periods without shrinking.
    `coarse`: the greatest step of the effort that the port works with; `noisy`: third differences
    of the samples, squared, beyond which noise takes more than the leak gives [rad**2 or m**2].
    """

    port: PortParams
    observer: ObserverParams
    admittance: AdmittanceParams
    wave: float
    quantum: float
    step: float
    late: float
    delay: int
    window: int
    port_starved: float
    empty: float
    position_debt: float
    patience: int
    coarse: float = math.inf
    noisy: float = math.inf


@dataclass(slots=True)
class WaveEnd:
    """State of one end: observer, tank, waves, and its books [J].

    `at`, `velocity`, `push` are observed: position [rad or m], velocity, acceleration from outside;
    `smooth` is the velocity that friction resists while the end recovers. `account` is what the
    tank holds, `reserve` what it was filled with, 0 before. `wanted` is the last requested effort
    and `under_way` the sum of the port's efforts that are still to act [N m or N]; `cut_left` the
    periods for which an effort that limits cut may still act, `wanted_sum`, `cut_sum`, `gap_sum` of
    the second that is watched, of which `watch_left` periods are left: squares of the waves and
    what of them was not paid, and the gap; `cut_before`, `gap_before` of the second before; `owing`
    the periods for which a large gap was not below `least_gap`; `watched` whether any of these is
    at work, and `third_sum`, `third_count` the third differences of the samples meanwhile, from the
    last displacements `moved`, `moved_before`. `repeats`: slots without a sample in which the last
    wave may leave again. `wave_sum` and `wave_energy` are of the waves whose commands acted since
    the last sample. The `rate_` fields are the rate converter of a slow axis.
    """

    at: float = 0.0
    velocity: float = 0.0
    push: float = 0.0
    smooth: float = 0.0
    account: float = 0.0
    reserve: float = 0.0
    gap: float = 0.0
    filtered: float = 0.0
    wanted: float = 0.0
    under_way: float = 0.0
    wanted_sum: float = 0.0
    cut_sum: float = 0.0
    gap_sum: float = 0.0
    gap_before: float = 0.0
    leaving: float = 0.0
    repeats: float = 0.0
    wave_in: float = 0.0
    arrived: float = 0.0
    wave_sum: float = 0.0
    wave_energy: float = 0.0
    port_absorbed: float = 0.0
    damper_dissipated: float = 0.0
    leaked: float = 0.0
    spilled: float = 0.0
    rate_held: float = 0.0
    rate_mean: float = 0.0
    rate_absorbed: float = 0.0
    rate_dissipated: float = 0.0
    rate_left: int = 0
    rate_count: int = 0
    cut_left: int = 0
    moved: float = 0.0
    moved_before: float = 0.0
    third_sum: float = 0.0
    third_count: int = 0
    steady: int = 0
    least_gap: float = 0.0
    owing: int = 0
    watch_left: int = 0
    cut_before: bool = False
    watched: bool = False


@dataclass(slots=True)
class WaveLink:
    """State between the ends: the energy of the waves on the line [J], and where it stands."""

    line_energy: float = 0.0
    at: int = 0


PORT_OVERDRAWN = OWN_GUARDS
PORT_STARVED = OWN_GUARDS + 1
POSITION_DEBT = OWN_GUARDS + 2
PORT_STARVED_NOISY = OWN_GUARDS + 3
PORT_STARVED_COARSE = OWN_GUARDS + 4
PORT_STARVED_PLAIN = OWN_GUARDS + 5
"""Codes of the reasons to stop."""

WHITE = 20.0
"""Mean square of the third differences of white noise over its variance [1]."""

DECOUPLED = 0.1
"""Share of the waves' energy without which nothing follows, whichever way it is owed."""

OWED_PERIODS = 2.0
"""A gap of the waves of so many periods is felt: on a short line that is all of a held force."""

REPEATS, MAX_REPEATS = 0.25, 8.0
"""Slots without a sample that a sample allows, and as many at most: a fifth, eight in a row."""

SHRUNK = 0.99
"""A gap below this share of what it was is being repaid."""


def start_end(s: AxisState, p: AxisParams, gap: float) -> None:
    """Begin at rest with a full tank; `gap` [rad or m] is an offset to mend."""
    e = s.end
    e.at = s.position
    e.velocity = 0.0
    e.push = 0.0
    e.smooth = 0.0
    e.account = p.end.port.reserve
    e.reserve = e.account
    e.gap = gap * p.end.port.root
    e.filtered = 0.0
    e.wanted = 0.0
    e.under_way = 0.0
    e.wanted_sum = 0.0
    e.cut_sum = 0.0
    e.gap_sum = 0.0
    e.gap_before = 0.0
    e.cut_before = False
    e.watch_left = 0
    e.moved = 0.0
    e.moved_before = 0.0
    e.third_sum = 0.0
    e.third_count = 0
    e.steady = 0
    e.least_gap = 0.0
    e.owing = 0
    e.leaving = 0.0
    e.repeats = 0.0
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
    """Take the wave of this slot; it is booked with the command that it leads to.

    `tag` carries it through the axis' queue of commands, see `on_acted`.
    """
    e = s.end
    wave = p.end.wave * arriving
    e.arrived = arriving
    e.wave_in = wave
    s.tag = wave


def on_acted(s: AxisState, p: AxisParams, tag: float) -> None:
    """Book the wave whose command acted in a slot.

    Not on arrival: with a command delay the tank would be given energy for a motion that comes
    later, alternately hold too much and too little, and clip waves in between.
    """
    e = s.end
    e.wave_sum += tag
    e.wave_energy += p.half_period * tag * tag


def close(
    s: AxisState, p: AxisParams, displacement: float, count: float, span: float, port: float
) -> None:
    """Correct the observer, close the tank, and form the leaving wave.

    Before: the slots since the last sample are filed with efforts and waves that acted in them.
    The observer gets the port's own effort; a local wall's is left out, for to the observer it is
    a contact. The tank gets raw displacement, never the observed one, so that the claim rests on
    samples alone. An effort that limits cut makes the wave pay for its own period, until the last
    command that may still be cut has acted (`delay` + 2). A port that cannot pay, or owes more than
    a period's way, is watched for a second at a time (`watch_port`). Afterwards `leaving` is the
    wave for the line, paid for, and sums are empty.
    """
    e = s.end
    k = p.end
    q = k.port
    asked = s.port_effort
    advance = displacement
    if p.impedance:
        over = asked - e.wanted
        if over != 0.0 and (over > k.quantum or over < -k.quantum):
            e.cut_left = k.delay + 2
            e.watched = True
        effort = port
        if k.observer.pole < 0.0:
            effort = s.effort_sum / count
        if asked != port:
            e.under_way += count * (asked - port)
        last = e.at
        at, velocity, push = observe(
            k.observer, last, e.velocity, e.push, s.position, effort, count
        )
        advance = at - last
        e.at = at
        e.velocity = velocity
        e.push = push
        e.smooth += q.recovery.smoothing * (velocity - e.smooth)
    if s.stopping:
        # A stop's damping acts on the device itself, not through the series damper.
        slipped = q.slip * port * span
        displacement += slipped
        advance += slipped
    leaving, account, gap, filtered, absorbed, dissipated, spilled = port_close(
        q,
        e.account,
        e.gap,
        e.filtered,
        displacement,
        advance,
        count,
        port,
        e.wave_sum,
        e.wave_energy,
        e.cut_left > 0,
    )
    if (
        e.watched
        or not account >= k.empty
        or (gap != 0.0 and not -k.position_debt < gap < k.position_debt)
    ):
        if e.watch_left == 0:
            e.watch_left = k.window
            e.steady = 0
        listen_to(s, displacement, count)
        watch_port(s, k, account, gap, filtered, leaving)
    e.account = account
    e.gap = gap
    e.filtered = filtered
    e.leaving = leaving
    if k.wave != 1.0:
        e.leaving = leaving / k.wave
    e.port_absorbed += absorbed
    e.leaked += count * q.leak
    e.spilled += spilled
    if dissipated != 0.0 and not s.stopping:
        e.damper_dissipated += dissipated
    e.wave_sum = 0.0
    e.wave_energy = 0.0
    if e.repeats < MAX_REPEATS:
        e.repeats += REPEATS


def listen_to(s: AxisState, displacement: float, count: float) -> None:
    """Add up the third differences of the samples: motion has next to none, noise has many."""
    e = s.end
    if count != 1.0:
        e.steady = 0
        return
    if e.steady > 1:
        third = displacement - 2.0 * e.moved + e.moved_before
        e.third_sum += third * third
        e.third_count += 1
    e.moved_before = e.moved
    e.moved = displacement
    e.steady += 1


def watch_port(
    s: AxisState, k: WaveEndParams, account: float, gap: float, wanted: float, leaving: float
) -> None:
    """Look whether the port can still pay and follow; leave reasons to stop, with their numbers.

    `wanted` is the wave before the tank and what it owes, `leaving` the one that was sent.
    """
    e = s.end
    if e.cut_left > 0:
        e.cut_left -= 1
        e.owing = 0
    else:
        whole = wanted * wanted
        kept = leaving * leaving
        e.wanted_sum += whole
        if kept < whole and not account >= k.empty:  # what repays may be smaller as well
            e.cut_sum += whole - kept
    e.gap_sum += gap
    e.watch_left -= 1
    if not account >= -k.port.reserve:  # NaN is overdrawn
        s.alarm = PORT_OVERDRAWN
        s.found = -account
        s.allowed = k.port.reserve
    elif e.watch_left <= 0:
        judge_port(s, k)
    owed = math.fabs(gap)
    e.watched = e.cut_left > 0 or e.watch_left > 0 or owed >= k.position_debt
    if owed < k.position_debt:
        e.owing = 0
        return
    if e.owing == 0 or owed < SHRUNK * e.least_gap:
        e.least_gap = owed
        e.owing = 0
    e.owing += 1
    if e.owing > k.patience and s.alarm == 0:
        s.alarm = POSITION_DEBT
        s.found = owed / k.port.root
        s.allowed = k.position_debt / k.port.root


def judge_port(s: AxisState, k: WaveEndParams) -> None:
    """Judge the second that was watched: how much of the waves' energy the tank has cut.

    A port is starved where that lasts for another second and is nearly all, or does not come back:
    what it owes is more than the waves of a few periods, and as much as before, on average.
    """
    e = s.end
    cut = e.cut_sum > k.port_starved * e.wanted_sum
    if cut and e.cut_before:
        few = OWED_PERIODS * k.port.period
        owes = e.gap_sum * e.gap_sum > few * few * k.window * e.wanted_sum
        lasts = e.gap_sum * e.gap_before >= SHRUNK * e.gap_before * e.gap_before
        if (owes and lasts) or e.cut_sum > DECOUPLED * e.wanted_sum:
            s.found = 100.0 * e.cut_sum / e.wanted_sum
            name_cause(s, k)
    e.cut_before = cut
    e.gap_before = e.gap_sum
    e.wanted_sum = 0.0
    e.cut_sum = 0.0
    e.gap_sum = 0.0
    e.third_sum = 0.0
    e.third_count = 0
    e.watch_left = 0
    if cut:
        e.watch_left = k.window


def name_cause(s: AxisState, k: WaveEndParams) -> None:
    """Leave what most likely emptied the tank, from what is declared and from the last second."""
    e = s.end
    s.alarm = PORT_STARVED
    s.allowed = 100.0 * k.port_starved
    if k.step > k.coarse:
        s.alarm = PORT_STARVED_COARSE
        s.allowed = k.coarse
    elif e.third_count > 0 and e.third_sum > k.noisy * e.third_count:
        s.alarm = PORT_STARVED_NOISY
        s.allowed = math.sqrt(e.third_sum / (WHITE * e.third_count))
    elif k.observer.pole < 0.0 and k.port.half_mobility > 0.0:
        s.alarm = PORT_STARVED_PLAIN


def brake(s: AxisState, p: AxisParams, effort: float) -> float:
    """Return what may act of a stop's effort: nothing of an overdrawn tank."""
    return port_brake(p.end.port, s.end.account, effort)


def repeat_wave(s: AxisState, p: AxisParams) -> float:
    """Return the wave of the last sample for a slot without one, if the tank has it.

    A null wave in the middle of a held force is a blow at the other end: with one slot in a hundred
    lost or skipped, all that is felt is chatter, and the coupling is lost in seconds. Where most
    are lost, repeating would be a hold, which pushes on without looking: null waves are right then.
    """
    e = s.end
    if s.stopping or s.count >= p.blind or e.repeats < 1.0:
        return 0.0
    e.repeats -= 1.0
    wave, e.account, e.gap = port_repeat(p.end.port, e.account, e.gap, e.filtered)
    e.port_absorbed -= p.end.port.half_period * wave * wave
    leaving: float = wave / p.end.wave
    return leaving


def on_missing(s: AxisState, p: AxisParams) -> None:
    """Let the last wave leave once more."""
    s.end.leaving = repeat_wave(s, p)


def compute_effort(s: AxisState, p: AxisParams, free_velocity: float) -> float:
    """Return the resisting effort of the port [N m or N].

    b times the predicted velocity of the acting period, less sqrt(2b) times the wave that arrived
    (`laws.port.port_effort`). On top: the friction with which an emptied tank recovers, while
    something is owed; and what the drive's step took from the effort before, so that the mean is
    exact. The whole is then bounded by what the tank could pay for until the effort is gone again;
    `wanted` keeps it from before that bound, and the difference counts as cut in `close`.
    """
    e = s.end
    k = p.end
    # A local wall is a push from outside to an observer, as an environment is: given its effort,
    # it would take the share that a heavier device does not follow for a push the other way.
    pending = e.under_way
    if k.observer.pole < 0.0:
        # A plain port believes in nothing outside, so it has to know the wall. Of the controller's
        # prediction only what is known of efforts is used: those under way and the wall's. A
        # command that acts late leaves a share of the one before in front of it.
        under_way = s.velocity - p.site.half_mobility * s.impulse - free_velocity
        pending = under_way / (2.0 * k.port.half_mobility)
        if k.late > 0.0:
            pending += k.late * s.acted_total
    effort = port_effort(k.port, e.account, e.velocity, e.push, pending, e.wave_in)
    if e.gap != 0.0:
        ahead = e.velocity + k.port.ahead * e.push - 2.0 * k.port.half_mobility * pending
        effort += recovery_friction(k.port, e.account, e.gap, e.smooth, ahead, effort)
    if k.step > 0.0 and e.account > 0.0:
        # What the drive's step took from the last effort goes on top: the mean is exact, and a
        # port that absorbs is not paid less than it has to send.
        effort += clamp(e.wanted - s.port_effort, k.step)
    e.wanted = effort
    return port_bounded(k.port, e.account, e.velocity, e.push, pending, effort)


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
        wave = table[p.pipe + PIPE * at + TAG]
        total += p.half_period * wave * wave
    return total


def tune(k: WaveEndParams, e: WaveEnd, key: str, value: float, period: float) -> WaveEndParams:
    """Return an end with its filter's corner at `value` [Hz]; nothing else of it is tuned.

    The tank is charged with what goes on the line, after the filter, so no change of the filter
    makes a port give out more than it claims: reserve and leak stay those of the start. What the
    filter still has to send, T y (1 - a) / a of the wave integral, changes with its step a: the
    difference is owed as the gap, or the slave would stay where that much of the wave left it.

    Raises
    ------
    KeyError
        Another key.
    """
    if key != "wave_filter_hz":
        raise KeyError(key)
    old, new = k.port.filter_gain, filter_gain(value, period)
    e.gap += period * e.filtered * ((1.0 - old) / old - (1.0 - new) / new)
    kept = 0.5 * period * (1.0 - new) / new
    return k._replace(port=k.port._replace(filter_gain=new, kept=kept))
