"""User studies: their order, their trials, their table; triggers on lines beside the rig."""

from __future__ import annotations

import csv
import os
import struct
import termios
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from tautwave.cli import main
from tautwave.clock import FakeClock
from tautwave.errors import ConfigError, DriverError
from tautwave.recordings.recording import read_recording
from tautwave.runtime.operate import trigger
from tautwave.runtime.operate.trigger import TriggerLine
from tautwave.session.running import RunResult
from tautwave.session.trials import running
from tautwave.session.trials.protocol import Trial, read_protocol, trials_of
from tautwave.session.trials.running import FIRST, TrialSource, _free
from tautwave.summary import summary_of

pytestmark = pytest.mark.realtime

BENCH = Path(__file__).parents[2] / "configs" / "bench-1dof-loopback.yaml"
STUDY = """
rig: bench.yaml
task: reach
conditions:
  near: {}
  far: {coupling.delay_s: 0.05}
repetitions: 3
seed: 4
trial_s: 0.4
"""
STILL = "[[0, 0], [9, 0]]"


def study(folder: Path, text: str = STUDY) -> Path:
    rig = BENCH.read_text()
    begin, end = rig.index("        waypoints:"), rig.index("  environment:")
    lines = f"{rig[:begin]}        waypoints: {STILL}\n{rig[end:]}\noperate: {{}}\n".splitlines()
    (folder / "bench.yaml").write_text("\n".join(one for one in lines if "wall_" not in one))
    (folder / "study.yaml").write_text(text)
    return folder / "study.yaml"


def trials(path: Path, *options: str, typed: str = "") -> Any:
    words = ["trials", str(path), "--participant", "P1", "--clock", "fake", *options]
    return CliRunner().invoke(main, words, input=typed)


def table(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))


# -- order ----------------------------------------------------------------------------------------


