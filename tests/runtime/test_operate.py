"""An operated rig: its table of states, and what the axes do in each, with books that close."""

from __future__ import annotations

import itertools
import os
from collections.abc import Sequence

import numpy as np
import pytest

from tautwave.errors import ConfigError
from tautwave.rig import build_rig
from tautwave.runtime.control import CoupledControl
from tautwave.runtime.operate import states as st
from tautwave.runtime.operate.commands import (
    Descriptor,
    Lines,
    Order,
    Script,
    read_keys,
    read_script,
)
from tautwave.runtime.operate.rest.holds import Holds, damping_capital
from tests.runtime.operating import BARE, FREE, STANDING, STILL, Operated, bench, operate
from tests.runtime.sequences import judge, random_day

ALIGNED = "coupling.pairs.lever.offset=0.2"
NEAR = "coupling.pairs.lever.engage_tolerance=0.01"


def state_code(name: str) -> float:
    return float(st.STATES.index(name))


# -- the table ------------------------------------------------------------------------------------

TABLE = """
         engage   clutch   hold    rest stop     scale    aligned blocked fault   released parted   lost
idle     aligning .        holding .    stopping idle     .       .       holding .        .        .
aligning .        .        holding idle stopping .        engaged holding holding holding  .        holding
engaged  .        clutched holding .    stopping engaged  .       .       holding holding  aligning holding
clutched aligning .        holding idle stopping clutched .       .       holding .        .        .
holding  aligning .        .       idle stopping holding  .       .       holding .        .        .
stopping .        .        .       .    .        .        .       .       .       .        .        .
"""  # noqa: E501


def test_every_state_takes_every_word_as_the_table_in_the_docs_says() -> None:
    head, *lines = [line.split() for line in TABLE.strip().splitlines()]
    assert tuple(head) == (*st.COMMANDS, *st.EVENTS)
    assert [line[0] for line in lines] == list(st.STATES)
    for state, *cells in lines:
        for word, expected in zip(head, cells, strict=True):
            for faulted in (False, True):
                found = st.follow(st.Standing(state, faulted), word)
                if expected == "." or (word == st.ENGAGE and faulted):
                    assert found is None
                    assert word in st.refusal(st.Standing(state, faulted), word)
                else:
                    assert found is not None
                    assert found.state == expected
                    assert found.faulted == (word == st.FAULT or (faulted and word != st.REST))


def test_from_every_state_a_rig_stops_and_from_every_other_it_comes_back_to_engaged() -> None:
    for state in st.STATES[:-1]:
        reached = {st.Standing(state, True)}
        for _ in range(6):
            words = itertools.product(list(reached), (*st.COMMANDS, *st.EVENTS))
            reached |= {now for one, word in words if (now := st.follow(one, word)) is not None}
        assert {one.state for one in reached} == set(st.STATES)
        assert st.Standing(st.ENGAGED, False) in reached


# -- a run ----------------------------------------------------------------------------------------

SCRIPT = """
0.2 engage
1.5 clutch
1.8 engage        # with the offset that there is now
3.2 hold
3.5 rest
3.6 engage
"""


@pytest.fixture(scope="module")
def session() -> Operated:
    return operate(bench(STANDING, FREE, *BARE), SCRIPT, 5.0)


def test_the_command_of_a_cycle_is_recorded_as_the_docs_number_it(session: Operated) -> None:
    """1 engage, 2 clutch, 3 hold, 4 rest, 5 stop, 6 episode; 0 in a cycle without one."""
    sent = session.columns["operation.command"]
    assert sent[sent > 0.0].tolist() == [1.0, 2.0, 1.0, 3.0, 4.0, 1.0]


def test_a_session_goes_through_the_states_it_was_asked_for(session: Operated) -> None:
    assert session.result.error is None
    assert session.words() == [
        ("engage", "aligning"), ("aligned", "engaged"), ("clutch", "clutched"),
        ("engage", "aligning"), ("aligned", "engaged"), ("hold", "holding"), ("rest", "idle"),
        ("engage", "aligning"), ("aligned", "engaged"),
    ]  # fmt: skip
    assert session.control.journal.engagements == 3
    column = session.columns["operation.engagement"]
    assert column[0] == 0
    assert column[-1] == 3
    assert set(np.diff(column)) == {0.0, 1.0}


def test_the_books_close_over_all_sessions(session: Operated) -> None:
    flow = session.columns["master.lever.gross_flow"] + session.columns["slave.lever.gross_flow"]
    assert np.abs(session.residual()).max() <= 1e-14  # [J], of a tank with 2.5
    assert np.all(np.diff(flow) >= 0.0)  # no session takes back what another has counted


