"""Inertia taken off by the motor: exact where the observer follows, bounded by its account."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.analysis.claim import Claim
from tautwave.certificate import certify
from tautwave.certificate.belief import declared_delays
from tautwave.certificate.beside.compensation import inertia_claim
from tautwave.config import Axis, Rig, load_rig
from tautwave.config.keys.load import Load
from tautwave.contracts import CoupledAxis
from tautwave.controller.inertia import close_inertia, lighten, start_inertia
from tautwave.controller.records import AxisParams, AxisState
from tautwave.laws.compensation import follow_play
from tautwave.laws.limit import NO_LIMITS
from tautwave.laws.site import SiteParams
from tautwave.laws.wall import WallParams
from tautwave.rig import axis_allowance
from tautwave.rig.support import inertia_params
from tautwave.simulation import simulate
from tests.lab.inertia import LOWER, attack, felt, lightened_rig

CONFIGS = Path(__file__).parents[2] / "configs"
SIDES = ("master", "slave")
HALF = {"inertia": 0.5, "inertia_coulomb": 0.2}
PERIOD, MASS = 1e-3, 1.5e-3
INF = math.inf


def axis_of(noise: float = 0.0, late: int = 0, **keys: float) -> AxisParams:
    """The constants of a lever half of whose least inertia is taken off."""
    axis = Axis.model_validate(
        {"bus": "b", "id": 1, "kind": "rotary", "effort_limit": 1.0, "velocity_limit": 20.0,
         "inertia": {"value": MASS, "lower": 1e-3, "source": "test"}, "coulomb": 0.02,
         "position_noise": noise, "compensation": {"inertia": 0.5, **keys}}
    )  # fmt: skip
    known = CoupledAxis(PERIOD, 1.0, 1e-3, 0.0, noise, late, 0.0, velocity_limit=20.0)
    wall = WallParams(0.0, 1.0, 0.0, 0.0, controlled=False)
    free = NO_LIMITS
    own = inertia_params(axis, known, 0.5, keys.get("inertia_coulomb", 0.0) * 0.02)
    site = SiteParams(
        PERIOD, 0.5, wall, free, 1.0, 0.0, has_wall=False, inertia=own, compensates_inertia=True
    )
    return AxisParams(site, 0.5 * PERIOD, 0.0, INF, 1.0, late, 0, True, 1, 0.5 * PERIOD, None)


def moved(p: AxisParams, samples: list[float]) -> tuple[AxisState, list[float]]:
    """Move an axis through samples; its state, and the efforts that it asked for."""
    s = AxisState(position=samples[0])
    start_inertia(s, p)
    efforts = []
    for before, after in pairwise(samples):
        s.inertia.sum = s.inertia.effort
        s.position = after
        close_inertia(s, p, after - before, 1.0)
        efforts.append(lighten(s, p, (after - before) / PERIOD, INF))
    return s, efforts


def test_a_steady_acceleration_is_helped_by_exactly_the_share_that_is_taken_off() -> None:
    """R = -m_c a, though the observer believes in half as much again as there surely is."""
    times = PERIOD * np.arange(400)
    _, efforts = moved(axis_of(), (0.5 * 30.0 * times**2).tolist())
    assert efforts[-1] == pytest.approx(-0.5e-3 * 30.0, rel=1e-5)


def test_what_was_before_an_engagement_is_forgotten_in_the_next() -> None:
    p = axis_of()
    used, _ = moved(p, (0.5 * 30.0 * (PERIOD * np.arange(40)) ** 2).tolist())
    start_inertia(used, p)
    fresh = AxisState(position=used.position)
    start_inertia(fresh, p)
    assert used.inertia == fresh.inertia
    close_inertia(fresh, p, 0.0, 1.0)
    assert lighten(fresh, p, 0.0, INF) == 0.0


def test_who_shakes_it_gets_no_more_than_is_claimed_and_more_without_the_account() -> None:
    """`python -m tests.lab compensation --runs 10000` tries more."""
    for seed in range(12):
        got = attack(seed)
        assert got.given <= got.claimed
    free = [attack(seed, account=False) for seed in range(12)]
    assert sum(got.given > got.claimed for got in free) >= 3


@given(st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)), min_size=2, max_size=60))
def test_of_all_motions_within_the_noise_the_play_operators_is_the_shortest(
    motion: list[tuple[float, float]],
) -> None:
    half, play = 0.3, motion[0][0]
    found = 0.0
    for at, off in motion:
        new = follow_play(play, at + half * off, half)
        found += abs(new - play)
        play = new
    true = [at for at, _ in motion]
    assert found <= sum(abs(b - a) for a, b in pairwise(true)) + 1e-12


def test_noise_earns_nothing_at_rest() -> None:
    """Uncharged it would earn G s**2 in every period; friction pays nothing for noise alone."""
    noise, steps = 1e-4, 20_000
    p = axis_of(noise, inertia_hz=30.0, inertia_coulomb=1.0)
    draw = noise * np.random.default_rng(4).standard_normal(steps + 1)
    s, _ = moved(p, draw.tolist())
    feigned = -p.site.inertia.account.income * steps
    assert s.inertia.paid == 0.0
    assert s.inertia.work == pytest.approx(feigned, rel=0.05)
    assert s.inertia.charged == pytest.approx(feigned)


def test_an_overdrawn_account_lets_nothing_act_until_it_is_paid() -> None:
    p = axis_of(inertia_reserve=1e-5)
    times = PERIOD * np.arange(200)
    s, efforts = moved(p, (0.5 * 30.0 * times**2).tolist())
    assert s.inertia.funds >= -p.site.inertia.account.debt
    assert abs(efforts[-1]) < 1e-3
    s.inertia.funds = -2.0 * p.site.inertia.account.debt
    assert lighten(s, p, 1.0, INF) == 0.0


@pytest.mark.parametrize("ceiling", [1.0, 0.5, 0.05])
def test_its_share_falls_with_the_ceiling(ceiling: float) -> None:
    """Else a ramp, or a limit that is tuned, would leave a clipped spring less at this end."""
    p = axis_of()
    p = p._replace(site=p.site._replace(limit=p.site.limit._replace(effort=1.0)))
    s, efforts = moved(p, (0.5 * 900.0 * (PERIOD * np.arange(40)) ** 2).tolist())
    s.inertia.funds, s.inertia.push = 1.0, 1e4
    assert abs(efforts[-1]) < p.site.inertia.most
    assert lighten(s, p, 0.0, ceiling) == pytest.approx(-ceiling * p.site.inertia.most)


def lightened(seconds: float) -> Rig:
    return lightened_rig("position", HALF, 1.5e-5, seconds)


def test_its_books_close() -> None:
    run = simulate(lightened(0.4), engine="python")
    assert run.error is None
    for side in ("master", "slave"):
        part = {what: run[f"lever.inertia_{side}.{what}"]
                for what in ("absorbed", "stored", "dissipated")}  # fmt: skip
        left = part["absorbed"] - part["stored"] - part["dissipated"]
        assert np.max(np.abs(left)) < 1e-15
        assert np.min(part["absorbed"]) < -1e-5


def test_nothing_is_claimed_of_stability_and_the_budget_is_printed() -> None:
    certificate = certify(lightened(1.0))
    assert not certificate.verdicts["coupled_stable"].passed
    assert "inertia_hz" in certificate.verdicts["coupled_stable"].reason
    own = [e for e in certificate.elements if e.kind == "inertia"]
    assert len(own) == 2
    assert own[0].passive.state == "conditional"
    assert own[0].numbers["inertia"] == pytest.approx([0.5 * LOWER, LOWER])
    assert own[0].numbers["coulomb"] == pytest.approx([0.004, 0.02])


@pytest.mark.slow
def test_the_hand_feels_as_much_less_as_is_stated() -> None:
    bare = felt("position", None, 1.5e-5, 2.0, "python")
    for share in (0.4, 0.8):
        one = felt("position", {"inertia": share, "inertia_coulomb": 0.2}, 1.5e-5, 2.0, "python")
        assert bare.inertia - one.inertia == pytest.approx(2.0 * share * LOWER, rel=0.1)


@pytest.mark.slow
@pytest.mark.nightly
def test_python_and_compiled_are_one_to_the_bit() -> None:
    built = load_rig(
        CONFIGS / "bench-position-coupling.yaml",
        [f"{side}.axes.lever.compensation={{inertia: 0.5, coulomb: 0.3}}" for side in SIDES]
        + [f"{side}.axes.lever.velocity_limit=20" for side in SIDES]
        + ["buses.bench.options={command_delay_s: 0.0012}", "duration_s=0.3"],
    )
    rows = [simulate(built, engine=engine).data for engine in ("python", "compiled")]
    assert rows[0].tobytes() == rows[1].tobytes()


@pytest.mark.parametrize("key", ["velocity_limit", "effort_rate_limit"])
def test_without_a_limit_nothing_bounds_what_it_may_give_out(key: str) -> None:
    rig = lightened(1.0)
    axis = rig.master.axes["lever"].model_copy(update={key: None})
    sides = {"master": rig.master.model_copy(update={"axes": {"lever": axis}})}
    found = [e for e in certify(rig.model_copy(update=sides)).elements if e.kind == "inertia"]
    assert [element.passive.passed for element in found] == [False, True]
    assert found[0].passive.reason == (
        f"inertia of master.lever: its energy output is unbounded; give {key}"
    )


def test_what_it_may_give_out_is_claimed_of_the_limits_of_its_axis() -> None:
    rig = lightened(1.0)
    axis = rig.master.axes["lever"]
    assert axis.inertia is not None
    claim = inertia_claim(rig, "master.lever", declared_delays(rig))
    assert isinstance(claim, Claim)
    speed, most = axis.velocity_limit or 0.0, 0.5 * axis.effort_limit
    assert (claim.rate, claim.velocity, claim.effort) == (axis.effort_rate_limit, speed, most)
    assert claim.kinetic == 0.5 * axis.inertia.value * speed**2
    debt = (most * rig.period_s) ** 2 / LOWER
    assert 2.0 * claim.reserve == pytest.approx(0.5 * (0.5 * LOWER) * speed**2 + debt)
    assert claim.blind == rig.loop.missing_limit + rig.overrun_limit


def loaded(seconds: float, rate: float) -> Rig:
    """The same levers, each with a weight whose effort and its error are kept for it."""
    rig = lightened(seconds)
    sides = {}
    for side in SIDES:
        whole = getattr(rig, side)
        axis = whole.axes["lever"].model_copy(
            update={"load": Load(constant=0.2, sine=0.1), "effort_rate_limit": rate}
        )
        sides[side] = whole.model_copy(update={"axes": {"lever": axis}})
    return rig.model_copy(update=sides)


def test_beside_a_load_it_is_claimed_of_what_that_leaves_of_effort_and_rate() -> None:
    rig = loaded(1.0, 800.0)
    axis, delays = rig.master.axes["lever"], declared_delays(rig)
    kept = axis_allowance(rig, "master.lever", delays["master.lever"]).load_effort
    assert 0.2 < kept < 0.4
    claim = inertia_claim(rig, "master.lever", delays)
    assert isinstance(claim, Claim)
    most = 0.5 * (axis.effort_limit - kept)
    assert (claim.effort, claim.rate) == (pytest.approx(most), 400.0)
    debt = (most * rig.period_s) ** 2 / LOWER
    reserve = 0.5 * (0.5 * LOWER) * (axis.velocity_limit or 0.0) ** 2
    assert 2.0 * claim.reserve == pytest.approx(reserve + debt)
    bare = inertia_claim(lightened(1.0), "master.lever", delays)
    assert isinstance(bare, Claim)
    assert claim.under_way > bare._replace(effort=most).under_way  # half the rate: a longer ramp


@pytest.mark.slow
@pytest.mark.parametrize("rate", [60.0, 800.0])
def test_beside_a_load_all_that_is_sent_is_within_the_motor_and_it_gives_no_more_than_is_claimed(
    rate: float,
) -> None:
    """Slow enough a motor, and what is sent lags behind what was asked for."""
    rig = loaded(0.6, rate)
    run = simulate(rig, engine="python")
    assert run.error is None
    for side in SIDES:
        name = f"{side}.lever"
        claim = inertia_claim(rig, name, declared_delays(rig))
        assert isinstance(claim, Claim)
        given = max(0.0, -float(np.min(run[f"lever.inertia_{side}.absorbed"])))
        assert 0.0 < given <= claim.seen(rig.claimed_s)
        sent = run[f"load.{name}.effort"] + run[f"{name}.commanded"]
        assert np.max(np.abs(sent)) <= rig.axes[name].effort_limit
        assert np.max(np.abs(np.diff(sent))) <= rate * rig.period_s * (1.0 + 1e-9)
