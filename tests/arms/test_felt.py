"""What the hand feels of the slave's loads: at the slave's place, only while coupled, in books."""

from __future__ import annotations

import math
import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tautwave.certificate.belief import declared_delays
from tautwave.certificate.beside.loads import load_element
from tautwave.config import Rig, load_rig
from tautwave.models.load import LoadParams, load_effort
from tautwave.rig import build_rig
from tautwave.rig.arms import greatest_loads
from tautwave.rig.carrying import _chain_weighing, felt_swing, side_loads
from tautwave.runtime.carrying.felt import FeltLoad, FeltPlace
from tautwave.runtime.carrying.side import CarriedAxis, SideLoad
from tautwave.runtime.operate.commands import Order, Script
from tautwave.session.operating import with_operation
from tautwave.simulation.memory import run_in_memory

BENCH = Path(__file__).parents[2] / "configs" / "bench-1dof-loopback.yaml"
ARMS = BENCH.with_name("arms-loopback.yaml")
SLAVE = 9.81  # N m, what the slave's mass at a metre weighs
RAMP = 20
RIG = (
    "operate={start: engaged}",
    "slave.axes.lever.load={sine: -0.05, reflect_load: true}",
    "simulation.axes.slave.lever.load={sine: -0.05}",
    "coupling.pairs.lever.offset=0.0",
    "coupling.pairs.lever.engage_tolerance=0.02",
    "simulation.environment.lever={type: free}",
    "require=coupled_stable",
)


def heights(x: Any) -> tuple[list[float], float]:
    return [SLAVE * math.cos(x[0])], SLAVE * math.sin(x[0])


def nothing(_: Any) -> tuple[list[float], float]:
    return [0.0], 0.0


def hand(ratio: float = 1.0, power: float = 1.0) -> SideLoad:
    """Return a master that weighs nothing, before it is coupled at x_slave = ratio x_master."""
    axis = CarriedAxis("master.lever", 100.0, math.inf, 0.0, 0, 0.0)
    felt = FeltLoad(heights, [FeltPlace("lever", 0, ratio, 0.0)], power, RAMP, coupled=False)
    return SideLoad("master", [axis], nothing, felt=felt)


def pass_slot(load: SideLoad, x: float) -> float:
    load.pass_slots(0, 1)
    load.take(0, x)
    return load.effort(0)


def books(load: SideLoad) -> dict[str, float]:
    row = [0.0] * len(load.columns)
    load.fill(row, 0)
    return dict(zip(load.columns, row, strict=True))


def test_it_is_felt_at_the_offset_of_the_engagement_and_only_while_coupled() -> None:
    load = hand(ratio=-0.5, power=0.25)
    x = 0.3
    assert [pass_slot(load, x) for _ in range(3)] == [0.0] * 3
    for offset in (0.0, 0.4):
        load.engage({"lever": offset})
        found = [pass_slot(load, x) for _ in range(RAMP + 2)]
        whole = 0.5 / 0.25 * SLAVE * math.cos(-0.5 * x + offset)
        assert found[-1] == pytest.approx(whole)
        steps = np.diff([0.0, *(value for value in found if value != whole), whole])
        assert steps == pytest.approx(whole / RAMP)
        load.disengage()
        assert [pass_slot(load, x) for _ in range(RAMP)][-1] == 0.0
        assert pass_slot(load, x) == 0.0
    assert abs(books(load)["load.master.changed"]) < 1e-12  # all that was put in came back
    assert abs(books(load)["load.master.leak"]) < 1e-12