def test_nobody_is_pushed_while_idle_and_only_the_slave_is_held_while_clutched(
    session: Operated,
) -> None:
    state = session.columns["operation.state"]
    sent = {side: session.columns[f"{side}.lever.commanded"] for side in ("master", "slave")}
    for side in sent:
        assert not sent[side][state == state_code(st.IDLE)].any()
    clutched = np.flatnonzero(state == state_code(st.CLUTCHED))[20:]
    assert not sent["master"][clutched].any()
    speed = session.columns["slave.lever.velocity"][clutched]
    assert np.allclose(sent["slave"][clutched], -2.0e-3 * speed, atol=1e-9)


def test_a_hold_takes_energy_out_and_gives_none_beyond_its_capital(session: Operated) -> None:
    held = session.columns["operation.state"] == state_code(st.HOLDING)
    taken = session.columns["lever.operate.absorbed"][held]
    assert taken[-1] - taken[0] >= -1e-9


def test_a_rig_that_starts_engaged_needs_no_command() -> None:
    done = operate(bench(STANDING, FREE, *BARE, "operate.start=engaged"), "", 1.0)
    assert done.words() == [("engage", "aligning"), ("aligned", "engaged")]


# -- alignment ------------------------------------------------------------------------------------


def aligned(*overrides: str, script: str = "0.1 engage", duration_s: float = 1.8) -> Operated:
    keys = (STILL, FREE, *BARE, ALIGNED, NEAR, "slave.axes.lever.coulomb=2e-3", *overrides)
    return operate(bench(*keys), script, duration_s)


def test_the_slave_goes_to_where_the_master_wants_it_and_then_engages() -> None:
    done = aligned()
    assert done.words() == [("engage", "aligning"), ("aligned", "engaged")]
    state, slave = done.columns["operation.state"], done.columns["slave.lever.position"]
    at = int(np.argmax(state == state_code(st.ENGAGED)))
    assert slave[at] == pytest.approx(-0.2, abs=0.005)
    moving = state == state_code(st.ALIGNING)
    speed = np.abs(np.diff(slave[moving])) * 1000.0
    assert speed.max() <= 0.3 + 2.094e-5 * 1000.0  # and one encoder step a period
    assert np.abs(done.columns["slave.lever.commanded"][moving]).max() <= 0.2 * 1.1
    given_out = -done.columns["lever.operate.absorbed"][moving].min()
    assert 0.0 < given_out < 0.01
    assert np.abs(done.residual()).max() <= 1e-12


@pytest.mark.slow
def test_an_obstacle_blocks_it_and_it_says_so() -> None:
    stop = "simulation.environment.lever={type: wall, position: -0.1, stiffness: 200, side: below}"
    done = operate(bench(STILL, *BARE, ALIGNED, NEAR, stop), "0.1 engage", 9.0)
    assert done.words() == [("engage", "aligning"), ("blocked", "holding")]
    assert "lever not aligned" in done.control.journal.entries[-1].text
    effort = np.abs(done.columns["slave.lever.commanded"])
    assert effort.max() <= 0.2 * 1.1 + 1e-12
    assert done.control.journal.engagements == 0


@pytest.mark.parametrize(
    ("keys", "script", "state", "delay_s"),
    [
        ((STILL, ALIGNED, NEAR), "0.1 engage\n0.4 hold", st.HOLDING, 0.0025),
        ((STANDING,), "0.05 engage\n0.5 hold", st.HOLDING, 0.0),
        ((STANDING,), "0.05 engage\n0.5 clutch", st.CLUTCHED, 0.0025),
    ],
)
def test_a_hold_damps_whatever_pushed_before_it(
    keys: Sequence[str], script: str, state: str, delay_s: float
) -> None:
    """Commands on their way used to take a new hold's whole capital, and it damped nothing."""
    late = f"buses.arm.options={{command_delay_s: {delay_s}}}"
    done = operate(bench(*keys, FREE, *BARE, late), script, 0.6)
    held = np.flatnonzero(done.columns["operation.state"] == state_code(state))
    pushed = np.diff(done.columns["lever.operate.absorbed"])[held[0] - 1 : held[0] + 4]
    assert pushed.min() < -2.0 * done.control.holds.granted(1)  # the worst case is met
    speed = done.columns["slave.lever.velocity"][held]
    sent = done.columns["slave.lever.commanded"][held]
    assert np.abs(speed).max() > 0.05
    assert np.allclose(sent, -2.0e-3 * speed, atol=1e-9)
    assert np.abs(done.residual()).max() <= 1e-12


