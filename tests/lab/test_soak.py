"""The soak accounts for what it did, and notices what stays."""

from __future__ import annotations

import json
import os
import tempfile
import threading
from collections import Counter
from pathlib import Path
from typing import Any

import click
import pytest

from tautwave.bench.result import Goal, Suite
from tests.lab import soak
from tests.lab.kept import append_suites
from tests.lab.soak import Held, Leftovers, held

SUMMARY = {
    "outcome": {"sentence": "completed"},
    "recording": {"rows_written": 90, "rows_dropped": 2, "bytes": 7},
    "energy_j": {"gross_flow": 2.0, "residual": -1e-8, "generated": 0.0, "sensing_gap": 0.5,
                 "motors_net": 0.25},
    "cycles": 100,
    "missed_cycles": 3,
}  # fmt: skip


def measured(samples: Any, **given: Any) -> dict[str, float | None]:
    failed = Counter({"look": 1})
    counts = Counter({"look": 2})
    suite = soak._long_suite(30.0, 0, SUMMARY, samples, counts, failed, 4, None)
    rows = dict(suite.tables[2].rows)  # type: ignore[arg-type]
    assert rows["gross_flow_j"] == 4.0  # of half an hour
    return {goal.name: goal.measured for goal in suite.goals}


def test_what_is_lost_grows_or_stays_is_in_the_goals() -> None:
    steady = Held(50.0, 7, 2, 1)
    samples = [
        (0.5, Held(10.0, 3, 1, 1), steady),  # not yet settled
        (1.0, Held(90.0, 7, 2, 1), steady),
        (4.0, Held(96.0, 9, 2, 1), steady._replace(memory_mb=51.0)),
    ]
    found = measured(samples)
    assert found["cycles that are not in the recording"] == 10.0
    assert found["rows dropped"] == 2.0
    assert found["memory the run gained"] == 6.0
    assert found["descriptors the run gained"] == 2.0
    assert found["memory the page's server gained"] == 1.0
    assert found["residual over gross flow"] == pytest.approx(5e-9)
    assert found["faults that failed"] == 1.0
    assert found["temporary files and shared memories left"] == 4.0
    with pytest.raises(click.ClickException, match="give more minutes"):
        measured([])


def test_the_hour_is_kept_although_the_short_runs_are_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stopped(*given: Any) -> Suite:
        raise KeyboardInterrupt

    monkeypatch.setattr(soak, "long", lambda *given, **more: Suite("soak", [], []))
    monkeypatch.setattr(soak, "short", stopped)
    kept = tmp_path / "nightly.jsonl"
    with pytest.raises(KeyboardInterrupt):
        soak.soak.callback(1.0, 1, 0, False, kept, False)  # type: ignore[misc]
    assert [json.loads(line)["bench"] for line in kept.read_text().splitlines()] == ["soak"]


def test_leftovers_and_what_a_process_holds_are_counted(tmp_path: Path) -> None:
    before = held(os.getpid())
    with Leftovers(tmp_path / "temporary") as leftovers:
        assert os.environ["TMPDIR"] == str(tmp_path / "temporary")
        (tmp_path / "temporary" / "kept").touch()
        assert leftovers.count() == 1
    assert "TMPDIR" not in os.environ
    over = threading.Event()
    waiting = threading.Thread(target=over.wait)
    with tempfile.TemporaryFile():
        waiting.start()
        now = held(os.getpid())
        over.set()
        waiting.join()
    assert (now.descriptors, now.threads) == (before.descriptors + 1, before.threads + 1)


@pytest.mark.nightly
@pytest.mark.slow
def test_short_runs_leave_nothing() -> None:
    suite = soak.short(2, lambda _: None)
    assert {goal.name: goal.met for goal in suite.goals if goal.measured is not None} == {
        "short runs that did not end with 0": True,
        "descriptors gained": True,
        "threads gained": True,
        "processes left": True,
        "temporary files and shared memories left": True,
    }


@pytest.mark.nightly
@pytest.mark.slow
@pytest.mark.realtime
def test_a_run_under_faults_accounts_for_its_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(soak, "FAULT_S", 0.5)
    suite = soak.long(0.2, 1, link=False, tell=lambda _: None)
    found = {goal.name: goal.measured for goal in suite.goals}
    assert found["cycles that are not in the recording"] == 0.0
    assert found["rows dropped"] == 0.0
    assert found["temporary files and shared memories left"] == 0.0
    assert sum(int(row[1] or 0) for row in suite.tables[0].rows) > 0


def test_numbers_of_each_night_are_kept(tmp_path: Path) -> None:
    suite = Suite("soak", [], [Goal("rows dropped", 0.0, "", 1.0)])
    for _ in range(2):
        append_suites(tmp_path / "kept.jsonl", [suite])
    lines = [json.loads(line) for line in (tmp_path / "kept.jsonl").read_text().splitlines()]
    assert [(one["bench"], one["goals"][0]["met"]) for one in lines] == [("soak", False)] * 2
    assert lines[0]["at"] <= lines[1]["at"]
