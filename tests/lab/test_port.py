"""`python -m tests.lab port`: yardsticks are what they were, targets hold on recorded hands."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from tautwave.bench.chunks import Cost
from tautwave.bench.compiled import NO_NUMBA
from tautwave.bench.live.think import SiteCase
from tautwave.bench.result import Goal
from tautwave.errors import ConfigError
from tautwave.recordings.columns import read_column
from tautwave.simulation import simulate
from tests.lab.command import lab
from tests.lab.port import cost, long_hold
from tests.lab.port.hands import (
    CONTACTS,
    LEAD_S,
    PERIOD,
    Hand,
    recorded_hands,
    synthetic_hands,
)
from tests.lab.port.hold import hold
from tests.lab.port.rigs import IMPOSED, bench_rig
from tests.lab.port.suite import imposed_goals, port
from tests.lab.port.tracking import chatter, imposed, score

DATA = Path(__file__).parents[3] / "shared" / "data" / "teleop-1dof"


def short(contact: str, seconds: float = 1.5) -> Hand:
    [hand] = [each for each in synthetic_hands(seconds) if each.contact == contact]
    return hand


@pytest.mark.slow
def test_the_port_follows_a_hand_closer_than_the_laboratory_does(tmp_path: Path) -> None:
    hand = short("free")
    after, lab = (score(hand, law, 9e-5, tmp_path) for law in ("after", "lab"))
    assert after.error < 0.6 * lab.error
    assert after.chatter < 1.6 * lab.chatter


def test_imposed_motion_is_imposed(tmp_path: Path) -> None:
    hand = short("free", 1.0)
    path = hand.write(tmp_path)
    reference = f"{{type: recording, file: {path}, column: hand, repeat: false}}"
    rig = bench_rig(
        "after", reference, "{type: free}", noise=0.0, seconds=hand.seconds, grip=IMPOSED
    )
    run = simulate(rig, engine="python")
    moved = run["true.master.lever.position"][round(LEAD_S / PERIOD) :]
    assert np.max(np.abs(moved[: len(hand.positions)] - hand.positions)) < 2e-4


def test_before_went_limp_and_after_does_not() -> None:
    """The hand at 0.1 rad before a wall of 250 N m/rad: 47 mrad and nothing felt."""
    before = hold("before", 9e-5, 3.0, resting=True)
    after = hold("after", 9e-5, 3.0, resting=True)
    assert before.cut > 0.5
    assert abs(before.effort) < 0.02
    assert after.cut == 0.0
    assert after.error < 3e-3
    assert after.share == pytest.approx(1.0, abs=0.005)


@pytest.mark.slow
def test_a_hold_is_judged_piece_by_piece(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the same force as in one run."""
    monkeypatch.setattr(long_hold, "PIECE_S", 3.0)
    first, last = long_hold.lasting(9e-5, 6.0, "python")
    whole = hold("after", 9e-5, 6.0)
    assert last.seconds == 6.0
    assert last.effort == pytest.approx(whole.effort, rel=1e-3)
    assert abs(last.share - 1.0) < 1e-3
    assert abs(last.drift) < 1e-4
    assert first.chatter <= last.chatter < 0.015
    assert 0.9 < last.tank <= first.tank < 1.1  # the filter's share counts as well
    assert 0.0 <= last.given < 0.01


@pytest.mark.slow
def test_ten_minutes_of_a_held_force() -> None:
    suite = long_hold.holding(seconds=600.0, tell=lambda _: None)
    assert [goal.name for goal in suite.goals if not goal.met] == []
    assert [row[1] for row in suite.tables[0].rows] == [60.0, 600.0] * 2


def test_an_hour_goes_with_nothing_else() -> None:
    result = CliRunner().invoke(lab, ["port", "--hold", "3600", "--quick"])
    assert result.exit_code == 2
    assert "--hold can be combined with --json only" in result.output


