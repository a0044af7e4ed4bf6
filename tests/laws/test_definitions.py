"""Laws against what they are by definition, written another way, and seen in a mirror.

A law of one axis has no preferred direction: with every position, velocity and effort negated its
effort is negated. Exact ties are among the cases: a comparison that turns at its own bound shows.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import pytest

from tautwave.laws.account import (
    APART_SHARE,
    CALM_SHARE,
    HELD_SHARE,
    SENT_SHARE,
    AccountParams,
    brake_effort,
    close_account,
    credit_due,
    credit_received,
    gate_bounds,
    is_apart,
    is_covered,
    lets_go,
    level_friction,
    level_missing,
    planned_bounds,
    planned_share,
)
from tautwave.laws.compensation import (
    NO_COMPENSATION,
    NO_INERTIA,
    CompensationParams,
    InertiaParams,
    compensation_effort,
    follow_play,
    inertia_effort,
    inertia_gain,
)
from tautwave.laws.coupler import coupler_effort, coupler_loss, coupler_stored
from tautwave.laws.lead import HandParams, LeadParams, hand_effort, hand_room, lead_step
from tautwave.laws.limit import (
    LimitParams,
    clamp,
    effort_bound,
    guard_axis,
    limit_effort,
    limited_by,
    rising_bound,
    share_effort,
    slew,
    stop_effort,
    truncate,
)
from tautwave.laws.observer import (
    ReactionParams,
    observe,
    observer_params,
    plain_observer,
    reaction,
)
from tautwave.laws.port import RecoveryParams, port_params, recovery_friction
from tautwave.laws.ramp import (
    NO_RAMP,
    ramp_bound,
    ramp_params,
    ramped_effort,
    stall_bound,
    stall_ceiling,
    stall_params,
)
from tautwave.laws.receiver import (
    output_wave,
    part_of,
    receiver_params,
    surplus,
    timely_wave,
    wanted_wave,
)
from tautwave.laws.rest import brake
from tautwave.laws.rest.alignment import (
    align_effort,
    align_law,
    gate_effort,
    grow_push,
    lead_reference,
    limit_speed,
    move_reference,
)
from tautwave.laws.servo.follower import FollowerParams, goal_effort, next_goal
from tautwave.laws.velocity import track_velocity

LIMIT = LimitParams(1.1, 0.25, 0.125, 3.0, -1.0, 1.0, 0.5)
ACCOUNT = AccountParams(
    0.5, 0.2, 0.1, 0.4, 0.8, 1.0, 1e-3, 0.75, 0.02, 0.3, friction=0.2, slip=0.5, drag=0.1,
    enough=0.5,
)  # fmt: skip
ALIGN = align_law(0.01, 0.05, 1.0, 0.5, 4.0, 1e-3, 1e-3, 4e-3)
BRAKE = brake.BrakeParams(4.0, 0.1, 0.3, 0.125, 1e-3, 0.05, 1e-3, 1e-4, 1e-3, 1e-2)
RAMP = ramp_params(1e-3, 2e-3, 40.0)
STALL = stall_params(0.02, 2e-3, 40.0, 1e-3, 0.1, 0.05)
OBSERVER = observer_params(1e-3, 2e-3, 0.6)
HAND = HandParams(ALIGN, 0.2, 0.0, 0.01, 0.05)
INERTIA = InertiaParams(OBSERVER, 1e-3, 0.6, 0.01, 1e-4, ACCOUNT)
LEAD = LeadParams(0.05, 1.5, 0.4, -1.0, 1.0)
FOLLOWER = FollowerParams(1e-3, 20.0, 0.25, -1.0, 1.0)

Law = Callable[..., Any]
ODD: list[tuple[str, Law, str, str]] = [
    # name, law, which arguments turn (-; / is never 0) and which do not (+), which results turn
    ("clamp", clamp, "-+", "-"),
    ("slew", slew, "--+", "-"),
    ("truncate", truncate, "-+", "-"),
    ("limit_effort", lambda a, b, c: limit_effort(LIMIT, a, b, abs(c)), "--+", "-"),
    ("limited_by", lambda a, b, c: limited_by(LIMIT, a, b, abs(c)), "--+", "+"),
    ("share_effort", share_effort, "---", "-"),
    ("guard_axis", lambda x, v: guard_axis(LIMIT, x, 4.0 * v), "--", "+"),
    ("stop_effort", lambda v: stop_effort(LIMIT, v), "-", "-"),
    ("rising", lambda a, b, c, d: rising_bound(LIMIT, a, b, c, d, 0.25, 0.25), "----", "+"),
    ("coupler", coupler_effort, "++----", "-"),
    ("coupler_loss", coupler_loss, "++--", "+"),
    ("coupler_stored", coupler_stored, "+--", "+"),
    ("friction", lambda v: compensation_effort(CompensationParams(0.2, 0.1, 0.5), v), "-", "-"),
    ("inertia", lambda f, w, v: inertia_effort(INERTIA, f, 900.0 * w, v, 0.25, 1e-3, 0.5),
     "+--", "-"),
    ("play", lambda y, x: follow_play(y, x, 0.25), "--", "-"),
    ("bounds", lambda f, v: sum(gate_bounds(ACCOUNT, f, v, 0.25, 1e-3)), "+-", "-"),
    ("width", lambda f, v: gate_bounds(ACCOUNT, f, v, 0.25, 1e-3)[1], "+0", "+"),
    ("level_friction", lambda v: level_friction(ACCOUNT, v), "-", "-"),
    ("observe", lambda x, v, w, y, f: observe(OBSERVER, x, v, w, y, f, 3.0), "-----", "---"),
    ("plain", lambda x, v, w, y, f: observe(plain_observer(1e-3, 2e-3), x, v, w, y, f, 2.0),
     "-----", "---"),
    ("reaction", lambda v, w: reaction(ReactionParams(OBSERVER, 2e-3, 0.1, 0.2, 0.5), v, w),
     "--", "-"),
    ("velocity", track_velocity, "+--1", "-"),
    ("ramped", lambda e, v, f: ramped_effort(RAMP, 1e-4 * e, v, f), "+--", "-"),
    ("stalled", lambda v, w, f: stall_ceiling(STALL, v, w, f, 0.75), "--/", "+"),
    ("align", lambda r, w, x, v, q: align_effort(ALIGN, r, w, x, v, q), "-----", "-"),
    ("reference", lambda r, w, g: move_reference(ALIGN, r, w, g), "---", "--"),
    ("lead_reference", lambda r, w, x: lead_reference(ALIGN, r, w, x), "---", "--"),
    ("push", lambda q, r, x: grow_push(ALIGN, q, r, x), "---", "-"),
    ("speed", lambda f, v: limit_speed(ALIGN, f, v), "--", "-"),
    ("gate", lambda f, v, s: gate_effort(ALIGN, f, v, abs(s), 0.5), "--+", "-"),
    ("anchor", lambda a, x: brake.drag_anchor(BRAKE, a, x), "--", "-"),
    ("brake", lambda a, v, x: brake.brake_effort(BRAKE, a, v, x), "---", "-"),
    ("takes", lambda d: brake.device_takes(BRAKE, d, 3), "-", "+"),
    ("lead", lambda r, g, x: lead_step(LEAD, r, g, 0.02, x, 1e-3), "---", "-"),
    ("hand", lambda r, w, x, v: hand_effort(HAND, 0.5, r, w, x, v, 0.0, (-0.25, 0.25)),
     "----", "-"),
    ("goal", lambda g, v, x: next_goal(FOLLOWER, g, 200.0 * v, x), "---", "-"),
    ("goal_effort", lambda g, x: goal_effort(FOLLOWER, g, x), "--", "-"),
]  # fmt: skip


def drawn(seed: int, signs: str) -> list[float]:
    """Return arguments on a grid of eighths, so that ties with bounds happen, or between."""
    chance = random.Random(seed)
    numbers = []
    for sign in signs:
        x = chance.randint(-16, 16) / 8.0 if seed % 2 else chance.uniform(-2.0, 2.0)
        numbers.append({"+": abs(x), "-": x, "/": x or 0.125, "1": 0.5, "0": 0.0}[sign])
    return numbers


@pytest.mark.parametrize(("name", "law", "signs", "out"), ODD, ids=[row[0] for row in ODD])
def test_a_law_has_no_preferred_direction(name: str, law: Law, signs: str, out: str) -> None:
    seen = set()
    for seed in range(400):
        args = drawn(seed, signs)
        turned = [-x if sign in "-/" else x for x, sign in zip(args, signs, strict=True)]
        here, there = law(*args), law(*turned)
        pairs = zip(*((v if isinstance(v, tuple) else (v,)) for v in (here, there)), strict=True)
        for (one, other), sign in zip(pairs, out, strict=True):
            assert other == (-one if sign == "-" else one), (name, args)
            seen.add(one)
    assert len(seen) > 1 or name == "width"  # the law depends on what is drawn


def test_limits_are_what_they_say() -> None:
    for seed in range(600):
        a, b, c = drawn(seed, "---")
        bound = abs(b)
        assert clamp(a, bound) == max(-bound, min(bound, a))
        assert slew(a, b, abs(c)) == max(b - abs(c), min(b + abs(c), a))
        assert effort_bound(LIMIT, bound) == min(LIMIT.effort, bound)
        if b:
            whole = math.floor(abs(Fraction(a)) / Fraction(bound))
            assert truncate(a, bound) == math.copysign(float(whole * Fraction(bound)), a)
        assert truncate(a, 0.0) == a
        x, v = 0.5 * a + 0.5 * b, 2.0 * c
        within = -1.0 <= x <= 1.0
        assert guard_axis(LIMIT, x, v) == (1 if not within else 2 if abs(v) > 3.0 else 0)
        # The order of the limits: bound, rate, steps; each is named where it took something.
        cut = max(-min(bound, 1.1), min(min(bound, 1.1), a))
        last = max(-1.0, min(1.0, c))
        slewed = max(last - 0.25, min(last + 0.25, cut))
        assert limit_effort(LIMIT, a, last, bound) == truncate(slewed, 0.125)
        bits = limited_by(LIMIT, a, last, bound)
        assert bool(bits & 2) == (abs(a) >= 1.1)
        assert bool(bits & 16) == (cut != a and bound < 1.1)
        assert bool(bits & 4) == (slewed != cut)
        assert bool(bits & 8) == (truncate(slewed, 0.125) != slewed)
        assert not bits & ~30


def test_multiples_of_a_step_are_kept_though_dividing_rounds() -> None:
    for quantum in (0.1, 0.3, 1e-3, 1.0 / 3.0):
        for count in range(1, 400):
            value = count * quantum
            assert truncate(value, quantum) == value
            assert truncate(-value, quantum) == -value
            assert truncate(math.nextafter(value, 0.0), quantum) == (count - 1) * quantum
            assert truncate(math.nextafter(value, 1e9), quantum) == value


def test_while_the_ceiling_rises_what_resists_may_stop_the_device_and_keep_what_it_has() -> None:
    """Resisting: against the velocity and against the way; 4 T / 2m = 1, so v is stopped by 4 v."""
    for seed in range(400):
        asked, last, moved, along = drawn(seed, "----")
        may = [0.25]
        if asked * moved > 0.0:
            may += [abs(last)] * (last * asked > 0.0)
            may += [min(4.0 * abs(along), LIMIT.effort)] * (along * asked > 0.0)
            if along * asked > 0.0 and 4.0 * abs(along) > LIMIT.effort:
                may = [LIMIT.effort]
        assert rising_bound(LIMIT, asked, last, moved, along, 0.25, 0.25) == max(may)


def test_shares_of_wall_and_port_are_what_they_say() -> None:
    for seed in range(600):
        wall, port, applied = drawn(seed, "---")
        share = share_effort(wall, port, applied)
        side = math.copysign(1.0, wall)
        if wall == 0.0 or side * (applied - wall) >= side * port:
            assert share == (applied if wall == 0.0 else applied - wall)  # nothing is short
            continue
        assert side * (applied - share) >= 0.0  # the wall never pulls
        if side * port <= 0.0:
            assert side * share == min(side * port, side * applied)
        else:
            kept = max(0.0, side * (applied - wall))  # the port that pushes loses first
            assert side * share == min(kept, side * applied)


def test_bounds_of_an_account_give_away_its_funds_and_no_more() -> None:
    mobility, period = 0.25, 1e-3
    for seed in range(300):
        funds, v, smooth = (0.01 * x for x in drawn(seed, "+--"))
        low, high = gate_bounds(ACCOUNT, funds, v, mobility, period)
        against, along = (high, low) if v > 0.0 else (low, high)
        # Along the motion an effort f gives -f (v - M f) T, at the root just all of the funds.
        given = -along * (v - mobility * along) * period
        assert given == pytest.approx(max(funds, 0.0), abs=1e-15)
        assert against == pytest.approx(-along + ACCOUNT.edge * v, abs=1e-15)
        both = planned_bounds(ACCOUNT, funds, v, smooth, mobility, period)
        part = ACCOUNT.share * funds
        calm = gate_bounds(ACCOUNT, CALM_SHARE * part, smooth, mobility, period)
        fast = gate_bounds(ACCOUNT, part, v, mobility, period)
        assert both == (max(fast[0], calm[0]), min(fast[1], calm[1]))
    assert gate_bounds(ACCOUNT, -1.0, 0.5, mobility, period) == (0.0, 0.5 * ACCOUNT.edge)


def test_what_is_covered_for_sure_is_all_within_the_bounds_but_their_last_digits() -> None:
    bare = ACCOUNT._replace(edge=0.0)
    for seed in range(400):
        funds, v, smooth, sign = drawn(seed, "+--/")
        state = (v, smooth, 0.25, 1e-3)
        low, high = planned_bounds(bare, 0.01 * funds, *state)
        assert low == -high
        effort = math.copysign(high, sign)
        assert not is_covered(bare, 0.01 * funds, 1.001 * effort, *state)
        if high > 1e-6:
            assert is_covered(bare, 0.01 * funds, 0.999 * effort, *state)


def test_what_lets_go_of_a_press_and_what_stands_apart() -> None:
    """Over a window of 1,000 periods in which at least 0.05 on average is felt."""
    p = ACCOUNT._replace(felt=0.05)
    for asked, passed, gone, apart in (
        (100.0, 24.0, True, True),
        (100.0, 26.0, False, True),
        (100.0, 41.0, False, False),
        (100.0, -41.0, True, True),
        (-100.0, -39.0, False, True),
        (-100.0, -41.0, False, False),
        (49.0, 0.0, False, False),
        (51.0, 0.0, True, True),
    ):
        assert (lets_go(p, asked, passed), is_apart(p, asked, passed)) == (gone, apart), asked
    assert (HELD_SHARE, APART_SHARE) == (0.25, 0.4)
    # Each of those under way sees an account that the others have not drawn on: at most 1 / e.
    assert planned_share(0) == 1.0
    for late in (1, 2, 5):
        assert planned_share(late) * (1 + late) == pytest.approx(1.0 / 3.0)


def test_what_is_not_there_does_nothing() -> None:
    for seed in range(40):
        v, w, f = drawn(seed, "---")
        assert compensation_effort(NO_COMPENSATION, v) == 0.0
        assert inertia_effort(NO_INERTIA, abs(f), 900.0 * w, v, 0.25, 1e-3, 1.0) == 0.0
        assert ramp_bound(NO_RAMP, f, v) > 1e308
        assert stall_params(0.02, 2e-3, 40.0, 1e-3) == stall_params(
            0.02, 2e-3, 40.0, 1e-3, 0.0, 0.0
        )
    assert stall_bound(stall_params(0.02, 2e-3, 40.0, 1e-3, 0.0, 99.0), 0.0) == 0.0


def test_an_account_books_sends_and_stops_at_its_marks() -> None:
    for seed in range(300):
        funds, income, level = drawn(seed, "---")
        kept, spilled = close_account(ACCOUNT, funds, income)
        assert (kept, spilled) == (min(funds + income, 1.0), max(0.0, funds + income - 1.0))
        assert level_missing(level) == min(1.0, max(0.0, 1.0 - level))
        mark = 0.4 - 0.3 * min(1.0, max(0.0, 1.0 - level / 0.5))
        assert credit_due(ACCOUNT, funds, level) == pytest.approx(
            SENT_SHARE * max(0.0, funds - mark), abs=1e-15
        )
        assert credit_received(funds, income) == max(0.0, funds - income)
        assert brake_effort(ACCOUNT, funds, income) == (income if funds >= -0.2 else 0.0)
        share = max(-1.0, min(1.0, level / 0.5))
        assert level_friction(ACCOUNT, level) == pytest.approx(0.2 * share + 0.1 * level)
    assert brake_effort(ACCOUNT, -0.2, 1.0) == 1.0


def test_compensation_and_springs_are_what_they_say() -> None:
    friction = CompensationParams(0.2, 0.1, 0.5)
    for seed in range(200):
        a, b, c, d = drawn(seed, "----")
        assert compensation_effort(friction, a) == pytest.approx(
            -0.2 * max(-1.0, min(1.0, a / 0.5)) - 0.1 * a
        )
        assert follow_play(a, b, abs(c)) == min(max(a, b - abs(c)), b + abs(c))
        assert coupler_effort(3.0, 0.5, a, b, c, d) == 3.0 * (a - c) + 0.5 * (b - d)
        assert coupler_stored(3.0, a, b) == pytest.approx(1.5 * (a - b) ** 2)
        assert coupler_loss(3.0, a, b, c) == pytest.approx(a - 1.5 * (c * c - b * b))
    # With w = dv/dt + R / m, R = -g m w is -m_c dv/dt.
    gain = inertia_gain(2e-3, 5e-4)
    assert gain == pytest.approx(5e-4 / (1.0 - 5e-4 / 2e-3))
    accelerated = 7.0
    effort = -5e-4 * accelerated
    assert -gain * (accelerated + effort / 2e-3) == pytest.approx(effort)


def test_what_may_be_built_up_is_what_can_be_paid_until_it_is_gone() -> None:
    """F falls by R T a period: I = (F - R T) F / 2R turns the device, and gives what is bounded."""
    period, mass, rate = 1e-3, 2e-3, 40.0
    for seed in range(200):
        energy, against = 1e-3 * drawn(seed, "+")[0], drawn(seed, "--")[1]
        bound = ramp_bound(RAMP, energy, against)
        impulse = (bound - rate * period) * bound / (2.0 * rate)
        speed = impulse / mass - against  # with the effort, once it is gone
        gained = 0.5 * mass * (speed * speed - min(against, 0.0) ** 2)
        if energy > 0.0 and bound > rate * period * (1.0 + 1e-9):
            assert gained == pytest.approx(energy, rel=1e-9, abs=1e-12)
        assert ramped_effort(RAMP, energy, against, 99.0) == bound
    assert ramp_bound(RAMP, 0.0, -1.0) == pytest.approx(rate * period)
    assert ramp_bound(RAMP, -1.0, 0.0) == rate * period


def test_a_stall_gives_what_it_may_and_no_more() -> None:
    hold, mass, rate, energy, doubt = 0.02, 2e-3, 40.0, 1e-3, 0.1
    for seed in range(200):
        along = drawn(seed, "-")[0]
        effort = stall_bound(STALL, along) + 0.05  # beside what carries the load
        impulse = effort * hold + effort * effort / (2.0 * rate)
        before = max(along, 0.0) + doubt
        gained = 0.5 * mass * ((before + impulse / mass) ** 2 - before**2)
        if effort > 0.05:
            assert gained == pytest.approx(energy, rel=1e-9)
        # Of both velocities the one that is more along the effort, which is -f.
        v, w, f = drawn(seed, "---")
        worst = max(-v, -w) if f > 0.0 else max(v, w)
        if f:
            assert stall_ceiling(STALL, v, w, f, 0.75) == min(0.75, stall_bound(STALL, worst))
    assert stall_bound(stall_params(0.02, 2e-3, math.inf, 0.0), 0.0) == 0.0


def test_a_hand_and_its_reference_stay_within_their_bounds() -> None:
    for seed in range(300):
        r, g, x, b, c, last = drawn(seed, "------")
        rate = max(-1.5, min(1.5, (g - r) / 0.02))
        near = max(x - 0.4, min(x + 0.4, r + 1e-3 * rate))
        assert lead_step(LEAD, r, g, 0.02, x, 1e-3) == pytest.approx(max(-1.0, min(1.0, near)))
        low, high = hand_room(HAND, 1.5, b, c, last)
        total = c + last
        assert high + b == pytest.approx(max(-1.5, min(1.5, total + 0.2)))
        assert low + b == pytest.approx(min(1.5, max(-1.5, total - 0.2)))
        wanted = 0.5 * align_effort(ALIGN, r, g, x, b)
        motor = hand_effort(HAND._replace(quantum=0.125), 0.5, r, g, x, b, 0.0, (-0.5, 0.25))
        assert motor == truncate(max(-0.5, min(0.25, wanted)), 0.125)
        assert brake.drag_anchor(BRAKE, r, x) == min(max(r, x - 0.125), x + 0.125)
        sure = max(0.0, abs(g) - 1e-3)
        assert brake.device_takes(BRAKE, g, 3) == pytest.approx(0.05 * sure * sure / 3e-3)
        ahead = max(x - 0.25, min(x + 0.25, r + 1e-3 * g))
        if abs(r) <= 1.0:
            assert next_goal(FOLLOWER, r, g, x) == max(-1.0, min(1.0, ahead)) or abs(x) > 1.0


def test_a_reference_arrives_as_fast_as_speed_and_acceleration_allow() -> None:
    assert hand_effort(HAND, math.nan, 0.1, 0.0, 0.0, 0.0, 0.0, (-1.0, 1.0)) == 0.0
    for target in (0.003, 0.1, -1.2):
        place = rate = 0.0
        steps = 0
        while (place, rate) != (target, 0.0):
            steps, before = steps + 1, rate
            assert steps < 20_000
            place, rate = move_reference(ALIGN, place, rate, target)
            assert abs(rate) <= ALIGN.speed + 1e-12
            assert abs(rate - before) <= ALIGN.acceleration * ALIGN.period + 1e-12
            assert abs(target - place) <= abs(target) + 1e-12
        gap, most, change = abs(target), ALIGN.speed, ALIGN.acceleration
        flat = gap >= most * most / change
        least = gap / most + most / change if flat else 2.0 * math.sqrt(gap / change)
        assert least <= steps * ALIGN.period + 2e-3
        assert steps * ALIGN.period <= 1.02 * least + 4.0 * ALIGN.period


def test_the_friction_of_an_empty_tank_is_all_its_factors() -> None:
    """Full below 2/3 of what `need` counts from, gone at the whole; half of b v at a match."""
    recovery = RecoveryParams(0.4, 0.5, 0.25, 1.0, 2.0, 2.0)
    for slip in (0.0, 2.0):
        port = port_params(1e-3, 0.5, 2e-3, filter_gain=1.0, reserve=1.0, leak=0.0)
        port = port._replace(recovery=recovery, slip=slip, half_mobility=0.125)
        for seed in range(600):
            account, gap, smooth, v, effort = drawn(seed, "+----")
            need = max(0.0, min(1.0, 3.0 - 2.0 * account))
            moves = math.copysign(max(0.0, abs(smooth) - 0.25), smooth)
            ahead = v - 0.125 * effort
            size = need * min(1.0, 2.0 * abs(gap)) * min(0.4, 0.5 * abs(moves))
            if slip:
                size = min(
                    size, max(0.0, (0.5 * ahead / slip - effort) * math.copysign(1.0, ahead))
                )
            expected = math.copysign(size, moves) if moves * ahead > 0.0 else 0.0
            rubs = recovery_friction(port, account, gap, smooth, v, effort)
            assert rubs == pytest.approx(expected, abs=1e-15), (account, gap, smooth, v, effort)


def test_a_receiver_gives_what_is_paid_for_and_all_of_it() -> None:
    """A debt that is paid back by m a tick costs K (2 w m + m**2) more in each of debt / m."""
    p = receiver_params(5e-4, sender_period=5e-4, depth=0.01, fastest=1.0)
    chance = random.Random(3)
    mended = 0
    for _ in range(1500):
        timely = round(chance.choice((0.0, 1.0)) * chance.uniform(-1e9, 1e9))
        rest = round(chance.choice((0.0, 1.0)) * chance.uniform(-1e10, 1e10))
        sign = -1 if rest < 0 else 1
        most = p.scale * timely * timely
        funds = round(chance.uniform(0.0, 3.0) * most + p.scale * chance.uniform(0.0, 1e18))
        want = wanted_wave(p, rest, timely)
        assert want == timely + max(-p.fastest, min(p.fastest, p.repay * rest))
        wave = output_wave(p, funds, rest, timely, 0.5 * timely, want)
        assert p.scale * wave * wave <= max(funds, 1)
        w, mend = sign * timely, sign * (wave - timely)
        if rest and mend > 0 and most < funds:
            costs = [(abs(rest) * (m + 2.0 * w) + float(w) * w) * p.scale for m in (mend, mend + 2)]
            greatest = math.sqrt(funds / p.scale) - w
            assert costs[0] <= funds * (1.0 + 1e-9)
            if mend < min(sign * (want - timely), greatest) * (1.0 - 1e-6) - 2.0:
                assert costs[1] >= funds * (1.0 - 1e-9) - 2.0
                mended += 1
        assert part_of(timely, 3, 3) == part_of(timely, 4, 3) == timely
        assert part_of(timely, 1, 3) == int(timely * (1.0 / 3.0))
        assert timely_wave(p, timely, math.ceil(most)) == timely
        if abs(timely) > 1e7:
            assert timely_wave(p, timely, int(0.25 * most)) == pytest.approx(
                0.25 * timely, rel=1e-3
            )
        need = p.reserve + p.level + p.scale * float(rest) * rest
        for extra in (-3, 0, 1000):
            held = math.ceil(need) + extra
            assert surplus(p, held, rest) == pytest.approx(max(0, extra), abs=1e-9 * need)
    assert mended > 50
