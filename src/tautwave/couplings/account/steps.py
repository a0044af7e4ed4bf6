"""The steps of a law in an account, their state and constants.

`law_...` are functions of the law: bound when it is put in.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from tautwave.config.keys.coupling import Account
from tautwave.contracts import CoupledAxis, Row
from tautwave.controller.records import AxisParams, AxisState, PairParams, PairView
from tautwave.controller.rows import fill_element
from tautwave.controller.steps import (
    OWN_GUARDS,
    no_brake,
    no_close,
    no_effort,
    no_engage,
    no_exchange,
    no_start,
)
from tautwave.errors import ConfigError
from tautwave.laws.account import (
    APART_S,
    APART_SHRUNK,
    FULL,
    LEADER_SHARE,
    PATIENCE,
    SMOOTHED_S,
    TANK_SHARE,
    AccountParams,
    brake_effort,
    close_account,
    credit_due,
    credit_received,
    is_apart,
    is_covered,
    lets_go,
    level_friction,
    level_missing,
    planned_bounds,
    planned_share,
)
from tautwave.laws.limit import clamp


@dataclass(slots=True)
class AccountEnd:
    """One end's tank and books [J, own units].

    `funds` in the tank, `reserve` of them from the start, 0 before; `far_level` of the other end as
    reported, a share of full; `sent` all credit ever sent, `counter` the far one's as last received
    [J, pair's]; `taken` what came of it; `work` what the law took from the device; `spilled` from a
    full tank, `granted` for noise; `smooth` the device's velocity, smoothed [rad/s or m/s]. In this
    second so far `watched` efforts, their sizes as `asked` for and as they were `let` through [N m
    or N], and the seconds before it in which the end `lost` its hold; `held`, the mean of the best
    second. `pull` and `cut` are sums with their signs of what was asked for and what of it was cut,
    `apart` the seconds before in which the pair stood apart for it, `least_cut` the least of them.
    """

    funds: float = 0.0
    reserve: float = 0.0
    far_level: float = 0.0
    sent: float = 0.0
    counter: float = 0.0
    taken: float = 0.0
    work: float = 0.0
    spilled: float = 0.0
    granted: float = 0.0
    smooth: float = 0.0
    asked: float = 0.0
    let: float = 0.0
    watched: int = 0
    lost: int = 0
    held: float = 0.0
    pull: float = 0.0
    cut: float = 0.0
    apart: int = 0
    least_cut: float = 0.0


@dataclass(slots=True)
class AccountLink:
    """Where the line of credits stands."""

    at: int = 0


ACCOUNT_OVERDRAWN = OWN_GUARDS + 50
"""Guard: more was given than the account may owe."""

ACCOUNT_EMPTY = OWN_GUARDS + 51
"""Guard: too little is left to hold what the law presses with."""

ACCOUNT_ASTRAY = OWN_GUARDS + 52
"""Guard: what it cuts of a steady effort leaves the pair apart, and is not led back."""

RINGS = 4
"""Places of the line of credits per slot of delay: a counter and a level each way."""

law_start = no_start
law_engage = no_engage
law_close = no_close
law_exchange = no_exchange
law_effort = no_effort
law_brake = no_brake
law_rings = 0
law_holds = 0


def no_cover(s: AxisState, p: AxisParams, funds: float) -> None:
    """Cover nothing: the law stores no energy of its own."""


def nothing_held(s: AxisState) -> float:
    """Return 0, the energy that the law stores itself [J]."""
    return 0.0


def effort_itself(s: AxisState, p: AxisParams, effort: float) -> float:
    """Return the effort unchanged: more funds would not change it [N m or N]."""
    return effort


law_cover = no_cover
law_held = nothing_held
law_whole = effort_itself


def start_account(s: AxisState, p: AxisParams) -> None:
    """Begin with the reserve, nothing sent."""
    e = s.end.account
    k = p.end.account
    e.funds = k.reserve
    e.reserve = k.reserve
    e.far_level = k.reserve / k.full
    e.sent = 0.0
    e.counter = 0.0
    e.taken = 0.0
    e.work = 0.0
    e.smooth = 0.0
    e.spilled = 0.0
    e.granted = 0.0
    e.asked = 0.0
    e.let = 0.0
    e.watched = 0
    e.lost = 0
    e.held = 0.0
    e.pull = 0.0
    e.cut = 0.0
    e.apart = 0
    e.least_cut = 0.0


def start(pair: PairView, gap: float) -> None:
    """Start the law, with a reserve at both ends and no credit on its way."""
    c, q, one, two, p1, p2, table = pair.c, pair.q, pair.one, pair.two, pair.p1, pair.p2, pair.table
    law_start(pair, gap)
    start_account(one, p1)
    start_account(two, p2)
    c.link.account.at = 0
    at = q.line + law_rings * q.samples
    for i in range(q.samples):
        table[at + i] = 0.0
        table[at + q.samples + i] = 0.0
        table[at + 2 * q.samples + i] = p1.end.account.reserve / p1.end.account.full
        table[at + 3 * q.samples + i] = p2.end.account.reserve / p2.end.account.full


def engage(pair: PairView) -> None:
    """Engage the law."""
    law_engage(pair)


def close(
    s: AxisState, p: AxisParams, displacement: float, count: float, span: float, port: float
) -> None:
    """Book what the effort that acted took; stop beyond the reserve."""
    law_close(s, p, displacement, count, span, port)
    e = s.end.account
    k = p.end.account
    work = port * displacement
    grant = 0.0
    if not s.stopping:
        grant = k.income
    funds, spilled = close_account(k, e.funds, work + grant)
    e.funds = funds
    e.work += work
    e.spilled += spilled
    e.granted += grant
    if not funds >= -k.debt:  # NaN is overdrawn
        s.alarm = ACCOUNT_OVERDRAWN
        s.found = -funds
        s.allowed = k.debt
    law_cover(s, p, funds)


def send_credit(s: AxisState, p: AxisParams, held: float) -> None:
    """Take what is spare from the tank, and not `held` by the law, and add it to the counter."""
    e = s.end.account
    due = credit_due(p.end.account, e.funds - held, e.far_level)
    e.funds -= due
    e.sent += due


def take_credit(s: AxisState, p: AxisParams, counter: float, level: float) -> None:
    """Put what the far counter [J, pair's] adds into the tank; keep the far level."""
    e = s.end.account
    new = credit_received(counter, e.counter)
    if new > 0.0:
        credit = new / p.weight
        e.counter = counter
        e.funds += credit
        e.taken += credit
    e.far_level = level


def exchange_credits(pair: PairView, first: int) -> None:
    """Pass counters and levels one slot on, their line beginning at `first` in the table."""
    c, q, one, two, p1, p2, table = pair.c, pair.q, pair.one, pair.two, pair.p1, pair.p2, pair.table
    ahead = p1.weight * one.end.account.sent
    back = p2.weight * two.end.account.sent
    ahead_level = one.end.account.funds / p1.end.account.full
    back_level = two.end.account.funds / p2.end.account.full
    if q.samples > 0:
        w = c.link.account
        at = first + w.at
        ahead, table[at] = table[at], ahead
        at = at + q.samples
        back, table[at] = table[at], back
        at = at + q.samples
        ahead_level, table[at] = table[at], ahead_level
        at = at + q.samples
        back_level, table[at] = table[at], back_level
        w.at += 1
        if w.at == q.samples:
            w.at = 0
    take_credit(one, p1, back, back_level)
    take_credit(two, p2, ahead, ahead_level)


def exchange(pair: PairView, here: bool, due_one: bool, due_two: bool) -> None:
    """Pass what the law passes, and credits beside it."""
    q, one, two, p1, p2 = pair.q, pair.one, pair.two, pair.p1, pair.p2
    law_exchange(pair, here, due_one, due_two)
    if here:
        send_credit(one, p1, law_held(one))
        send_credit(two, p2, law_held(two))
    exchange_credits(pair, q.line + law_rings * q.samples)


def exchange_over_link(pair: PairView, here: bool, due_one: bool, due_two: bool) -> None:
    """Pass what the law says over a network: credits are in the same packets."""
    one, two, p1, p2 = pair.one, pair.two, pair.p1, pair.p2
    if here:
        send_credit(one, p1, law_held(one))
        send_credit(two, p2, law_held(two))
    law_exchange(pair, here, due_one, due_two)


def exchange_at_master(pair: PairView, here: bool, due_one: bool, due_two: bool) -> None:
    """As over a network, at the master's site: the slave's account is elsewhere."""
    one, p1 = pair.one, pair.p1
    if here:
        send_credit(one, p1, law_held(one))
    law_exchange(pair, here, due_one, due_two)


def exchange_at_slave(pair: PairView, here: bool, due_one: bool, due_two: bool) -> None:
    """As over a network, at the slave's site: the master's account is elsewhere."""
    two, p2 = pair.two, pair.p2
    if here:
        send_credit(two, p2, law_held(two))
    law_exchange(pair, here, due_one, due_two)


def credit(s: AxisState, p: AxisParams) -> float:
    """Return all credit that an end ever sent [J, pair's]."""
    sent: float = p.weight * s.end.account.sent
    return sent


def level(s: AxisState, p: AxisParams) -> float:
    """Return how full a tank is [1]."""
    share: float = s.end.account.funds / p.end.account.full
    return share


def hear(s: AxisState, p: AxisParams, new: float, level: float) -> None:
    """Take the credit [J, pair's] that a word of the far side adds, and its level."""
    e = s.end.account
    take_credit(s, p, e.counter + new, level)


def compute_effort(s: AxisState, p: AxisParams, free_velocity: float) -> float:
    """Return what the account lets through of the law's effort [N m or N]."""
    e = s.end.account
    k = p.end.account
    wanted = law_effort(s, p, free_velocity)
    uncovered = law_whole(s, p, wanted) - wanted
    missing = level_missing(e.far_level)
    e.smooth += k.smoothing * (free_velocity - e.smooth)
    wanted += missing * (k.level_damping * free_velocity + level_friction(k, e.smooth))
    asked = wanted + uncovered
    half = p.site.half_mobility
    period = p.site.period
    if not is_covered(k, e.funds, wanted, free_velocity, e.smooth, half, period):
        low, high = planned_bounds(k, e.funds, free_velocity, e.smooth, half, period)
        if wanted < low:
            wanted = low
        elif wanted > high:
            wanted = high
    watch_hold(s, p, asked, wanted)
    return wanted


def watch_hold(s: AxisState, p: AxisParams, asked: float, passed: float) -> None:
    """Look whether the account holds what the law presses with; stop where it has let go."""
    e = s.end.account
    k = p.end.account
    wanted = clamp(asked, p.site.limit.effort)
    e.asked += math.fabs(wanted)
    e.let += math.fabs(passed)
    e.pull += wanted
    e.cut += wanted - clamp(passed, p.site.limit.effort)
    e.watched += 1
    if e.watched < k.window:
        return
    e.held = max(e.held, e.let / k.window)
    e.lost += 1
    if not lets_go(k, e.asked, e.let):
        e.lost = 0
    if e.lost >= PATIENCE and s.alarm == 0:
        s.alarm = ACCOUNT_EMPTY
        s.found = e.held
        s.allowed = e.asked / k.window
    watch_debt(s, k)
    e.asked = 0.0
    e.let = 0.0
    e.pull = 0.0
    e.cut = 0.0
    e.watched = 0


def watch_debt(s: AxisState, k: AccountParams) -> None:
    """Look whether what a second has cut is led back; stop where it has not been for long."""
    e = s.end.account
    cut = math.fabs(e.cut)
    if not is_apart(k, e.pull, e.pull - e.cut):
        e.apart = 0
        return
    if e.apart == 0 or cut < APART_SHRUNK * e.least_cut:
        e.apart = 0
        e.least_cut = cut
    e.apart += 1
    if e.apart > APART_S and s.alarm == 0:
        s.alarm = ACCOUNT_ASTRAY
        s.found = 0.0  # also of a swing that is cut by more than it asks for on average
        if cut < math.fabs(e.pull):
            s.found = 100.0 * (1.0 - cut / math.fabs(e.pull))
        s.allowed = math.fabs(e.pull) / k.window


def brake(s: AxisState, p: AxisParams, effort: float) -> float:
    """Return what may act of a stop's effort: nothing of an overdrawn account."""
    return brake_effort(p.end.account, s.end.account.funds, law_brake(s, p, effort))


def element_names(q: PairParams, p1: AxisParams, p2: AxisParams) -> list[str]:
    """Return the names of the elements: they take the place of the law's own books."""
    names = ["account_master", "account_slave"]
    if q.samples > 0:
        names.append("credits")
    if law_holds:
        names.append("model_master")
    return names


def element_names_over_link(q: PairParams, p1: AxisParams, p2: AxisParams) -> list[str]:
    """Return the names over a network, which always holds some credit."""
    names = ["account_master", "account_slave", "credits"]
    if law_holds:
        names.append("model_master")
    return names


def fill_account(out: Row, at: int, s: AxisState, p: AxisParams, held: float) -> int:
    """Write the books of one account, less what the law holds."""
    e = s.end.account
    w = p.weight
    absorbed = e.work + e.taken - e.sent - held
    stored = e.funds - e.reserve - held
    return fill_element(out, at, w * absorbed, w * stored, w * (e.spilled - e.granted))


def fill_held(out: Row, at: int, p: AxisParams, held: float) -> int:
    """Write what the law holds at the master: its account paid for it and gets it back."""
    stored = p.weight * held
    return fill_element(out, at, stored, stored, 0.0)


def fill_elements(out: Row, at: int, pair: PairView) -> int:
    """Write the books of both accounts, and the credit on its way."""
    q, one, two, p1, p2 = pair.q, pair.one, pair.two, pair.p1, pair.p2
    held = law_held(one)
    at = fill_account(out, at, one, p1, held)
    at = fill_account(out, at, two, p2, law_held(two))
    if q.samples > 0:
        at = fill_credits(out, at, one, two, p1, p2)
    if law_holds:
        at = fill_held(out, at, p1, held)
    return at


def fill_credits(
    out: Row, at: int, one: AxisState, two: AxisState, p1: AxisParams, p2: AxisParams
) -> int:
    """Write the credit on its way."""
    here = one.end.account
    there = two.end.account
    under_way = p1.weight * (here.sent - here.taken) + p2.weight * (there.sent - there.taken)
    return fill_element(out, at, under_way, under_way, 0.0)


def fill_elements_over_link(out: Row, at: int, pair: PairView) -> int:
    """Write the books of both accounts, and the credit in packets."""
    one, two, p1, p2 = pair.one, pair.two, pair.p1, pair.p2
    held = law_held(one)
    at = fill_account(out, at, one, p1, held)
    at = fill_account(out, at, two, p2, law_held(two))
    at = fill_credits(out, at, one, two, p1, p2)
    if law_holds:
        at = fill_held(out, at, p1, held)
    return at


SLOW = 50.0
"""Periods in which the leader's level damping would bring the device alone to rest."""

NOISE_MARGIN = 0.25
"""Share given beyond what noise and steps would take from an effort that acts at once."""

FRICTIONS = 2.0
"""Times its own Coulomb friction, what a leader resists with for a law that leaves it alone."""

MIN_SHARE = 0.01
"""Of its effort limit, what it resists with at least; its friction may not be identified."""


def late_periods(axis: CoupledAxis) -> int:
    """Return the whole periods until a command acts, a fraction rounded up."""
    return axis.delay + (1 if axis.late > 0.0 else 0)


def account_reserve(keys: Account, axis: CoupledAxis) -> float:
    """Return E0 [J]: as given, or by how much predictions can err in one reversal.

    (F_max (1 + n) T)**2 / m: the work of the greatest effort on the way that the device makes under
    an equal one from outside, until a command that takes it into account acts.
    """
    if keys.reserve is not None:
        return keys.reserve
    assert axis.inertia is not None
    impulse = axis.effort_limit * (1 + late_periods(axis)) * axis.period
    return impulse * impulse / axis.inertia


def model_reserve(keys: Account, axis: CoupledAxis) -> Account:
    """Return the keys with the reserve of an end that renders a model, where none is given.

    It hears of a surface when it is already in it, the deeper the longer the delay, and pays for
    pushing the hand out again: it begins with a quarter of a full tank.
    """
    if keys.reserve is not None:
        return keys
    assert axis.inertia is not None
    kinetic = 0.5 * axis.inertia * axis.velocity_limit**2
    full = TANK_SHARE * kinetic if keys.tank is None else keys.tank
    return keys.model_copy(update={"reserve": max(account_reserve(keys, axis), full / FULL)})


def level_resistance(keys: Account, axis: CoupledAxis, *, alone: bool) -> dict[str, float]:
    """Return friction and drag of a leader on its smoothed velocity, as in `AccountParams`.

    By default there are none, but for a law that leaves the leader `alone`: what feeds the follower
    has to come from the hand somehow. Both together damp the device to a fifth of critical at
    least, late as they are.
    """
    assert axis.inertia is not None
    friction = keys.level_friction
    if friction is None:
        least = MIN_SHARE * axis.effort_limit
        friction = max(FRICTIONS * axis.coulomb, least) if alone else 0.0
    if friction == 0.0:
        return {}
    return {
        "friction": friction,
        "slip": max(
            friction * SMOOTHED_S / (4.0 * axis.inertia), 2.0 * axis.position_noise / SMOOTHED_S
        ),
        "drag": 2.0 * axis.inertia / SMOOTHED_S,
    }


def noise_share(axis: CoupledAxis) -> float:
    """Return what noise takes in a period, per its variance and the gain of an effort [1].

    A sample that is off by n enters the effort as G n and the displacement of the period in which
    it acts as -n, if it acts at once: G s**2 (1 - rho_1). An effort that acts later is as likely to
    meet the one as the other.
    """
    if late_periods(axis) > 0:
        return 0.0
    return 1.0 - (axis.noise_lags[0] if axis.noise_lags else 0.0)


def noise_given(axis: CoupledAxis) -> float:
    """Return what is given for noise and steps in a period per gain [rad**2 or m**2]."""
    variance = axis.position_noise**2 + axis.encoder_quantum**2 / 12.0
    return (noise_share(axis) + NOISE_MARGIN) * variance


def account_params(
    keys: Account, side: str, axis: CoupledAxis, gain: float, *, alone: bool = False
) -> AccountParams:
    """Return the constants of one end, in its device's own units.

    `gain`: by how much the law's effort changes with its newest sample [N m/rad or N/m]; `alone`:
    it has no effort at all for where its own device is.

    Raises
    ------
    ConfigError
        The axis has no velocity limit, so the energy of its commands is unbounded.
    """
    if math.isinf(axis.velocity_limit):
        raise ConfigError(
            f"coupling.account: the {side}'s axis has no velocity_limit, and without it the law's "
            "energy output is unbounded; give its maximum safe velocity"
        )
    assert axis.inertia is not None
    reserve = account_reserve(keys, axis)
    ramp = 0.5 * axis.effort_limit / axis.effort_rate
    kinetic = 0.5 * axis.inertia * axis.velocity_limit**2
    full = max(FULL * reserve, TANK_SHARE * kinetic if keys.tank is None else keys.tank)
    leads = side == keys.leader
    slow = axis.inertia / (SLOW * axis.period)
    level, resistance = 0.0, {}
    if leads:
        level = slow if keys.level_damping is None else keys.level_damping
        resistance = level_resistance(keys, axis, alone=alone)
    late = late_periods(axis)
    edge = min(max(abs(gain) * axis.period, slow, level), axis.inertia / axis.period)
    steepest = max(gain + level / axis.period, edge / axis.period)
    return AccountParams(
        reserve=reserve,
        debt=reserve + axis.effort_limit * axis.velocity_limit * ramp,
        least=reserve if leads else max(reserve, keys.kept * full),
        mark=LEADER_SHARE * full if leads else full,
        full=full,
        capacity=full + kinetic,
        income=steepest * noise_given(axis),
        share=planned_share(late),
        level_damping=level,
        edge=edge,
        enough=1.0 if leads else LEADER_SHARE,
        window=round(1.0 / axis.period),
        felt=max(axis.coulomb, MIN_SHARE * axis.effort_limit),
        smoothing=axis.period / (axis.period + SMOOTHED_S),
        gain=steepest,
        **resistance,
    )