def test_an_engagement_that_comes_early_waits_until_the_last_one_has_faded() -> None:
    """From its middle down, then up at the new place: no step anywhere."""
    load = hand()
    load.engage({"lever": 0.0})
    for _ in range(RAMP + 1):
        pass_slot(load, 0.0)
    load.disengage()
    half = [pass_slot(load, 0.0) for _ in range(RAMP // 2)][-1]
    assert half == pytest.approx(-SLAVE / 2)
    load.engage({"lever": math.pi})
    found = [half, *(pass_slot(load, 0.0) for _ in range(RAMP // 2 + RAMP + 2))]
    assert max(abs(np.diff(found))) < 1.01 * SLAVE / RAMP
    assert found[-1] == pytest.approx(SLAVE)
    changed = books(load)["load.master.changed"]
    assert changed == pytest.approx(0.0, abs=1e-12)  # sin(0) and sin(pi): no height in either


def test_an_engagement_at_the_same_place_does_not_fade_first() -> None:
    load = hand()
    load.engage({"lever": 0.0})
    for _ in range(RAMP + 1):
        pass_slot(load, 0.0)
    load.disengage()
    for _ in range(3):
        pass_slot(load, 0.0)
    load.engage({"lever": 0.0})
    assert pass_slot(load, 0.0) < -SLAVE * (1.0 - 3.5 / RAMP)


def test_devices_that_were_reset_within_the_ramp_weigh_nothing_of_it_any_more() -> None:
    load = hand()
    load.engage({"lever": 0.0})
    for _ in range(RAMP + 1):
        pass_slot(load, 0.3)
    load.disengage()
    for _ in range(RAMP // 4):
        pass_slot(load, 0.3)
    before = books(load)
    load.drop(0)
    assert [pass_slot(load, -0.4) for _ in range(3)] == [0.0] * 3  # it fell meanwhile
    after = books(load)
    assert after["load.master.leak"] == pytest.approx(before["load.master.leak"])
    assert after["load.master.changed"] == before["load.master.changed"]
    pass_slot(load, 0.3), pass_slot(load, 0.3)
    load.engage({"lever": 0.2})
    found = [pass_slot(load, 0.3) for _ in range(RAMP + 1)]
    assert found[0] == pytest.approx(-SLAVE * math.cos(0.5) / RAMP)
    assert found[-1] == pytest.approx(-SLAVE * math.cos(0.5))


def test_a_rig_that_is_not_operated_feels_all_of_it_again_after_its_devices_were_reset() -> None:
    felt = FeltLoad(heights, [FeltPlace("lever", 0, 1.0, 0.0)], 1.0, RAMP, coupled=True)
    axis = CarriedAxis("master.lever", 100.0, math.inf, 0.0, 0, 0.0)
    load = SideLoad("master", [axis], nothing, felt=felt)
    for _ in range(2):
        load.drop(0)
        assert pass_slot(load, 0.3) == pytest.approx(-SLAVE * math.cos(0.3))


@pytest.mark.parametrize("power", [0.7, 0.91, 1.11])
def test_a_rig_that_is_not_operated_feels_it_to_the_bit(power: float) -> None:
    """A whole share is no factor: recordings of such rigs are those of version 0.1.0."""
    felt = FeltLoad(heights, [FeltPlace("lever", 0, 0.7, 0.1)], power, 500, coupled=True)
    for x in (0.1, 0.3, 1.1):
        efforts = [0.0]
        height = felt.add([x], efforts)
        held, above = heights([0.7 * x + 0.1])
        assert efforts == [-(0.7 / power * held[0])]
        assert height == -above / power


@pytest.mark.sparse(3)
@pytest.mark.parametrize("seed", range(12))
def test_a_hand_that_clutches_as_it_likes_gets_no_more_than_was_stated(seed: int) -> None:
    """The slave stands while the hand is clutched, and is where the master stands else.

    The hand goes down coupled and up clutched, or whatever it likes: in all it gets the height
    that the slave has lost, and a swing of the potential for each of the ramps at most.
    """
    rng = random.Random(seed)
    load = hand()
    place = x = offset = 0.0
    coupled, ramps, most = False, 0, 0.0
    for _ in range(200):
        if coupled:
            load.disengage()
        else:
            offset = place - x
            load.engage({"lever": offset})
        coupled, ramps = not coupled, ramps + 1
        aim = place + (-1.0 if rng.random() < 0.8 else 1.0) * rng.uniform(0.0, 1.0)
        goal = max(-1.5, min(aim, 1.5)) - offset if coupled else rng.uniform(-3.0, 3.0)
        steps = rng.choice((5, 15, 60, 400))
        start = x
        for k in range(steps):
            x = start + (goal - start) * (1 - math.cos(math.pi * (k + 1) / steps)) / 2
            if coupled:
                place = x + offset
            pass_slot(load, x)
            got = -books(load)["load.master.lever.energy"]
            most = max(most, got - 2 * SLAVE * (ramps + 1))
    found = books(load)
    assert most <= 0.0
    assert found["load.master.leak"] == pytest.approx(
        found["load.master.lever.energy"] + found["load.master.potential"], abs=1e-9
    )
    # Held at the middle of strides as coarse as these, it misses its work by their square.
    assert abs(found["load.master.leak"]) < 0.05 * 2 * SLAVE * ramps


def run(*more: str) -> dict[str, Any]:
    orders = [(1_200_000_000, Order("clutch")), (1_700_000_000, Order("engage"))]
    points = "[[0, 0], [1.2, 0], [1.6, 0.2], [2.4, 0.2], [3.0, -0.2], [4.5, -0.2]]"
    led = f"simulation.hand.lever.reference={{type: minimum_jerk, waypoints: {points}}}"
    rig = load_rig(BENCH, [*RIG, led, "duration_s=4.5", *more])
    built = with_operation(rig, build_rig(rig, clock="fake"), [Script(orders)], [])
    result, data = run_in_memory(built)
    assert result.error is None
    return dict(zip(built.columns, data.T, strict=True))


@pytest.mark.parametrize("scale", [1.0, 0.5])
def test_after_a_clutch_the_hand_feels_what_the_slave_weighs_where_it_stands(scale: float) -> None:
    table = run(f"coupling.pairs.lever.position_scale={scale}")
    felt, state = table["load.master.lever.effort"], table["operation.state"]
    x, y = table["master.lever.position"], table["slave.lever.position"]
    clutched = np.flatnonzero(state == 3)
    assert len(clutched) > 400
    assert abs(felt[clutched[-1]]) < 1e-3  # half a second after the clutch it has faded
    again = clutched[-1] + int(np.flatnonzero(state[clutched[-1] :] == 2)[0])
    offset = y[again] - scale * x[again]
    assert abs(offset) > 0.15 * scale
    late = slice(-300, None)
    params = LoadParams(0.0, 0.0, -0.05)
    weight = np.array([load_effort(params, at) for at in scale * x[late] + offset])
    assert felt[late] == pytest.approx(scale * weight, abs=2e-4)
    carried = table["load.slave.lever.effort"][late]
    assert scale * carried == pytest.approx(-felt[late], abs=4e-3)  # friction holds it apart
    assert min(abs(felt[late])) > 4e-3
    assert table["load.master.given"][-1] < 1e-5


def test_it_is_ramped_no_faster_than_efforts_may_change() -> None:
    rig = load_rig(BENCH, [*RIG, "master.axes.lever.effort_rate_limit=0.05"])
    sides, _ = side_loads(rig, declared_delays(rig))
    master = sides[0]
    pass_slot(master, 0.3)
    master.engage({"lever": 0.4})
    efforts = [pass_slot(master, 0.3) for _ in range(2500)]
    params = LoadParams(0.0, 0.0, -0.05)
    assert efforts[-1] == pytest.approx(load_effort(params, 0.7))
    assert max(abs(np.diff(efforts))) < 0.5 * 0.05 * rig.period_s
    assert abs(books(master)["load.master.leak"]) < 1e-12


def test_check_states_what_an_engagement_may_supply() -> None:
    rig = load_rig(BENCH, list(RIG))
    found = load_element(rig, "master.lever", declared_delays(rig))
    assert found is not None
    # From the end of the slave's range, 0.5 rad, the hand may move on by 1 rad as it lets go.
    assert found.numbers["engage_j"] == pytest.approx(1.1 * 0.05 * (1.0 - math.cos(1.5)), rel=1e-4)
    assert "Each engagement, and each end of one, may supply up to" in found.passive.reason
    strong = load_rig(BENCH, [*RIG, "coupling.pairs.lever.force_scale=2.0"])
    assert felt_swing(strong) == pytest.approx(found.numbers["engage_j"] / 2.0)
    scales = ("position_scale=2.0", "force_scale=0.5")
    far = load_rig(BENCH, [*RIG, *(f"coupling.pairs.lever.{scale}" for scale in scales)])
    assert felt_swing(far) == pytest.approx(1.1 * 0.05 * (1.0 - math.cos(2.5)), rel=1e-4)
    plain = load_rig(BENCH, [*RIG, "operate=null", "duration_s=1.0"])
    assert felt_swing(plain) == 0.0
    sides, _ = side_loads(plain, declared_delays(plain))
    assert "load.master.changed" not in sides[0].columns


def two_levers(master: str = "", *more: str) -> Rig:
    """Return the bench with a second lever, which weighs something, and is not reflected."""
    axis = "{bus: %s, id: 2, kind: rotary, inertia: {value: 1.5e-3, lower: 1.0e-3, source: x}, "
    axis += "effort_limit: 1.1, velocity_limit: 15, position_range: [-0.5, 0.5]%s}"
    keys = [f"master.axes.other={axis % ('hand', master)}"]
    keys += [f"slave.axes.other={axis % ('arm', ', load: {cosine: -0.3}')}"]
    keys += ["coupling.pairs.other={wave_impedance: 0.02, pole_master: 0.3, pole_slave: 0.3}"]
    return load_rig(BENCH, [*RIG, *keys, *more])


def test_what_one_lever_weighs_itself_and_what_is_felt_on_the_other_are_one_sum() -> None:
    """On a rig that is not operated, at the rig's offset and scale, from the first sample on."""
    place = ["coupling.pairs.lever.offset=0.1", "coupling.pairs.lever.position_scale=0.5"]
    place += ["coupling.pairs.lever.force_scale=2.0", "operate=null", "duration_s=1.0"]
    rig = two_levers(", load: {cosine: -0.2, sine: 0.1}", *place)
    (load, _), _ = side_loads(rig, declared_delays(rig))
    for k in range(1000):
        x = 0.3 * math.sin(0.003 * k), 0.2 * math.sin(0.005 * k)
        for which in range(2):
            load.pass_slots(which, 1)
            load.take(which, x[which])
        found = [load.effort(which) for which in range(2)]
    felt = -0.05 * math.sin(0.5 * (x[0] - 0.1)) / 2.0
    own = 0.2 * math.cos(x[1]) - 0.1 * math.sin(x[1])
    assert found == pytest.approx([felt, own], abs=1e-4)
    assert abs(books(load)["load.master.lever.energy"]) > 1e-5
    assert abs(books(load)["load.master.other.energy"]) > 1e-3
    assert abs(books(load)["load.master.leak"]) < 1e-6


def test_a_weight_that_the_hand_does_not_feel_is_none_of_an_engagements() -> None:
    """Of two levers one is reflected; the other one's weight is the slave's motor's alone."""
    both = two_levers()
    assert felt_swing(both) == pytest.approx(felt_swing(load_rig(BENCH, [*RIG])))
    load = side_loads(both, declared_delays(both))[0][0]
    pass_slot(load, 0.0)
    load.engage({"lever": 0.1})
    found = [pass_slot(load, 0.3 * math.sin(0.003 * k)) for k in range(2601)]
    assert found[-1] == pytest.approx(-0.05 * math.sin(0.1 + 0.3 * math.sin(7.8)), abs=1e-4)
    assert abs(books(load)["load.master.leak"]) < 1e-6


@pytest.mark.parametrize("sine", [-0.05, 0.05])
@pytest.mark.parametrize("seconds", [0.1, 0.25, 0.5])
def test_a_hand_that_moves_on_while_it_fades_gets_no_more_than_check_states(
    sine: float, seconds: float
) -> None:
    """With the slave at one end of its range and the master at the other of its own."""
    keys = f"load={{sine: {sine}, reflect_load: true}}"
    rig = load_rig(BENCH, [*RIG, f"slave.axes.lever.{keys}"])
    sides, _ = side_loads(rig, declared_delays(rig))
    load, x = sides[0], 0.5
    pass_slot(load, x)
    load.engage({"lever": -1.0})
    for _ in range(600):
        pass_slot(load, x)
    load.disengage()
    steps = round(seconds * rig.rate_hz)
    for k in range(steps + 600):
        x = 0.5 - min((k + 1) / steps, 1.0)
        pass_slot(load, x)
    found = books(load)
    assert abs(found["load.master.lever.energy"]) > 0.01
    assert abs(found["load.master.lever.energy"]) < felt_swing(rig)
    assert abs(found["load.master.leak"]) < 1e-5  # its weight beyond the range is not clipped


def test_a_ramp_books_no_more_than_check_states_wherever_the_potentials_zero_is() -> None:
    narrow = [f"{side}.axes.lever.position_range=[0.4, 0.5]" for side in ("master", "slave")]
    narrow += [f"coupling.pairs.lever.wall_{side}=null" for side in ("master", "slave")]
    narrow += [f"simulation.axes.{side}.lever.start_position=0.42" for side in ("master", "slave")]
    rig = load_rig(BENCH, [*RIG, *narrow])
    load = side_loads(rig, declared_delays(rig))[0][0]
    pass_slot(load, 0.42)
    load.engage({"lever": 0.0})
    for _ in range(600):
        pass_slot(load, 0.42)
    booked = -0.05 * (math.cos(0.45) - math.cos(0.42))
    assert books(load)["load.master.changed"] == pytest.approx(booked)
    assert abs(booked) < felt_swing(rig) < 0.01 < 0.05 * math.cos(0.42)


def leader(*more: str) -> Rig:
    """Return two arms of which the leader feels the follower while it is engaged."""
    keys = ["operate={}", "slave.arm.reflect_load=true", *more]
    for name in load_rig(ARMS).coupling.pairs:
        keys += [f"coupling.pairs.{name}.{key}" for key in ("offset=0.0", "engage_tolerance=0.2")]
    return load_rig(ARMS, keys)


@pytest.mark.parametrize("power", [1.0, 2.0])
def test_what_an_engagement_of_arms_may_supply_is_from_straight_down_to_straight_up(
    power: float,
) -> None:
    names = load_rig(ARMS).coupling.pairs
    rig = leader(*(f"coupling.pairs.{name}.force_scale={power}" for name in names))
    arm = rig.slave.arm
    assert arm is not None
    weigh = _chain_weighing(arm)
    up, down = ([0.0, at, 0.0, 0.0, 0.0, 0.0] for at in (math.pi / 2, -math.pi / 2))
    most = (weigh(up)[1] - weigh(down)[1]) / power
    assert most < felt_swing(rig) < 1.12 * most
    delays = declared_delays(rig)
    found = [load_element(rig, f"master.{name}", delays) for name in names]
    assert [one is not None and "engage_j" in one.numbers for one in found] == [True, *[False] * 5]


def test_what_is_kept_for_the_follower_counts_where_a_leader_that_lets_go_may_point() -> None:
    """The follower only points up, where its shoulder bears little; the leader turns by 3 rad."""
    up = ["slave.axes.shoulder.position_range=[1.4, 1.5]"]
    up += [f"simulation.axes.{side}.shoulder.start_position=1.45" for side in ("master", "slave")]
    found = [greatest_loads(leader(*up, *more), "master") for more in ([], ["operate=null"])]
    stretched = 0.49  # N m, the leader's own
    theirs = greatest_loads(leader(), "slave")["slave.shoulder"]
    assert found[0]["master.shoulder"] == pytest.approx(stretched + theirs, rel=0.05)
    assert found[1]["master.shoulder"] < 0.7 * found[0]["master.shoulder"]


def test_a_leader_with_payloads_of_its_own_still_feels_the_follower() -> None:
    """What it weighs itself and what is felt are one sum, whichever payload it holds."""
    rig = leader("master.arm.payloads={grip: {mass: 0.05}}")
    sides, _ = side_loads(rig, declared_delays(rig))
    master = next(side for side in sides if side.name == "master")
    for which in range(6):
        master.take(which, 0.3)
    alone = [master.effort(which) for which in range(6)]
    master.engage({})
    for _ in range(2000):
        for which in range(6):
            master.pass_slots(which, 1)
            master.take(which, 0.3)
            master.effort(which)
    assert master.take_up("grip") == ""
    before = [master.effort(which) for which in range(6)]
    assert abs(before[1] - alone[1]) > 0.5  # the follower's shoulder
    for _ in range(2000):
        for which in range(6):
            master.pass_slots(which, 1)
            master.take(which, 0.3)
            master.effort(which)
    after = [master.effort(which) for which in range(6)]
    assert 0.01 < abs(after[1] - before[1]) < 0.5
