"""A run that moved well is kept and reported, even if its report cannot be written."""

from __future__ import annotations

import json
import os
import pty
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tautwave.config import load_rig
from tautwave.errors import WritingError
from tautwave.report import __main__ as drawing
from tautwave.session import reporting, running
from tautwave.summary import Summary, read_summary, write_summary

COMMAND = [sys.executable, "-c", "from tautwave.cli import main; main(prog_name='tautwave')"]
RIG = Path(__file__).parents[2] / "configs" / "bench-1dof-loopback.yaml"


def raising(error: BaseException) -> Callable[..., Any]:
    def run(*_: Any, **__: Any) -> Any:
        raise error

    return run


def answering(code: int, reported: str) -> Callable[..., Any]:
    def run(command: list[str], **_: Any) -> Any:
        return subprocess.CompletedProcess(command, code, "", reported)

    return run


@pytest.mark.slow
@pytest.mark.parametrize(
    ("instead", "words"),
    [
        (
            raising(KeyboardInterrupt()),
            "interrupted by Ctrl-C; run `tautwave report {out}` to write it",
        ),
        (raising(subprocess.TimeoutExpired("x", 600)), "it took over 600 s; run `tautwave report"),
        (answering(1, "Traceback\nMemoryError: no room\n"), "MemoryError: no room"),
        (answering(-9, ""), "no reason given"),
    ],
    ids=["Ctrl-C", "slow", "failed", "killed"],
)
def test_a_report_that_is_not_written_costs_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, instead: Callable[..., Any], words: str
) -> None:
    real = subprocess.run

    def run(command: list[str], *more: Any, **keys: Any) -> Any:
        if "tautwave.report" in command:
            assert keys["start_new_session"]  # Ctrl-C in the terminal is not for it
            return instead(command, *more, **keys)
        return real(command, *more, **keys)

    monkeypatch.setattr(subprocess, "run", run)
    out = tmp_path / "out"
    done = running.run(load_rig(RIG), out=out, clock="fake", duration_s=0.1)
    assert done.exit_code == 0
    kept = json.loads((out / "summary.json").read_text())
    expected = "the report could not be written: " + words.format(out=out)
    assert kept["report_error"].startswith(expected)
    assert done.summary.report_error == kept["report_error"]
    assert kept["outcome"]["kind"] == "finished"
    assert load_rig(out / "rig.yaml").duration_s == 0.1  # what replays it takes that
    port = kept["certificate"]["elements"]["master.lever port"]
    assert port["true_j"] > kept["pairs"]["lever"]["claim_j"]["master"] > 0.0
    assert (out / "recording.mcap").stat().st_size > 1000


def test_a_drawing_that_nobody_waits_for_says_in_the_summary_why_it_failed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without room the run is incomplete; in a directory that was removed there is none to tell."""
    summary = Summary.model_construct(_fields_set=set())
    for error, incomplete in (
        (WritingError("report.html: no space left on device"), True),
        (ValueError("no such colour"), False),
    ):
        write_summary(tmp_path, summary)
        monkeypatch.setattr(drawing, "draw", raising(error))
        assert drawing.draw_alone(tmp_path) == 1
        found, _ = read_summary(tmp_path)
        assert str(error) in str(found.report_error)
        assert (found.incomplete == found.report_error) is incomplete
    assert drawing.draw_alone(tmp_path / "gone") == 1


@pytest.mark.slow
def test_on_a_terminal_the_run_ends_judged_and_the_report_follows(tmp_path: Path) -> None:
    """The summary is then complete but for the precision, which takes a replay."""
    words = ["run", str(RIG), "--clock", "fake", "--duration", "0.2", "--quiet", "--out", "out"]
    main, side = pty.openpty()
    try:
        done = subprocess.run(
            [*COMMAND, *words], cwd=tmp_path, stdin=subprocess.DEVNULL, stdout=side, check=False
        )
        printed = os.read(main, 100_000).decode()
    finally:
        os.close(main)
        os.close(side)
    assert done.returncode == 0
    assert "report.html" in printed
    summary = tmp_path / "out" / "summary.json"
    judged = summary.read_text()
    page = tmp_path / "out" / "report.html"
    for _ in range(600):
        if page.exists() and "precision" in json.loads(summary.read_text()):
            break
        time.sleep(0.1)
    assert page.stat().st_size > 50_000
    found, later = (json.loads(text) for text in (judged, summary.read_text()))
    found.pop("precision", None)  # where the report was ready before this read it
    assert "after_run" in found["certificate"]
    assert "error" not in later.pop("precision")
    assert later == found


@pytest.mark.slow
def test_a_directory_that_was_removed_takes_the_recording_with_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "run"
    report = running.report_run

    def removed(directory: Path, *rest: Any) -> Any:
        shutil.rmtree(directory)
        return report(directory, *rest)

    monkeypatch.setattr(running, "report_run", removed)
    result = running.run(load_rig(RIG), out=out, clock="fake", duration_s=0.1)
    assert result.exit_code == WritingError.exit_code
    assert result.summary.incomplete == (
        f"{out} was removed during the run, and its recording is gone with it"
    )
    assert not out.exists()


def test_a_report_that_is_drawn_later_outlives_the_terminal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    spawned: list[tuple[list[str], dict[str, Any]]] = []
    monkeypatch.setattr(subprocess, "run", answering(0, ""))
    monkeypatch.setattr(os, "posix_spawn", lambda _, words, __, **how: spawned.append((words, how)))
    reporting.report_run(tmp_path, Summary(), 0, draw_later=True)
    ((words, how),) = spawned
    assert words[1:] == ["-m", "tautwave.report", "--draw", str(tmp_path)]
    assert how["setsid"]  # in a session of its own
    assert [(one[1], one[2]) for one in how["file_actions"]] == [
        (at, os.devnull) for at in range(3)
    ]