def test_a_hold_that_gives_out_its_capital_lets_go() -> None:
    rig = bench(STILL, FREE, *BARE)
    control = build_rig(rig, clock="fake").control
    assert isinstance(control, CoupledControl)
    s, p = control.axes[1], control.params[1]._replace(delay=1, late=0.5)
    holds = Holds([p], [2.094e-5])
    s.velocity = 1.0
    capital = damping_capital(p, 2.094e-5)
    for slot, energy, damps in (
        (4, -1.0, True), (5, -2.0, True), (6, -3.0, True),  # what acts late is not the hold's
        (7, -3.0 - 0.9 * capital, True), (8, -3.0 - 1.1 * capital, False), (9, -2.0, True),
    ):  # fmt: skip
        s.port_energy = energy
        assert (holds.effort(0, slot, s, p) != 0.0) is damps
    holds.renew()
    s.port_energy = -5.0  # no sample until slot 19, and what acted late with it
    assert holds.effort(0, 10, s, p) != 0.0
    s.port_energy = -6.0
    assert holds.effort(0, 19, s, p) != 0.0
    s.port_energy = -6.0 - 1.1 * capital
    assert holds.effort(0, 20, s, p) == 0.0


def test_a_clutch_keeps_the_present_offset_and_a_rest_does_not() -> None:
    done = aligned(script="0.1 engage\n1.8 clutch\n1.9 engage", duration_s=2.4)
    assert done.words()[-1] == ("aligned", "engaged")
    last = done.control.states[0].offset
    master, slave = (done.columns[f"{side}.lever.position"] for side in ("master", "slave"))
    at = int(np.flatnonzero(np.diff(done.columns["operation.engagement"]))[-1]) + 1
    assert last == pytest.approx(slave[at] - master[at], abs=1e-9)


# -- faults ---------------------------------------------------------------------------------------


def test_a_fault_is_held_acknowledged_and_engaged_again_in_one_session() -> None:
    away = "simulation.hand.lever.reference={type: minimum_jerk, waypoints: " \
        "[[0, 0], [1.0, 0], [1.6, 0.45], [2.2, 0], [9, 0]]}"  # fmt: skip
    wide = "slave.axes.lever.position_range=[-3, 3]"
    rig = bench(away, FREE, *BARE, wide, "master.axes.lever.position_range=[-0.3, 0.3]")
    done = operate(rig, "0.2 engage\n2.6 engage\n2.8 rest\n3.0 engage", 4.0)
    assert done.result.error is None
    assert done.words() == [
        ("engage", "aligning"), ("aligned", "engaged"), ("fault", "holding"),
        ("engage", "holding"), ("rest", "idle"), ("engage", "aligning"), ("aligned", "engaged"),
    ]  # fmt: skip
    said = {entry.word: entry.text for entry in done.control.journal.entries[2:4]}
    assert "master.lever left its position range" in said["fault"]
    assert said["engage"] == "engage: not possible after a fault; see what failed, then give rest"
    assert np.abs(done.residual()).max() <= 1e-12


def test_a_host_that_stalls_is_a_fault_and_no_end() -> None:
    stall = ("simulation.faults.overrun_probability=0.002", "simulation.faults.overrun_slots=6")
    rig = bench(STANDING, FREE, *BARE, "loop.overrun_limit=4", *stall)
    done = operate(rig, "0.1 engage\n1.0 rest\n1.1 engage", 1.5)
    assert done.result.error is None
    (first, *_) = [entry for entry in done.control.journal.entries if entry.word == "fault"]
    assert "slots of 1 ms were missed in a row" in first.text
    assert ("rest", "idle") in done.words()  # no device has to be reset
    assert np.abs(done.residual()).max() <= 1e-12


def test_a_rig_at_rest_outside_its_range_is_held_too() -> None:
    away = "simulation.hand.lever.reference={type: minimum_jerk, waypoints: [[0, 0], [1, 0.45]]}"
    rig = bench(away, FREE, *BARE, "master.axes.lever.position_range=[-0.3, 0.3]")
    done = operate(rig, "", 1.0)
    assert done.words() == [("fault", "holding")]
    (entry,) = done.control.journal.entries
    assert "outside its position range, -0.3 to 0.3 rad: move it back by hand" in entry.text


