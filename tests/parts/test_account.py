"""An account's keys as constants of both ends, and hands of any strength that try to beat it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from tautwave import check
from tautwave.analysis.claim import Claim, joules
from tautwave.certificate import certify
from tautwave.config import Rig
from tautwave.config.keys.coupling import Account
from tautwave.contracts import CoupledAxis
from tautwave.controller.records import AxisParams, AxisState
from tautwave.couplings.account import steps
from tautwave.couplings.account.certificate import claim_of, claimed_joules, flicker_taken
from tautwave.couplings.account.steps import NOISE_MARGIN, account_params
from tautwave.errors import ConfigError
from tautwave.laws.account import CALM_SHARE, AccountParams, credit_due, planned_share
from tautwave.rig import check_ends, command_delays, end_constants, make_control, wall_params
from tautwave.runtime.control import CoupledControl
from tautwave.types import CommandDelay, JointState
from tests.rigs.running import Tree, rig_of, tree

T = 1e-3
AXIS = CoupledAxis(
    T, 1.0, 0.5, 1e-5, 1e-4, 0, 0.0, velocity_limit=10.0, effort_limit=100.0, effort_rate=50.0 / T
)
"""Half a kilogram: a reserve of 0.02 J, 25 J at its velocity limit."""
GAIN = 300.0
NO_DELAY = CommandDelay(0, 0.0)


def end(side: str = "slave", axis: CoupledAxis = AXIS, **keys: Any) -> AccountParams:
    return account_params(Account(**keys), side, axis, GAIN)


@pytest.mark.parametrize("leader", ["master", "slave"])
@pytest.mark.parametrize("kept", [0.0, 0.05, 0.5, 1.0])
def test_the_leader_keeps_a_reserve_to_half_a_tank_and_the_follower_what_the_key_says(
    leader: str, kept: float
) -> None:
    sides = {side: end(side, kept=kept, leader=leader) for side in ("master", "slave")}
    leads = sides.pop(leader)
    [follows] = sides.values()
    assert leads.full == follows.full == pytest.approx(5.0)
    assert (leads.least, leads.mark, leads.enough) == (leads.reserve, 0.5 * leads.full, 1.0)
    least = max(follows.reserve, kept * follows.full)
    assert (follows.least, follows.mark, follows.enough) == (least, follows.full, 0.5)
    assert leads.level_damping == pytest.approx(0.5 / (50.0 * T))
    assert follows.level_damping == 0.0
    assert credit_due(follows, follows.reserve, 0.0) == 0.0


@pytest.mark.parametrize("level", [-1.0, 0.0, 0.3, 0.5, 1.0, 7.0, math.nan])
def test_by_default_the_leaders_level_changes_no_bit_of_what_a_follower_sends(level: float) -> None:
    assert end() == end(kept=1.0)
    for share in (0.0, 0.4, 1.0, 1.1, 3.0):
        funds = share * end().full
        expected = 0.2 * (funds - end().full) if share > 1.0 and level == level else 0.0
        assert credit_due(end(), funds, level) == expected


def test_a_reserve_is_what_a_reversal_may_err_by_and_a_debt_what_a_ramp_holds_on_to() -> None:
    assert end().reserve == pytest.approx(0.02)
    assert end(axis=AXIS._replace(delay=2)).reserve == pytest.approx(0.18)
    assert end(axis=AXIS._replace(delay=1, late=0.2)).reserve == pytest.approx(0.18)
    assert end(reserve=0.3).reserve == 0.3
    assert end().debt == pytest.approx(0.02 + 0.5 * 100.0 * 10.0 * 2e-3)
    assert end(reserve=3.0).full == 12.0
    assert end(tank=1e-3).full == pytest.approx(0.08)
    assert end(tank=30.0).capacity == pytest.approx(30.0 + 25.0)
    late = end(axis=AXIS._replace(delay=1, late=0.2))
    assert (end().share, late.share) == (1.0, planned_share(2))
    # x' = -x(t - n) / 3 (n + 1) stays above 0: each command under way sees an undrawn account.
    assert [planned_share(n) * (n + 1) for n in (1, 7)] == pytest.approx([1.0 / 3.0] * 2)


def test_noise_is_given_a_quarter_more_than_it_takes_where_a_command_acts_at_once() -> None:
    variance = AXIS.position_noise**2 + AXIS.encoder_quantum**2 / 12.0
    at_once = end("master")
    level = 0.5 / (50.0 * T) / T
    assert at_once.income == pytest.approx(1.25 * (GAIN + level) * variance)
    hard = account_params(Account(), "slave", AXIS, -1e9)
    assert hard.edge == 0.5 / T  # a harder damper than that turns the device round
    assert hard.income == pytest.approx(1.25 * hard.edge / T * variance)
    red = end(axis=AXIS._replace(noise_lags=(0.75, 0.1)))
    assert red.income == pytest.approx(end().income * (0.25 + NOISE_MARGIN) / (1.0 + NOISE_MARGIN))
    for later in (AXIS._replace(delay=1), AXIS._replace(late=0.5)):
        assert end(axis=later).income == pytest.approx(end().income * NOISE_MARGIN / 1.25)
    coarse = end(axis=AXIS._replace(position_noise=0.0, encoder_quantum=math.sqrt(12.0 * variance)))
    assert coarse.income == pytest.approx(end().income)


def test_a_flicker_within_a_step_takes_no_more_than_is_said() -> None:
    """Readings off by half a step to either side by turns, beside true noise."""
    axis = AXIS._replace(position_noise=2e-6)
    account = end(axis=axis)
    off = 0.5 * axis.encoder_quantum * np.array([1.0, -1.0] * 500)
    taken = -account.gain * float(np.sum(off[:-1] * np.diff(off))) / (len(off) - 1)
    taken += account.gain * axis.position_noise**2
    assert flicker_taken(axis, account) == pytest.approx(taken - account.income) != 0.0
    fine = AXIS._replace(encoder_quantum=0.0)
    assert flicker_taken(fine, end(axis=fine)) < 0.0


def test_check_says_what_an_account_holds_and_what_noise_takes() -> None:
    """At rest by the reserve alone; no time is promised, since a law may take more than noise."""
    rig = held()
    said = dict(check(rig).facts)
    account = end_constants(rig, "slave.a", command_delays(rig)["slave.a"]).account
    mass = rig.axes["slave.a"].inertia
    assert mass is not None
    force = math.sqrt(0.1 * mass.lower * account.reserve) / T
    text = said["held force at slave.a"]
    assert f"holds {min(force, rig.axes['slave.a'].effort_limit):.3g} N" in text
    assert "; noise as declared takes nothing of it; what contact and the law itself take" in text
    text = dict(check(held(axis={"encoder_quantum": 1e-3})).facts)["held force at slave.a"]
    assert "; a reading that flickers between two encoder steps may take" in text
    assert "at least" not in text


@pytest.mark.parametrize("kept", [-0.1, 1.5, math.nan, math.inf, "half", None, True])
def test_a_share_that_is_none_is_refused_in_a_sentence(kept: Any) -> None:
    with pytest.raises(ConfigError, match=r"coupling\.account\.kept: Input should be"):
        held(kept)


def test_a_law_with_an_account_of_its_own_is_refused_another() -> None:
    with pytest.raises(ConfigError, match="law wave keeps its own accounts; remove the block"):
        rig_of(tree({"coupling.account": {}}))  # whose `auto` keys ask what each axis has


def held(
    kept: Any = 1.0,
    delay: float = 0.003,
    late: int = 0,
    axis: Tree | None = None,
    inertia: float = 0.5,
    law: str = "position",
    **pair: Any,
) -> Rig:
    """A pair in scaled and turned units, its tanks some reserves large and not of one size."""
    scaled = {"position_scale": 2.0, "force_scale": 3.0, "sign": -1}
    data = tree({"coupling.delay_s": delay, "coupling.law": law})
    data["loop"] = {"missing_limit": 1, "overrun_limit": 1}
    data["coupling"]["pairs"]["a"] = {"stiffness": 400.0, "damping": 5.0, **scaled, **pair}
    data["coupling"]["account"] = {"kept": kept, "reserve": 0.05}
    for side, effort, velocity in (("master", 60.0, 7.0), ("slave", 100.0, 5.0)):
        keys = {"effort_limit": effort, "velocity_limit": velocity, "effort_rate_limit": 5e5}
        changed = {**data[side]["axes"]["a"], **keys, **(axis or {})}
        data[side]["axes"]["a"] = {key: it for key, it in changed.items() if it is not None}
    data["simulation"] = {"axes": {"slave.a": {"inertia": inertia}}}
    for bus in ("hand", "arm"):
        data["buses"][bus]["options"] = {"command_delay_s": late * T}
    return rig_of(data)


def test_the_claim_is_that_of_reserve_debt_and_what_is_under_way_whatever_is_kept() -> None:
    rig = held()
    delays = command_delays(rig)
    claim = claim_of(rig, "slave.a", delays)
    assert isinstance(claim, Claim)
    assert 2.0 * claim.reserve == pytest.approx(0.05 + 0.05 + 0.5 * 100.0 * 5.0 * 2e-4)
    assert claim.blind == rig.loop.missing_limit + rig.overrun_limit
    assert claim.leak == claim.owed == 0.0
    for kept in (0.0, 0.05, 0.5):
        assert claim_of(held(kept), "slave.a", delays) == claim
    noisy = held(axis={"position_noise": 1e-4, "encoder_quantum": 1e-5})
    found, account = claim_of(noisy, "slave.a", delays), end_constants(noisy, "slave.a", NO_DELAY)
    assert isinstance(found, Claim)
    assert found.leak == pytest.approx(account.account.income / T) != 0.0
    assert (found.quantum, found.deviation) == (1e-5, 1e-4)
    wall = {"position": 0.1, "stiffness": 1.0, "damping": 0.0}
    walled = held(wall_slave=wall)
    owed = wall_params(walled, "slave.a", NO_DELAY).reserve
    assert claim_of(walled, "slave.a", delays) == claim._replace(owed=owed) != claim
    for key in ("velocity_limit", "effort_rate_limit"):
        axis = rig.slave.axes["a"].model_copy(update={key: None})
        slave = rig.slave.model_copy(update={"axes": {"a": axis}})
        assert claim_of(rig.model_copy(update={"slave": slave}), "slave.a", delays) == key


@pytest.mark.parametrize("kept", [0.0, 1.0])
def test_a_device_that_is_lighter_than_believed_is_not_certified(kept: float) -> None:
    assert certify(held(kept, inertia=0.4)).verdicts["passive"].passed
    found = certify(held(kept, inertia=0.39)).verdicts["passive"]
    assert not found.passed
    assert "account of slave.a" in found.reason


def test_without_a_limit_that_bounds_it_an_account_is_not_certified_or_refused() -> None:
    free = held(axis={"effort_rate_limit": None})
    found = certify(free).verdicts["passive"]
    assert not found.passed
    assert "its energy output is unbounded; give effort_rate_limit" in found.reason
    assert claimed_joules(free, "slave.a", command_delays(free)) == math.inf
    fast = held(axis={"velocity_limit": None})
    with pytest.raises(ConfigError, match=r"the slave's axis has no velocity_limit"):
        check_ends(fast, command_delays(fast))


def test_what_is_certified_of_noise_is_what_may_come_out_in_the_whole_run() -> None:
    rig = held(axis={"position_noise": 1e-4})
    claim = claim_of(rig, "slave.a", command_delays(rig))
    assert isinstance(claim, Claim)
    whole = claimed_joules(rig, "slave.a", command_delays(rig))
    assert whole == pytest.approx(claim.seen(0.0) + claim.leak * rig.claimed_s)
    found = certify(rig)
    assert not found.verdicts["passive_quantised"].passed
    [ours] = [it for it in found.elements if it.name == "account of slave.a"]
    assert ours.numbers["seen_j"] == whole
    assert f"it gives out at most {joules(whole)} as its encoder sees it" in ours.passive.reason


class Hands:
    """Take both devices anywhere within their velocity limits, whatever the motors do."""

    def __init__(self, rig: Rig) -> None:
        self.control: CoupledControl = make_control(rig, command_delays(rig), 10**6)
        self.reach = [0.97 * p.site.limit.velocity * rig.period_s for p in self.control.params]
        self.places = [0.0, 0.0]
        self.given = [0.0, 0.0]
        self.slot = 0
        self.step()

    def step(self) -> None:
        for which, place in enumerate(self.places):
            self.control.take(which, JointState(place, math.nan, math.nan, True, 0), self.slot)
        self.control.step(self.slot, 0)
        self.slot += 1

    def move(self, one: float, two: float) -> None:
        """Move for a period, each as a share of its reach: at 1 the motor gives, at -1 it takes."""
        for which, share in enumerate((one, two)):
            effort = self.control.axes[which].total
            moved = share * self.reach[which] * (-1.0 if effort >= 0.0 else 1.0)
            self.places[which] += moved
            self.given[which] -= effort * moved
        self.step()

    def books(self) -> Iterator[tuple[float, Any, float]]:
        """Yield of each end what it gave in all, credits included, its account and its weight."""
        for s, p, given in zip(self.control.axes, self.control.params, self.given, strict=True):
            account = s.end.account
            yield given - account.taken + account.sent, account, p.weight


def hunt(rig: Rig, seed: int, periods: int = 1500) -> tuple[Hands, list[float]]:
    """Let hands fill, wait and draw by turns; return the most that each end gave [J]."""
    draw, hands, most = np.random.default_rng(seed), Hands(rig), [0.0, 0.0]
    plan, left = (-1.0, -1.0), 50
    for _ in range(periods):
        if left == 0:
            plan = tuple(draw.choice((1.0, 1.0, 0.2, 0.0, -0.2, -1.0), 2))
            left = int(draw.integers(1, 80))
        left -= 1
        hands.move(*plan)
        most = [max(it, gave) for it, (gave, _, _) in zip(most, hands.books(), strict=True)]
        if hands.control.stopped:
            break
    return hands, most


@pytest.mark.parametrize("delay", [0.0, 0.003, 0.3])
@pytest.mark.parametrize("kept", [0.0, 0.05, 0.5, 1.0])
def test_no_hand_draws_more_than_the_claim_whatever_is_kept(kept: float, delay: float) -> None:
    rig = held(kept, delay=delay)
    claims = [claimed_joules(rig, f"{side}.a", command_delays(rig)) for side in ("master", "slave")]
    shares = []
    for seed in range(3):
        hands, most = hunt(rig, seed)
        shares += [it / claim for it, claim in zip(most, claims, strict=True)]
        under_way = 0.0
        for gave, account, weight in hands.books():
            flow = account.sent + account.taken + abs(account.work) + account.reserve
            stored = account.funds - account.reserve + account.spilled - account.granted
            assert stored == pytest.approx(-gave, abs=1e-12 * flow)
            under_way += weight * (account.sent - account.taken)
        assert under_way >= -1e-12
        if delay == 0.0:
            assert under_way == pytest.approx(0.0, abs=1e-12)
    assert 0.1 < max(shares) <= 1.0


def ready(rig: Rig) -> tuple[CoupledControl, AxisState, AxisParams]:
    """Engaged; the controller, and its slave's state and constants."""
    control = Hands(rig).control
    return control, control.axes[1], control.params[1]