def test_blocks_have_each_condition_once_and_the_participant_decides_their_order(
    tmp_path: Path,
) -> None:
    protocol = read_protocol(study(tmp_path, STUDY.replace("repetitions: 3", "repetitions: 20")))
    order = trials_of(protocol, "P1")
    assert order == trials_of(protocol, "P1")
    assert order != trials_of(protocol, "P2")
    for at in range(0, 40, 2):
        assert {one.condition for one in order[at : at + 2]} == {"near", "far"}
        assert {one.repetition for one in order[at : at + 2]} == {at // 2 + 1}
    assert {one.condition for one in order[::2]} == {"near", "far"}
    shuffled = trials_of(protocol.model_copy(update={"order": "shuffled"}), "P1")
    assert Counter(one[1:] for one in shuffled) == Counter(one[1:] for one in order)
    assert any(shuffled[at].condition == shuffled[at + 1].condition for at in range(0, 40, 2))
    written = trials_of(protocol.model_copy(update={"order": "as_written"}), "P1")
    assert [one.condition for one in written] == ["near", "far"] * 20


def test_mistakes_in_a_protocol_are_sentences_with_their_lines(tmp_path: Path) -> None:
    wrong = STUDY.replace("repetitions: 3", "repetitions: 0").replace("seed", "sed")
    with pytest.raises(ConfigError) as caught:
        read_protocol(study(tmp_path, wrong))
    assert [text.partition(": ")[0].rpartition(":")[2] for text in caught.value.problems] == [
        "7",
        "8",
    ]
    done = trials(study(tmp_path, STUDY.replace("coupling.delay_s", "coupling.delay")), "--yes")
    assert done.exit_code == 2
    assert "did you mean" in done.output
    assert not (tmp_path / "runs").exists()


# -- trials ---------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.nightly
def test_a_study_is_run_asked_about_interrupted_and_resumed(tmp_path: Path) -> None:
    path = study(tmp_path, STUDY.replace("repetitions: 3", "repetitions: 1"))
    out = tmp_path / "out"
    done = trials(path, "--out", str(out), typed="\ny\n")  # nobody answers after the first
    assert done.exit_code != 0
    assert [row["success"] for row in table(out / "trials.csv")] == ["true"]
    done = trials(path, "--out", str(out), "--yes")
    assert done.exit_code == 0, done.output
    rows = table(out / "trials.csv")
    order = trials_of(read_protocol(path), "P1")
    assert [row["condition"] for row in rows] == [one.condition for one in order]
    assert {row["outcome"] for row in rows} == {"finished"}
    assert {float(row["seconds"]) for row in rows} == {0.4}
    assert all(float(row["lever.position_error.rms"]) >= 0.0 for row in rows)
    far = next(row for row in rows if row["condition"] == "far")
    assert "delay_s: 0.05" in (out / far["run"] / "rig.yaml").read_text()
    found = read_recording(out / far["run"] / "recording.mcap")
    assert np.count_nonzero(found["operation.episode"]) == 400


def test_a_study_goes_on_only_by_its_own_protocol_and_table(tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = trials(study(tmp_path), "--out", str(out))
    assert done.exit_code == 2
    assert "trials: the input has ended, so the question cannot be answered" in done.output
    done = trials(study(tmp_path, STUDY.replace("0.4", "0.5")), "--out", str(out))
    assert "trials: trial_s changed since this study began" in done.output
    for junk in ("foo\n", ",".join(FIRST) + "\nP1,first,near,1,,,\n", "\0"):
        (out / "trials.csv").write_text(junk)
        done = trials(study(tmp_path), "--out", str(out))
        assert "is not a table of trials; give another --out" in done.output
        assert (out / "trials.csv").read_text() == junk
    (out / "trials.csv").unlink()
    (out / "protocol.json").write_text("[]")
    assert "is not a study protocol" in trials(study(tmp_path), "--out", str(out)).output


def test_a_trial_orders_nothing_before_it_sees_its_rig(tmp_path: Path) -> None:
    protocol = read_protocol(study(tmp_path))
    assert list(TrialSource(trials_of(protocol, "P1")[0], "reach", 0.4).take(0)) == []


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (3, "trial 1: coupling of lever: it gave 84 mJ too much; it is in the table"),
        (7, "trial 1: bench: disk full; it is in the table"),
        (6, "trial 1: completed, 30 s; it is in the table"),
    ],
)
def test_a_trial_whose_run_ended_with_a_code_says_why(
    code: int, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A run that moved to its end may still have been found passive no longer, or not kept."""
    after = {"invalidated": True, "sentences": ["coupling of lever: it gave 84 mJ too much."]}
    summary = {
        "rig": "bench",
        "outcome": {"kind": "finished", "sentence": "completed, 30 s"},
        "started_utc": "2026-01-01T00:00:00",
        "operation": {"episodes": []},
        "pairs": {},
        "certificate": {"after_run": after if code == 3 else {}},
        **({"incomplete": "disk full"} if code == 7 else {}),
    }

    def run(_: Any, *, out: Path, **__: Any) -> RunResult:
        return RunResult(summary_of(summary)[0], out, code)

    monkeypatch.setattr(running, "run_rig", run)
    done = trials(study(tmp_path), "--out", str(tmp_path / "out"), "--yes")
    assert done.exit_code == code, done.output
    assert words in done.output
    assert len(table(tmp_path / "out" / "trials.csv")) == 1


def test_what_a_trial_that_was_cut_short_left_is_not_written_over(tmp_path: Path) -> None:
    assert _free(tmp_path, "P1-001-near").name == "P1-001-near"
    (tmp_path / "P1-001-near").mkdir()
    assert _free(tmp_path, "P1-001-near").name == "P1-001-near-1"


def test_the_order_is_listed_and_nothing_is_run(tmp_path: Path) -> None:
    done = trials(study(tmp_path), "--list")
    assert done.exit_code == 0
    assert len(done.output.splitlines()) == 6
    assert not (tmp_path / "runs").exists()
    assert "write one word" in trials(study(tmp_path), "--participant", "a b").output


def test_a_break_is_kept_before_the_trial_that_follows_it_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The clock stands still unless somebody sleeps: it says how long the breaks were."""
    clock = FakeClock()

    def three_trials(study: Any, ready: Any, judge: Any, live: Any) -> Path:
        for number, rested in ((1, False), (2, True), (3, False)):
            ready(Trial(number, "near", 1), rested)
        assert judge(Trial(1, "near", 1)) is True
        return tmp_path / "trials.csv"

    monkeypatch.setattr(running, "run_study", three_trials)
    monkeypatch.setattr("tautwave.clock.MonotonicClock", lambda: clock)
    path = study(tmp_path, f"{STUDY}break_every: 1\nbreak_s: 30\n")
    began = clock.now_ns()
    done = trials(path, typed="\n\n\ny\n")
    assert done.exit_code == 0, done.output
    assert done.output.count("break of 30 s") == 1
    assert clock.now_ns() - began == 30_000_000_000
    assert "trial 2 of 6; press Enter to start" in done.output


# -- triggers -------------------------------------------------------------------------------------


def test_a_trigger_shows_episodes_on_the_lines_of_a_port_and_hears_an_edge(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    lines = {"now": 0}

    def ioctl(descriptor: int, request: int, data: bytes) -> bytes:
        bits = struct.unpack("i", data)[0]
        if request == termios.TIOCMBIS:
            lines["now"] |= bits
        elif request == termios.TIOCMBIC:
            lines["now"] &= ~bits
        return struct.pack("i", lines["now"])

    monkeypatch.setattr(trigger.fcntl, "ioctl", ioctl)
    (tmp_path / "port").write_bytes(b"")
    line = TriggerLine(str(tmp_path / "port"), "toggle")
    line.shows(on=True)
    assert lines["now"] == termios.TIOCM_RTS | termios.TIOCM_DTR
    heard = []
    for high in (True, False, True, True, False, True):
        lines["now"] = termios.TIOCM_CTS if high else 0
        heard += [order.word for order in line.take(0)]
    assert heard == ["toggle", "toggle"]  # what is on from the beginning is no edge
    line.close()
    assert not lines["now"] & termios.TIOCM_RTS


def test_a_pipe_gets_bytes_in_place_of_lines(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    line = TriggerLine(str(tmp_path / "pipe"), "engage")
    line.shows(on=True)
    assert line.take(0) == ()
    reading = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    assert os.read(reading, 9) == b"01"
    line.close()
    assert os.read(reading, 9) == b"0"
    os.close(reading)
    with pytest.raises(DriverError, match=r"trigger .*none: No such file"):
        TriggerLine(str(tmp_path / "none"))
