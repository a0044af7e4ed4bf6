"""What a run's exit code says, whatever becomes of its recording, its report and its terminal."""

from __future__ import annotations

import json
import os
import re
import resource
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tautwave.runtime.recorder import Recorder, RecorderStats
from tautwave.session import running
from tautwave.session.reporting import final_code, lost_rows
from tautwave.summary import Summary
from tautwave.summary.ending import last_line
from tautwave.summary.model import AfterRun, Certificate, Outcome, Recording
from tests.commands import PATIENT, child_of, keep_in_one_process, tautwave

pytestmark = [pytest.mark.realtime, pytest.mark.usefixtures("no_bytecode")]

RIG = Path(__file__).parents[2] / "configs" / "bench-1dof-loopback.yaml"
STOPPED = "master.axes.lever.position_range=[-0.5,0.01]"
"""A range that the shipped rig's hand leaves within a second."""
WALL = "coupling.pairs.lever.wall_slave.stiffness=900"
"""More than can be certified."""

RUN = "from tautwave.cli import main; main(prog_name='tautwave')\n"
LIGHT = """
import sys, subprocess
from types import SimpleNamespace
from tautwave.session import reporting
def light(command, **keys):
    return subprocess.run([sys.executable, "-c", CHILD, *command[3:]], **keys)
reporting.subprocess = SimpleNamespace(run=light, TimeoutExpired=subprocess.TimeoutExpired)
"""
"""Another process for the report's, which takes seconds to draw."""
NO_FIGURES = """CHILD = '''
import sys, pathlib
from tautwave.report.run.complete import complete_summary, write_summary
from tautwave.report.run.loading import load_run
run = load_run(pathlib.Path(sys.argv[1]))
run.result = complete_summary(run)
write_summary(run)
'''"""
SLOW = "CHILD = 'import time; time.sleep(60)'"
CERTIFYING = """
import sys, time
from tautwave.session import admitting
def certificate_of(rig, ways):
    sys.stderr.write("certifying\\n")
    sys.stderr.flush()
    time.sleep(60)
admitting.certificate_of = certificate_of
"""


def start(tmp_path: Path, code: str, *words: object, **keys: Any) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", code, "run", str(RIG), "--out", "out", *map(str, words)]
    keys = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, **keys}
    return subprocess.Popen(command, cwd=tmp_path, **keys)


def wait_for(run: subprocess.Popen[str], word: str) -> None:
    assert run.stderr is not None
    for line in run.stderr:
        if word in line:
            return
    pytest.fail(f"never said {word!r}")