def test_each_end_sees_the_others_tank_and_counter_a_delay_later() -> None:
    hands, delay = Hands(held(0.05)), 3
    ends = [
        (s.end.account, p) for s, p in zip(hands.control.axes, hands.control.params, strict=True)
    ]
    said: list[list[tuple[float, float]]] = []
    for k in range(40):
        taken = [e.taken for e, _ in ends]
        hands.move(*((-1.0, -0.5) if k < 30 else (1.0, 0.0)))
        before = [e.funds - (e.taken - it) for (e, _), it in zip(ends, taken, strict=True)]
        said.append(
            [
                (it / p.end.account.full, p.weight * e.sent)
                for it, (e, p) in zip(before, ends, strict=True)
            ]
        )
        for (e, _), far in zip(ends, (1, 0), strict=True):
            if k >= delay:
                assert (e.far_level, e.counter) == pytest.approx(said[-1 - delay][far])
    assert min(sent for _, sent in said[-1]) > 0.0


@pytest.mark.parametrize("stopping", [False, True])
def test_noise_is_given_its_income_in_every_period_but_those_of_a_stop(stopping: bool) -> None:
    _, s, p = ready(held())
    e = s.end.account
    s.stopping, s.port_effort = stopping, 5.0
    p = p._replace(end=p.end._replace(account=p.end.account._replace(income=1e-3)))
    before = e.funds
    steps.close(s, p, 0.0, 1.0, T, 0.0)
    granted = 0.0 if stopping else 1e-3
    assert e.granted == granted
    assert e.funds == before + granted


