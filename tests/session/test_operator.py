"""`Session`: commands of a program reach the loop, and what the loop does comes back."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from tautwave import Session, load_rig
from tautwave.config import Rig
from tautwave.errors import ConfigError, RecordingError
from tests.commands import END_STOPS
from tests.view.served import Run

pytestmark = pytest.mark.realtime

BENCH = Path(__file__).parents[2] / "configs" / "bench-1dof-loopback.yaml"
VALID = ("master.lever.valid", "slave.lever.valid")
QUIET = "simulation.hand.lever.reference={type: minimum_jerk, waypoints: [[0, 0], [1, 0.1]]}"


def bench(*overrides: str) -> Rig:
    loose = ("rate_hz=100", "loop.overrun_limit=3000", *END_STOPS,
             "coupling.pairs.lever.wall_master=null",
             "coupling.pairs.lever.wall_slave=null", "coupling.pairs.lever.wave_filter_hz=auto",
             "coupling.pairs.lever.pole_master=auto", "coupling.pairs.lever.pole_slave=auto",
             "duration_s=60")  # fmt: skip
    return load_rig(BENCH, [QUIET, *loose, *overrides])


def test_a_rig_without_the_block_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no `operate` block"):
        Session(bench(), out=tmp_path)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_an_action_that_is_no_position_is_not_sent(tmp_path: Path, value: float) -> None:
    session = Session(bench("operate={}"), out=tmp_path / "run")
    with pytest.raises(ConfigError, match=r"action lever is .*, not a position; nothing was sent"):
        session.lead({"lever": value})
    with pytest.raises(RecordingError, match="has ended"):
        session.lead({"lever": 0.1})


def test_a_whole_row_has_a_sample_of_every_axis(tmp_path: Path) -> None:
    """An axis without one keeps its columns, which a dataset must not take for measured."""
    run = Run(tmp_path, columns=("time_s", *VALID, "lever.position_error"))
    session = Session(bench("operate={}"), out=tmp_path)
    session._attach()
    with pytest.raises(RecordingError, match="no row yet"):
        session.row(whole=True)
    for number, valid in enumerate([(1.0, 1.0), (1.0, 0.0), (0.0, 1.0)]):
        run.recorder.row[1], run.recorder.row[2] = valid
        run.commit(1)
        if number != 1:
            assert session.row()["time_s"] == pytest.approx(1e-3 * number)
            assert session.row(whole=True)["time_s"] == 0.0
    run.close()
    assert session._tap is not None
    session._tap.close()


def test_what_names_an_episode_gives_no_other_command(monkeypatch: pytest.MonkeyPatch) -> None:
    sent: list[str] = []
    monkeypatch.setattr(Session, "_send", lambda _, line: sent.append(line))
    session = object.__new__(Session)
    session.begin_episode("pick", "the red\nstop one")
    assert sent == ["episode pick the red stop one"]
    for name in ("", "two words", "a\nstop", "success", "failed"):
        with pytest.raises(ConfigError, match="a single word"):
            session.begin_episode(name)


@pytest.mark.nightly
@pytest.mark.slow
def test_a_program_engages_marks_clutches_and_stops(tmp_path: Path) -> None:
    with Session(bench("operate={}"), out=tmp_path / "run") as session:
        assert session.state == "idle"
        session.engage()
        assert session.wait_for("engaged")
        session.begin_episode("pick", "the red one")
        session.end_episode(success=False)
        session.clutch()
        assert session.wait_for("clutched")
        assert session.row()["operation.engagement"] == 1.0
        assert not session.wait_for("engaged", timeout_s=0.1)
        row = session.row()
        assert 0.0 <= (age := session.age_s(row)) < 20.0  # by the loop's clock, so never below 0
    assert session.age_s(row) == math.inf > age
    assert session.exit_code == 0
    operation = session.wait()["operation"]
    assert [entry["source"] for entry in operation["journal"]].count("stdin") == 5
    assert operation["episodes"][0]["success"] is False
    with pytest.raises(RecordingError, match="has ended"):
        session.engage()


@pytest.mark.slow
def test_a_refused_rig_says_why_in_the_words_of_run(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "mine").write_text("x")
    session = Session(bench("operate={}"), out=tmp_path / "run")
    with pytest.raises(ConfigError, match="not empty"):
        session.__enter__()
    assert session.exit_code == 2