def test_chatter_is_what_is_above_twenty_hertz() -> None:
    time = PERIOD * np.arange(4000)
    slow, fast = np.sin(2.0 * np.pi * 5.0 * time), 0.1 * np.sin(2.0 * np.pi * 100.0 * time)
    assert chatter(3.0 + slow + fast) == pytest.approx(0.1 / np.sqrt(2.0), rel=1e-3)


TIMES = 1e-3 * np.arange(1601)
LED = 0.1 + 0.05 * np.sin(7.0 * TIMES)
DRAGGED = 0.98 * LED - 0.004 * np.sign(np.cos(7.0 * TIMES))
"""Behind a spring, against dry friction."""


def recorded(path: Path, head: str, *columns: np.ndarray) -> None:
    np.savetxt(path, np.column_stack([TIMES, *columns]), "%.9g", ",", header=head, comments="")


def test_the_hand_is_at_the_lever_that_drags_the_other_along(tmp_path: Path) -> None:
    head = "time_s,master_position_rad,slave_position_rad"
    recorded(tmp_path / "m1_a_foam.csv", head, DRAGGED, LED)
    recorded(tmp_path / "m2_a_rigid.csv", head, LED, DRAGGED)
    (tmp_path / "notes.csv").write_text("none of the hands")
    for hand in recorded_hands(tmp_path):
        assert hand.positions[::2] == pytest.approx(LED, abs=1e-8)
        assert hand.recorded is not None
        assert hand.recorded[::2] == pytest.approx(LED - DRAGGED, abs=1e-8)
    assert [hand.contact for hand in recorded_hands(tmp_path)] == ["foam", "rigid"]


def test_recordings_of_other_programs_are_hands_too(tmp_path: Path) -> None:
    """MATLAB, a name in capitals, degrees, semicolons, another order, another rate."""
    io = pytest.importorskip("scipy.io")
    log = {"Time": TIMES, "SlaveAngle": DRAGGED, "MasterAngle": LED, "MasterTorque": LED}
    io.savemat(tmp_path / "Set3_E_FreeMotion.MAT", {"log": log})
    rows = np.column_stack([np.degrees(DRAGGED), TIMES, np.degrees(LED)])
    head = "slave angle [deg];t;master angle [deg]"
    np.savetxt(tmp_path / "x_spring_2.csv", rows, "%.12g", ";", header=head, comments="")
    found = recorded_hands(tmp_path)
    assert [(it.name, it.contact) for it in found] == [
        ("Set3_E_FreeMotion", "free"), ("x_spring_2", "spring"),
    ]  # fmt: skip
    for hand in found:
        assert hand.positions[::2] == pytest.approx(LED, abs=1e-9)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time_s,master_position_rad,slave_position_rad\n0,0,0\n0.1,1,1\n", "a hand needs 1.5 s"),
        ("time_s,x\n0,1\n", "there is no one column for the master's lever"),
        ("time_s,master_angle,master_position,slave_angle\n0,1,1,1\n", "no one column for the mas"),
        ("time_s,master_angle,slave_angle\n0,1,\n1,2,2\n", "holds '', not a finite number"),
    ],
)
def test_what_is_no_hand_is_said(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "m2_a_foam.csv").write_text(text)
    with pytest.raises(ConfigError) as refused:
        recorded_hands(tmp_path)
    assert "m2_a_foam.csv" in str(refused.value)
    assert said in str(refused.value)


@pytest.mark.slow
@pytest.mark.skipif(not DATA.is_dir(), reason=f"no recordings in {DATA}")
def test_in_one_set_the_hand_was_at_the_lever_that_is_logged_as_slave() -> None:
    for hand in recorded_hands(DATA, 3.0):
        side = "slave" if hand.name.startswith("m1_a") else "master"
        _, first = read_column(DATA / f"{hand.name}.csv", f"{side}_position_rad", "time_s")
        assert hand.positions[0] == first[0]