def summary_of(directory: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((directory / "summary.json").read_text())
    return found


# -- signals -------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_before_anything_moves_is_one_sentence(tmp_path: Path, number: int) -> None:
    with start(tmp_path, CERTIFYING + RUN) as run:
        wait_for(run, "certifying")
        run.send_signal(number)
        _, errors = run.communicate(timeout=60)
    assert run.returncode == 128 + number
    word = {1: "SIGHUP", 2: "Ctrl-C", 15: "SIGTERM"}[number]
    assert errors == f"run: ended by {word} before anything moved; no directory was created\n"
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_signals_during_the_report_end_the_report_and_not_the_exit_code(tmp_path: Path) -> None:
    words = ("--clock", "fake", "--set", STOPPED)
    with start(tmp_path, SLOW + LIGHT + RUN, *words) as run:
        wait_for(run, "reporting")
        run.send_signal(signal.SIGTERM)
        run.send_signal(signal.SIGINT)
        output, errors = run.communicate(timeout=60)
    assert run.returncode == 6
    assert "the report could not be written: interrupted by" in output
    assert "left its position range" in errors.splitlines()[-1]
    assert "Aborted" not in errors
    assert summary_of(tmp_path / "out")["incomplete"] is None


@pytest.mark.slow
def test_a_closed_terminal_ramps_down_and_a_killed_recorder_is_reported(tmp_path: Path) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    with start(
        tmp_path, NO_FIGURES + LIGHT + RUN, "--duration", 60, *PATIENT, stdout=writer
    ) as run:
        os.close(writer)
        wait_for(run, "running")
        writer = child_of(run.pid, "mcap_writer")
        assert writer is not None
        os.kill(writer, signal.SIGKILL)
        run.send_signal(signal.SIGHUP)
        _, errors = run.communicate(timeout=60)
    assert run.returncode == 7
    summary = summary_of(tmp_path / "out")
    assert summary["outcome"]["kind"] == "interrupted"
    last = errors.splitlines()[-1]
    assert last == f"bench-1dof: {summary['incomplete']}"
    assert "the recording is incomplete: the recording's writer was killed by SIGKILL; " in last


# -- a full disk ---------------------------------------------------------------------------------


@contextmanager
def largest_file(size: int) -> Iterator[None]:
    """Let no file grow beyond `size` bytes: a full disk's failing write, without a disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.slow
def test_a_full_disk_is_exit_code_7_in_the_last_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    keep_in_one_process(monkeypatch)

    class Small(Recorder):
        def start(self) -> None:
            super().start()
            assert self.writer_pid is not None
            resource.prlimit(self.writer_pid, resource.RLIMIT_FSIZE, (60_000, 60_000))

    monkeypatch.setattr(running, "Recorder", Small)
    words = ("--clock", "fake", "--duration", 1, "--out", "out")
    done = tautwave("run", RIG, *words, cwd=tmp_path)
    assert done.exit_code == 7, done.stderr
    recording = summary_of(tmp_path / "out")["recording"]
    assert 0 < recording["rows_written"] == recording["rows_read"] < recording["rows_offered"]
    last = done.stderr.splitlines()[-1]
    reported = r"bench-1dof: the recording is incomplete: the recording .* cannot be written: File"
    assert re.match(reported, last)
    assert f"{recording['rows_written']} rows are in" in last


@pytest.mark.slow
def test_no_room_for_the_summary_is_exit_code_7_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    keep_in_one_process(monkeypatch)
    real = Recorder.close

    def close(self: Recorder) -> RecorderStats:
        stats = real(self)
        resource.setrlimit(resource.RLIMIT_FSIZE, (100, resource.RLIM_INFINITY))
        return stats

    monkeypatch.setattr(Recorder, "close", close)
    words = ("--clock", "fake", "--duration", 1, "--set", STOPPED)
    with largest_file(resource.RLIM_INFINITY):
        done = tautwave("run", RIG, *words, "--out", "out", cwd=tmp_path)
    assert done.exit_code == 6
    last = done.stderr.splitlines()[-1]
    assert "left its position range" in last
    assert last.endswith("; out/summary.json: cannot be written: File too large")
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "recording.mcap", "rig.yaml",
    ]  # fmt: skip


def test_report_on_a_full_disk_is_one_sentence_and_keeps_the_old_page(tmp_path: Path) -> None:
    (tmp_path / "summary.json").write_text('{"rig": "a", "cycles": 0}')
    (tmp_path / "report.html").write_text("old")
    with largest_file(1000):
        done = tautwave("report", tmp_path, cwd=tmp_path)
    assert done.exit_code == 7
    assert done.stderr == f"{tmp_path}/report.html: cannot be written: File too large\n"
    assert (tmp_path / "report.html").read_text() == "old"
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.slow
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_output_to_a_full_disk_is_one_sentence_too(unbuffered: str) -> None:
    """Also where Python keeps what it could not write: it tries again at its end."""
    command = [sys.executable, "-c", RUN, "drivers"]
    kept = {**os.environ, "PYTHONUNBUFFERED": unbuffered}
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            command, stdout=full, stderr=subprocess.PIPE, text=True, check=False, env=kept
        )
    assert done.returncode == 7
    assert done.stderr == "output: cannot be written: No space left on device\n"


@pytest.mark.slow
@pytest.mark.parametrize("word", ["--help", "--version"])
def test_no_room_for_the_help_is_one_sentence(word: str) -> None:
    command = [sys.executable, "-c", RUN, word]
    with open("/dev/full", "w") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 7
    assert done.stderr == "output: cannot be written: No space left on device\n"


@pytest.mark.slow
@pytest.mark.parametrize("words", [("check", "none.yaml"), ("nothing",), ("run", "--bad")])
def test_an_error_that_nobody_can_read_keeps_its_exit_code(words: tuple[str, ...]) -> None:
    with open("/dev/full", "w") as full:
        done = subprocess.run([sys.executable, "-c", RUN, *words], stderr=full, check=False)
    assert done.returncode == 2


@pytest.mark.slow
def test_check_on_a_full_disk_is_exit_code_7_and_leaves_no_half_file(tmp_path: Path) -> None:
    with largest_file(1000):
        done = tautwave("check", RIG, "--out", "out", cwd=tmp_path)
    assert done.exit_code == 7
    assert done.stderr == "out/check.json: cannot be written: File too large\n"
    assert not list((tmp_path / "out").iterdir())


@pytest.mark.slow
def test_the_summary_of_a_stop_says_when_on_which_axis_and_why_as_data(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    keep_in_one_process(monkeypatch)
    words = ("--clock", "fake", "--duration", 1, "--out", "out", "--set", STOPPED)
    done = tautwave("run", RIG, *words, cwd=tmp_path)
    assert done.exit_code == 6, done.stderr
    reported = summary_of(tmp_path / "out")["outcome"]
    assert (reported["kind"], reported["reason"]) == ("safety_stop", "position_range")
    assert reported["sentence"].startswith(f"{reported['axis']} left its position range")
    assert f" at {reported['at_s']:.3f} s: " in reported["sentence"]


# -- standard streams ----------------------------------------------------------------------------


@pytest.mark.slow
def test_a_run_without_standard_streams_is_a_run(tmp_path: Path) -> None:
    """What is opened next would take their numbers, and prints would go into a recording."""
    code = LIGHT + NO_FIGURES + "\n" + RUN
    words = ["run", str(RIG), "--clock", "fake", "--duration", "0.2", "--out", "out"]
    closed = ["sh", "-c", 'exec "$0" "$@" <&- >&- 2>&-', sys.executable, "-c", code, *words]
    done = subprocess.run(closed, cwd=tmp_path, check=False)
    assert done.returncode == 0
    recording = summary_of(tmp_path / "out")["recording"]
    assert recording["rows_written"] == recording["rows_offered"] == 200


@pytest.mark.slow
@pytest.mark.parametrize("words", [(), ("--json",), ("--set", WALL)])
def test_a_reader_that_has_gone_changes_no_exit_code_of_a_check(words: tuple[str, ...]) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    with open(writer, "w") as gone:
        done = subprocess.run(
            [sys.executable, "-c", RUN, "check", str(RIG), *words],
            stdout=gone,
            stderr=subprocess.PIPE,
            check=False,
        )
    assert (done.returncode, done.stderr) == (3 if WALL in words else 0, b"")


# -- a recording that lost rows ------------------------------------------------------------------


@pytest.mark.sparse(2)
@pytest.mark.parametrize(("more", "code"), [((), 7), (("--set", STOPPED), 6)])
def test_a_recorder_that_is_killed_shows_in_code_and_last_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, more: tuple[str, ...], code: int
) -> None:
    keep_in_one_process(monkeypatch)

    class Killed(Recorder):
        def start(self) -> None:
            super().start()
            assert self.writer_pid is not None
            os.kill(self.writer_pid, signal.SIGKILL)

    monkeypatch.setattr(running, "Recorder", Killed)
    words = ("--clock", "fake", "--duration", 1, "--out", "out")
    done = tautwave("run", RIG, *words, *more, cwd=tmp_path)
    assert done.exit_code == code, done.stderr
    last = done.stderr.splitlines()[-1]
    assert ("left its position range" in last) == (code == 6)
    assert "the recording is incomplete: the recording's writer was killed by SIGKILL" in last


@pytest.mark.slow
def test_a_file_that_was_cut_short_behind_our_back_is_exit_code_7(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    keep_in_one_process(monkeypatch)
    real = Recorder.close

    def close(self: Recorder) -> RecorderStats:
        stats = real(self)
        os.truncate(self.path, stats.bytes // 2)
        return stats

    monkeypatch.setattr(Recorder, "close", close)
    words = ("--clock", "fake", "--duration", 1, "--out", "out")
    done = tautwave("run", RIG, *words, cwd=tmp_path)
    assert done.exit_code == 7
    assert " of the 1000 rows that were written can be read back" in done.stderr.splitlines()[-1]


def test_dropped_rows_and_a_missing_end_are_incomplete() -> None:
    reported = {"error": None, "rows_offered": 10, "rows_written": 10, "rows_dropped": 0}
    assert lost_rows(Recording(**reported)) == ""
    assert lost_rows(Recording(**reported, rows_read=10)) == ""
    assert "its end is missing" in lost_rows(Recording(**reported, truncated=True))
    dropped = lost_rows(Recording(**{**reported, "rows_dropped": 3}))
    assert "3 of 10 rows were dropped because the writer fell behind" in dropped


@pytest.mark.parametrize("code", [0, 5, 6])
@pytest.mark.parametrize("invalidated", [False, True])
@pytest.mark.parametrize("incomplete", [False, True])
def test_6_5_and_3_outrank_7(code: int, invalidated: bool, incomplete: bool) -> None:
    expected = code or (3 if invalidated else 7 if incomplete else 0)
    assert final_code(code, invalidated, incomplete) == expected


def test_the_last_line_names_both() -> None:
    after = AfterRun(sentences=("one", "the period was 2 ms."))
    summary = Summary(
        outcome=Outcome(kind="fault", sentence="arm: no answer."),
        certificate=Certificate(after_run=after),
        incomplete="the recording is incomplete: disk full",
    )
    assert last_line("a", summary, 5) == "arm: no answer; the recording is incomplete: disk full"
    three = last_line("a", summary, 3).splitlines()
    assert three == ["one", "the period was 2 ms; the recording is incomplete: disk full"]
    assert last_line("a", summary, 7) == "a: the recording is incomplete: disk full"
    assert last_line("a", summary.model_copy(update={"incomplete": None}), 5) == "arm: no answer."


@pytest.mark.parametrize("words", [("--help",), ("run", "--help")])
def test_the_codes_stand_in_the_help(tmp_path: Path, words: tuple[str, ...]) -> None:
    text = " ".join(tautwave(*words, cwd=tmp_path).stdout.split())
    for code in (
        "0 fine",
        "1 an unexpected",
        "2 usage",
        "3 not",
        "4 bus-time",
        "5 bus",
        "6 safety",
        "7 a",
    ):
        assert f" {code}" in text
    assert "129, 130, 143" in text
