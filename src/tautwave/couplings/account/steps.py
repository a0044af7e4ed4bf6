"""The steps of a law in an account. `LAW_...` are those of the law: bound when it is put in."""

from __future__ import annotations

import math

from tautwave.contracts import Row
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
from tautwave.laws.account import (
    APART_S,
    APART_SHRUNK,
    PATIENCE,
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
)
from tautwave.laws.limit import clamp

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
    """Hold nothing."""


def nothing_held(s: AxisState) -> float:
    """Hold nothing [J]."""
    return 0.0


def effort_itself(s: AxisState, p: AxisParams, effort: float) -> float:
    """Ask for no more with more to hold [N m or N]."""
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
