"""An arm takes up another payload during a run: ramped while it stands, booked, certified."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tautwave.certificate.belief import declared_delays
from tautwave.certificate.beside.loads import load_element
from tautwave.config import load_rig
from tautwave.errors import ConfigError
from tautwave.rig import build_rig
from tautwave.rig.arms import greatest_loads, load_reserves, load_stiffnesses
from tautwave.rig.carrying import side_loads
from tautwave.rig.rates import load_offset
from tautwave.runtime.carrying.side import CarriedAxis, SideLoad, take_payload
from tautwave.runtime.operate.commands import PAYLOAD, Order, Script, read_script
from tautwave.runtime.operate.operated import OperatedControl
from tautwave.session.operating import with_operation
from tautwave.simulation.memory import run_in_memory

ARMS = Path(__file__).parents[2] / "configs" / "arms-loopback.yaml"
MORE = ("operate={start: engaged}", "slave.arm.payloads={none: {mass: 0.0}, box: {mass: 0.6}}")


def lever(mass: float) -> Any:
    """Return what holds a mass at a metre, and its potential."""

    def weigh(x: Any) -> tuple[list[float], float]:
        return [9.81 * mass * math.cos(x[0])], 9.81 * mass * math.sin(x[0])

    return weigh


def side(ramp: int = 10, back: int = 10) -> SideLoad:
    axis = CarriedAxis("slave.lever", 100.0, math.inf, 0.0, 0, 0.0, still=1e-4)
    others = {"box": lever(3.0), "none": lever(0.0)}
    return SideLoad("slave", [axis], lever(1.0), others, ramp, back)


def pass_slot(load: SideLoad, x: float) -> float:
    load.pass_slots(0, 1)
    load.take(0, x)
    return load.effort(0)


def test_a_payload_is_taken_up_over_the_ramp_and_booked_as_that() -> None:
    load = side()
    x = 0.3
    for _ in range(3):
        assert pass_slot(load, x) == pytest.approx(9.81 * math.cos(x))
    assert load.take_up("box") == ""
    efforts = [pass_slot(load, x) for _ in range(12)]
    assert np.diff(efforts[:10]) == pytest.approx(0.2 * 9.81 * math.cos(x))
    assert efforts[-1] == pytest.approx(3 * 9.81 * math.cos(x))
    row = [0.0] * len(load.columns)
    load.fill(row, 0)
    books = dict(zip(load.columns, row, strict=True))
    assert books["load.slave.changed"] == pytest.approx(2 * 9.81 * math.sin(x))
    assert books["load.slave.leak"] == pytest.approx(0.0, abs=1e-12)
    assert books["load.slave.given"] == pytest.approx(0.0, abs=1e-12)


def test_what_moves_under_another_payload_leaks_no_more_than_under_one() -> None:
    """Energy given through a change is potential, whatever the arm does meanwhile."""
    load = side(ramp=400)
    place = 0.0
    for k in range(1000):
        place = 0.4 * math.sin(2e-3 * k)
        pass_slot(load, place)
        if k == 1:
            load._stride = [0.0]
            assert load.take_up("box") == ""
    row = [0.0] * len(load.columns)
    load.fill(row, 0)
    books = dict(zip(load.columns, row, strict=True))
    work = -books["load.slave.lever.energy"]
    potential = books["load.slave.potential"]
    assert work == pytest.approx(potential - books["load.slave.leak"])
    assert abs(books["load.slave.leak"]) < 2e-3 * abs(work)


def test_a_wrong_payload_is_taken_back_while_it_moves_the_arm() -> None:
    """From within its ramp without a jump, once; what both put in is booked where they did."""
    load = side()
    pass_slot(load, 0.3)
    assert load.take_up("back") == "there is no change to undo"
    assert load.take_up("box") == ""
    up = [pass_slot(load, 0.3 + 0.01 * k) for k in range(4)]
    assert load.take_up("back") == ""
    down = [pass_slot(load, 0.33 - 0.001 * k) for k in range(8)]
    assert up[-1] > down[0] > down[-1] == pytest.approx(9.81 * math.cos(0.323 - 0.0005), rel=1e-3)
    assert down[0] == pytest.approx(up[-1] - 0.2 * 9.81, rel=0.02)
    assert load.take_up("back") == "there is no change to undo"
    row = [0.0] * len(load.columns)
    load.fill(row, 0)
    books = dict(zip(load.columns, row, strict=True))
    steps = [0.2 * 9.81 * math.sin(0.3 + 0.01 * k) for k in range(4)]
    steps += [-0.2 * 9.81 * math.sin(0.33 - 0.001 * k) for k in range(4)]
    assert books["load.slave.changed"] == pytest.approx(sum(steps))
    pass_slot(load, 0.4)
    assert load.take_up("box").endswith("is moving; keep it still")


@pytest.mark.parametrize("periods", [1, 4, 9, 10, 14])
def test_a_change_is_undone_in_its_own_time_from_wherever_its_ramp_is(periods: int) -> None:
    load = side(ramp=10, back=4)
    assert pass_slot(load, 0.0) == pytest.approx(9.81)
    assert load.take_up("box") == ""
    up = [pass_slot(load, 0.0) for _ in range(periods)][-1]
    assert load.take_up("back") == ""
    down = [up, *(pass_slot(load, 0.0) for _ in range(6))]
    assert min(np.diff(down)) >= -2 * 9.81 / 4 - 1e-9
    assert max(np.diff(down)) <= 2 * 9.81 / 4 + 1e-9  # the first step may go on by a rounding
    assert down[4] == pytest.approx(9.81)
    assert load.take_up("box") == ""
    assert pass_slot(load, 0.0) == pytest.approx(9.81 * (1 + 2 / 10))  # as slowly as ever


def test_it_is_refused_with_why() -> None:
    load = side()
    assert take_payload([load], "box")[0].endswith(
        "the position of the slave's arm is not known yet"
    )
    pass_slot(load, 0.0)
    assert take_payload([load], "crate") == (
        "payload 'crate': unknown; choose one of box, none",
        True,
    )
    pass_slot(load, 0.01)
    assert take_payload([load], "box") == (
        "payload 'box': the slave's arm is moving; keep it still",
        True,
    )
    pass_slot(load, 0.01)
    assert take_payload([load], "box") == ("box", False)
    assert "still being applied" in take_payload([load], "none")[0]
    assert take_payload([], "box") == ("payload: no arm in the rig defines `payloads`", True)
    other = side()
    other.name = "master"
    pass_slot(other, 0.0)
    assert "state the side" in take_payload([load, other], "box")[0]
    assert take_payload([load, other], "master box") == ("master box", False)


def test_an_arm_may_be_named_though_no_other_has_payloads_and_a_record_says_whose() -> None:
    load = side()
    pass_slot(load, 0.0)
    assert take_payload([load], "master box")[0] == "payload: state the side, slave (got 'master')"
    assert take_payload([load], "slave box") == ("box", False)
    pass_slot(load, 0.01)
    said, _ = take_payload([load], "slave none")
    assert "still being applied" in said
    for _ in range(600):
        pass_slot(load, 0.01)
    pass_slot(load, 0.02)
    said, _ = take_payload([load], "none")
    assert said.endswith("or give `payload slave back` to undo the last change")
    assert take_payload([load], "slave back") == ("back", False)


def test_verdict_and_room_are_those_of_the_heaviest() -> None:
    light, rig = load_rig(ARMS), load_rig(ARMS, list(MORE))
    heavy = load_rig(ARMS, ["slave.arm.payload.mass=0.6"])
    assert greatest_loads(rig, "slave") == greatest_loads(heavy, "slave")
    assert load_stiffnesses(rig, "slave") == load_stiffnesses(heavy, "slave")
    assert load_reserves(rig) == load_reserves(heavy)
    delays = declared_delays(rig)
    found = load_element(rig, "slave.waist", delays)
    assert found is not None
    # 0.6 kg at the tip, over all heights that it reaches
    assert found.numbers["payload_j"] == pytest.approx(1.1 * 0.6 * 9.81 * 1.1, rel=0.15)
    assert "may supply" in found.passive.reason
    bare = load_element(light, "slave.waist", delays)
    assert bare is not None
    assert "payload_j" not in bare.numbers


def test_a_rig_undoes_a_change_in_50_ms_and_takes_one_up_in_half_a_second() -> None:
    rig = load_rig(ARMS, [*MORE])
    load = side_loads(rig, declared_delays(rig))[0][1]
    sent = []
    for word, periods in (("", 1), ("box", 600), ("back", 60)):
        assert not word or load.take_up(word) == ""
        for _ in range(periods):
            for which in range(6):
                load.pass_slots(which, 1)
                load.take(which, 0.0)
            sent.append([load.effort(which) for which in range(6)][1])
    settled = [abs(value - sent[at]) < 1e-3 for at in (600, -1) for value in sent]
    assert settled[: len(sent)].index(True) == pytest.approx(500, abs=2)
    assert settled[len(sent) + 601 :].index(True) == pytest.approx(50, abs=2)
    assert sent[-1] == pytest.approx(sent[0], abs=1e-3)


def test_motors_that_change_slowly_take_as_long_as_they_need_and_the_books_close() -> None:
    """Half of 60 N m/s at 1 kHz is 0.03 N m per period; the box is 2.1 N m on the shoulder."""
    rig = load_rig(ARMS, [*MORE, "slave.defaults.effort_rate_limit=60"])
    load = side_loads(rig, declared_delays(rig))[0][1]
    count, sent = 6, []

    def go(periods: int, amplitude: float) -> None:
        for k in range(periods):
            at = amplitude * math.sin(0.01 * k) ** 2
            for which in range(count):
                load.pass_slots(which, 1)
                load.take(which, at if which == 1 else 0.0)
            sent.append([load.effort(which) for which in range(count)][1])

    go(400, 0.0)
    before = sent[-1]
    assert load.take_up("box") == ""
    go(600, 0.0)
    assert sent[-1] - before == pytest.approx(0.4 * 9.81 * 0.53, abs=2e-3)  # stretched out
    assert load.take_up("back") == ""
    start = len(sent)
    go(150, 0.3)
    assert sent[start + 50] - before > 0.5  # not within 50 ms
    assert sent[-1] == pytest.approx(before, abs=0.4)
    row = [0.0] * len(load.columns)
    load.fill(row, 0)
    assert abs(row[load.columns.index("load.slave.leak")]) < 1e-3


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["operate=null"], "add `operate: {}`"),
        (["slave.arm.compensate=false"], "compensate: false"),
        (["slave.arm.payloads={back: {mass: 1}}"], "choose another name"),
        (["slave.arm.payloads={box: {mass: -1}}"], "greater than or equal to 0"),
        (["slave.arm.payloads={box: {mass: 9}}"], "leaves too little for the coupling"),
    ],
)
def test_wrong_payloads_are_refused(more: list[str], said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_reserves(load_rig(ARMS, [*MORE, *more]))
    assert said in str(caught.value)


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.timeout(300)
def test_a_payload_that_is_not_there_lifts_the_arm_by_what_the_coupling_gives_way() -> None:
    """0.2 kg hang at the tip, as believed, until people say that it holds 0.6."""
    still = [
        f"simulation.hand.{name}.reference={{type: hold, position: 0.0}}"
        for name in ("waist", "shoulder", "elbow", "forearm", "wrist", "flange")
    ]
    rig = load_rig(ARMS, [*MORE, *still, "duration_s=3.6"])
    script = Script([(at, Order(PAYLOAD, name)) for at, name in ((1_000_000_000, "box"),)])
    built = with_operation(rig, build_rig(rig, clock="fake"), [script], [])
    result, data = run_in_memory(built)
    assert result.error is None
    table = dict(zip(built.columns, data.T, strict=True))
    effort = table["load.slave.shoulder.effort"]
    apart = table["slave.shoulder.position"] - table["master.shoulder.position"]
    more = effort[-1] - effort[990]
    each = load_offset(rig, "slave.shoulder", declared_delays(rig))
    assert more == pytest.approx(0.4 * 9.81 * 0.55, rel=0.2)  # N m: stretched out
    assert apart[2900:3250].mean() == pytest.approx(each * more, rel=0.12)
    assert np.ptp(apart[2900:3250]) < 6e-3  # and there it stays
    assert abs(table["load.slave.changed"][-1]) > 0.1
    assert table["load.slave.given"][-1] < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize(("share", "moved"), [(0.3, 0.078), (0.0, math.inf)])
@pytest.mark.nightly
def test_a_clutched_arm_keeps_its_place_under_a_wrong_payload_only_by_its_brake(
    share: float, moved: float
) -> None:
    """The numbers of "Hold a place" in the docs."""
    operated = f"operate={{start: engaged, hold_effort_share: {share}}}"
    rig = load_rig(ARMS, [operated, MORE[1]])
    script = Script(read_script("1.0 payload box\n1.2 clutch", "script"))
    built = with_operation(rig, build_rig(rig, clock="fake", duration_s=6.0), [script], [])
    result, rows = run_in_memory(built)
    assert result.error is None
    at = rows[:, list(built.columns).index("slave.shoulder.position")]
    control = built.control
    assert isinstance(control, OperatedControl)
    *_, last = control.journal.entries
    if share == 0.0:
        assert last.word == "fault"
        assert "slave.shoulder: at 1.50" in last.text
        assert last.at_s < 1.2 + 0.8
    else:
        assert last.state == "clutched"
        assert at[-300] - at[1200] == pytest.approx(moved, abs=0.01)
        assert np.ptp(at[-1000:-300]) < 0.01