def test_a_folder_without_recordings_is_refused(tmp_path: Path) -> None:
    result = CliRunner().invoke(lab, ["port", "--recordings", str(tmp_path)])
    assert result.exit_code != 0
    assert "no recording" in result.output
    assert "Traceback" not in result.output


@pytest.mark.parametrize("compiled", [True, False])
def test_the_port_is_compared_part_by_part(monkeypatch: pytest.MonkeyPatch, compiled: bool) -> None:
    """Medians, after over before; the goals are of the port as it is [us]."""
    nanoseconds = {
        "before": {"close": 2000.0, "think": 1000.0, "both": 4000.0},
        "after": {"close": 1250.0, "think": 2600.0, "both": 3000.0},
    }
    laws = {}

    def parts(cases: Sequence[SiteCase], rounds: int) -> dict[str, dict[str, Cost]]:
        assert rounds == 7
        laws.update({case.name: case.law.end.__module__ for case in cases})
        return {
            name: {part: Cost(1.0, median, 7, 7) for part, median in taken.items()}
            for name, taken in nanoseconds.items()
        }

    monkeypatch.setattr(cost, "part_costs", parts)
    monkeypatch.setattr(
        cost,
        "step_costs",
        lambda rigs, _: dict(zip(rigs, (200.0, 250.0, 250.0, 275.0), strict=True)),
    )
    monkeypatch.setattr(cost, "has_numba", lambda: compiled)
    said: list[str] = []
    table, goals = cost.port_costs(7, said.append)
    assert len(set(laws.values())) == 2
    assert list(laws) == ["before", "after"]
    assert table.columns == ("part", "before_ns", "after_ns", "ratio")
    rows = [
        ["close, plain Python", 2000.0, 1250.0, 0.625],
        ["think, plain Python", 1000.0, 2600.0, 2.6],
        ["both, plain Python", 4000.0, 3000.0, 0.75],
    ]
    steps = [
        ["step of the bench, compiled, 1 s", 200.0, 250.0, 1.25],
        ["step of the bench, compiled, 6 s", 250.0, 275.0, 1.1],
    ]
    assert table.rows == ([*rows, *steps] if compiled else rows)
    assert goals == [
        Goal("think of the port, plain Python", 2.5, "us", 2.6),
        Goal("close of the port, plain Python", 1.5, "us", 1.25),
        Goal("compiled step over the port before, 6 s", 1.15, "times", 1.1)
        if compiled
        else Goal("compiled step over the port before, 6 s", 1.15, "times", None, why_not=NO_NUMBA),
    ]
    assert [goal.met for goal in goals] == [False, True, True if compiled else None]
    assert (
        said
        == [
            "steps of the port, plain Python",
            "a step of the bench, compiled (numba compiles for a minute)",
        ][: 1 + compiled]
    )


def test_synthetic_hands_meet_every_contact_and_are_always_the_same() -> None:
    first, again = synthetic_hands(1.0), synthetic_hands(1.0)
    assert [hand.contact for hand in first] == list(CONTACTS)
    for one, other in zip(first, again, strict=True):
        assert np.array_equal(one.positions, other.positions)


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.timeout(400)
def test_the_whole_suite_without_recordings(tmp_path: Path) -> None:
    suite = port(quick=True, out=tmp_path).as_dict()
    assert "synthetic" in suite["tables"][0]["what"]
    assert "prefers-color-scheme: dark" in (tmp_path / "held-force.svg").read_text()
    assert all(goal["met"] for goal in suite["goals"])
    json.dumps(suite)


@pytest.mark.slow
@pytest.mark.skipif(not DATA.is_dir(), reason=f"no recordings in {DATA}")
@pytest.mark.nightly
def test_recorded_motion_is_followed_closer_than_the_laboratory_followed(tmp_path: Path) -> None:
    hands = recorded_hands(DATA)
    moved = imposed(hands, tmp_path, lambda _: None, laws=["after"])
    goals = imposed_goals(moved, hands)
    assert len(goals) == 5
    assert all(goal.met for goal in goals)
