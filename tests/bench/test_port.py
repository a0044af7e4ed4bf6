"""`tautwave bench port`: the yardsticks are what they were, the targets hold on recorded hands."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from tautwave.bench.port import long_hold
from tautwave.bench.port.hands import (
    CONTACTS,
    LEAD_S,
    PERIOD,
    Hand,
    recorded_hands,
    synthetic_hands,
)
from tautwave.bench.port.hold import hold
from tautwave.bench.port.rigs import IMPOSED, bench_rig
from tautwave.bench.port.suite import imposed_goals, port
from tautwave.bench.port.tracking import chatter, imposed, score
from tautwave.cli import main
from tautwave.errors import ConfigError
from tautwave.simulation import simulate

DATA = Path(__file__).parents[3] / "shared" / "data" / "teleop-1dof"


def short(contact: str, seconds: float = 1.5) -> Hand:
    [hand] = [each for each in synthetic_hands(seconds) if each.contact == contact]
    return hand


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
    result = CliRunner().invoke(main, ["bench", "port", "--hold", "3600", "--quick"])
    assert result.exit_code == 2
    assert "--hold goes with --json only" in result.output


def test_chatter_is_what_is_above_twenty_hertz() -> None:
    time = PERIOD * np.arange(4000)
    slow, fast = np.sin(2.0 * np.pi * 5.0 * time), 0.1 * np.sin(2.0 * np.pi * 100.0 * time)
    assert chatter(3.0 + slow + fast) == pytest.approx(0.1 / np.sqrt(2.0), rel=1e-3)


def test_recordings_are_read_with_the_hand_on_its_own_side(tmp_path: Path) -> None:
    rows = "time_s,master_position_rad,slave_position_rad\n0,0.1,0.3\n1.5,0.2,0.5\n"
    for name in ("m1_a_foam", "m2_a_rigid", "notes"):
        (tmp_path / f"{name}.csv").write_text(rows)
    swapped, plain = recorded_hands(tmp_path)
    assert (swapped.contact, plain.contact) == ("foam", "rigid")
    assert swapped.positions[[0, -1]] == pytest.approx([0.3, 0.5])
    assert plain.positions[[0, -1]] == pytest.approx([0.1, 0.2])
    assert plain.recorded is not None
    assert plain.recorded[[0, -1]] == pytest.approx([-0.2, -0.3])
    (tmp_path / "m2_a_foam.csv").write_text(rows.replace("1.5", "1.4"))
    with pytest.raises(ConfigError, match=r"m2_a_foam.csv: has 1.4 s; a hand needs 1.5 s"):
        recorded_hands(tmp_path)
    (tmp_path / "m2_a_foam.csv").write_text("time_s,x\n0,1\n")
    with pytest.raises(ConfigError, match="there is no column"):
        recorded_hands(tmp_path)


def test_a_folder_without_recordings_is_refused(tmp_path: Path) -> None:
    result = CliRunner().invoke(main, ["bench", "port", "--recordings", str(tmp_path)])
    assert result.exit_code != 0
    assert "no recording" in result.output
    assert "Traceback" not in result.output


def test_synthetic_hands_meet_every_contact_and_are_always_the_same() -> None:
    first, again = synthetic_hands(1.0), synthetic_hands(1.0)
    assert [hand.contact for hand in first] == list(CONTACTS)
    for one, other in zip(first, again, strict=True):
        assert np.array_equal(one.positions, other.positions)


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.timeout(400)
def test_the_whole_suite_without_recordings(tmp_path: Path) -> None:
    suite = port(quick=True, out=tmp_path).as_dict()
    assert "synthetic" in suite["tables"][0]["what"]
    assert "prefers-color-scheme: dark" in (tmp_path / "held-force.svg").read_text()
    assert all(goal["met"] for goal in suite["goals"])
    json.dumps(suite)


@pytest.mark.slow
@pytest.mark.skipif(not DATA.is_dir(), reason=f"no recordings in {DATA}")
def test_recorded_motion_is_followed_closer_than_the_laboratory_followed(tmp_path: Path) -> None:
    hands = recorded_hands(DATA)
    moved = imposed(hands, tmp_path, lambda _: None, laws=["after"])
    goals = imposed_goals(moved, hands)
    assert len(goals) == 5
    assert all(goal.met for goal in goals)
