"""A run that moved well is kept and reported, even if its report cannot be written."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tautwave.config import load_rig
from tautwave.session import running

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
    assert done.summary["report_error"] == kept["report_error"]
    assert kept["outcome"]["kind"] == "finished"
    assert load_rig(out / "rig.yaml").duration_s == 0.1  # what replays it takes that
    port = kept["certificate"]["elements"]["master.lever port"]
    assert port["true_j"] > kept["pairs"]["lever"]["claim_j"]["master"] > 0.0
    assert (out / "recording.mcap").stat().st_size > 1000