@pytest.mark.parametrize("before", ["", "0.2 engage", "0.2 hold"])
def test_a_stop_ramps_down_from_every_state(before: str) -> None:
    done = operate(bench(STANDING, FREE, *BARE), f"{before}\n1.0 stop", 5.0)
    assert done.result.error is None
    assert done.control.standing.state == st.STOPPING
    assert done.columns["time_s"][-1] == pytest.approx(1.2, abs=0.01)
    assert abs(done.columns["slave.lever.commanded"][-1]) < 1e-3


@pytest.mark.slow
def test_random_sequences_close_their_books_within_budgets_and_stay_in_the_table() -> None:
    for seed in range(60):
        judge(random_day(seed))
    for seed in range(12):
        judge(random_day(seed, linked=True), linked=True)


# -- commands -------------------------------------------------------------------------------------


def test_keys_and_lines_become_commands() -> None:
    assert [order.word for order in read_keys(b" xgcpresfbqth\x1b[A")] == [
        "toggle", "engage", "clutch", "hold", "rest", "episode", "success", "failed", "again",
        "stop", "take_over", "hand_back",
    ]  # fmt: skip
    lines = Lines("pipe")
    assert lines(b"engage\nepisode pick the re") == [Order("engage", "", "pipe")]
    assert lines(b"d one\n\xff\n") == [
        Order("episode", "pick the red one", "pipe"), Order("\ufffd", "", "pipe"),
    ]  # fmt: skip


def test_a_descriptor_never_waits_and_is_left_alone_once_it_ends() -> None:
    reading, writing = os.pipe()
    source = Descriptor(reading, Lines("pipe"))
    assert source.take(0) == ()
    os.write(writing, b"engage\n")
    assert [order.word for order in source.take(0)] == ["engage"]
    os.close(writing)
    assert source.take(0) == []
    os.close(reading)
    assert source.take(0) == ()


def test_keys_pressed_before_the_rig_was_seen_idle_engage_nothing() -> None:
    reading, writing = os.pipe()
    os.write(writing, b" qg")
    keys = Descriptor(reading, read_keys, fresh=True)
    assert [order.word for order in keys.take(0)] == ["stop"]
    os.write(writing, b"p")
    assert [order.word for order in keys.take(0)] == ["hold"]
    os.close(writing)
    assert keys.take(0) == []
    os.close(reading)


def test_a_script_is_taken_in_order_of_time_and_its_mistakes_all_at_once() -> None:
    script = Script(read_script("2 clutch\n1 engage # now\n\n1.5 episode a b", "s"))
    assert [order.word for order in script.take(1_600_000_000)] == ["engage", "episode"]
    assert [order.word for order in script.take(9_000_000_000)] == ["clutch"]
    with pytest.raises(ConfigError) as caught:
        read_script("1 jump\n-1 engage\nnan hold\n2 stop", "s")
    assert [problem.partition(": ")[0] for problem in caught.value.problems] == [
        "s:1",
        "s:2",
        "s:3",
    ]


class Typed:
    """Types each order once it is looked at."""

    def __init__(self, orders: Sequence[Order]) -> None:
        self.left = list(orders)

    def take(self, now_ns: int) -> Sequence[Order]:
        return [self.left.pop(0)] if self.left else []


def test_an_unknown_word_is_noted_and_the_space_bar_engages_and_lets_go() -> None:
    done = operate(bench(STANDING, FREE, *BARE), "0.1 hold\n0.2 clutch", 0.3)
    assert done.words() == [("hold", "holding"), ("clutch", "holding")]
    assert done.control.journal.entries[1].text == (
        "clutch: not possible while holding; possible: engage, rest, stop, scale"
    )


def test_an_effort_sensor_that_friction_cannot_balance_blocks_an_alignment(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("tautwave.runtime.operate.rest.aligning.PATIENCE_S", 0.3)
    law = "coupling={law: position_force, pairs: {lever: {effort: measured}}}"
    sensors = "slave.axes.lever.effort_sensor={}", "simulation.axes.slave.lever.effort_sensor=%s"
    for offset in (0.4, 0.0):
        true = sensors[1] % f"{{offset: {offset}}}"
        done = operate(bench(law, sensors[0], true, STILL, FREE), "0 engage", 0.6)
        assert ("blocked" if offset else "aligned") in [word for word, _ in done.words()]
        said = [entry.text for entry in done.control.journal.entries if entry.word == st.BLOCKED]
        assert bool(said) == (offset > 0.0)
        if said:
            assert "slave.lever: its effort sensor reads +0.4 N m" in said[0]