@pytest.mark.parametrize(("debts", "alarm"), [(1.0, 0), (1.01, 1), (math.nan, 1), (math.inf, 1)])
def test_an_end_stops_beyond_its_debt_and_where_its_funds_are_no_number(
    debts: float, alarm: int
) -> None:
    _, s, p = ready(held())
    s.end.account.funds = -debts * p.end.account.debt
    steps.close(s, p, 0.0, 1.0, T, 0.0)
    assert s.alarm == alarm * steps.ACCOUNT_OVERDRAWN


def test_a_slot_that_nobody_saw_sends_no_credit() -> None:
    control, _, _ = ready(held())
    [pair] = control.view.views
    one, p1 = pair.one, pair.p1
    one.end.account.funds = p1.end.account.full
    for here in (False, True):
        steps.exchange(pair, here, True, True)
        assert (one.end.account.sent > 0.0) == here


def test_over_a_network_credit_is_said_in_the_pairs_joules_and_added_to_what_was_heard() -> None:
    _, s, p = ready(held())
    e = s.end.account
    e.sent = 4.0
    assert steps.credit(s, p) == p.weight * 4.0 != 4.0
    for _ in range(2):
        steps.hear(s, p, 0.25, 0.125)
    assert (e.counter, e.taken, e.far_level) == (0.5, 0.5 / p.weight, 0.125)


@pytest.mark.parametrize("late", [0, 2])
def test_a_command_plans_to_give_its_share_of_the_funds(late: int) -> None:
    """A tenth of it at a smoothed velocity."""
    control, s, p = ready(held(late=late))
    s.end.account.funds = 0.5
    s.end.far_position = s.position - 1e9
    free_velocity, half = -2.0, p.site.half_mobility
    for smooth, share in ((free_velocity, CALM_SHARE), (-1e3 * free_velocity, 1.0)):
        s.end.account.smooth = smooth
        effort = control.law.steps.compute_effort(s, p, free_velocity)
        planned = -effort * T * (free_velocity - half * effort)
        assert planned == pytest.approx(share * planned_share(late) * 0.5)


def test_a_model_at_the_master_holds_what_its_account_has() -> None:
    control, _, _ = ready(held(law="mediated"))
    s, p = control.axes[0], control.params[0]
    s.end.account.funds = 0.125
    control.law.steps.close(s, p, 0.0, 1.0, T, 0.0)
    assert s.end.funds == 0.125


def test_nothing_of_a_session_before_is_left_at_the_start_of_the_next() -> None:
    """Else the second would find a tank, or a counter, that the other end knows nothing of."""
    hands, _ = hunt(held(0.05), 0, 200)
    control, new = hands.control, Hands(held(0.05)).control
    for it in (control, new):
        [pair] = it.view.views
        it.law.steps.start(pair, 0.0)
    assert [s.end.account for s in control.axes] == [s.end.account for s in new.axes]
    assert control.states[0].link.account == new.states[0].link.account
    ring = control.pairs[0].line + control.law.rings * 3 - 4 * 3
    assert control.table[ring:] == new.table[ring:]
