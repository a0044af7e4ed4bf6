"""What a report and a terminal say of an operated run: errors count only while it is coupled."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from tautwave import read_recording
from tautwave.cli import main
from tautwave.summary.ending import eventful, events
from tautwave.summary.model import Summary

BENCH = Path(__file__).parents[2] / "configs" / "bench-1dof-loopback.yaml"
DAY = """\
0.4 engage
0.7 episode <b>pick</b> red block\x1b[31m
1.0 engage
1.3 episode success
1.35 episode next
1.4 hold
"""


def run(tmp_path: Path, day: str) -> tuple[str, Path]:
    (tmp_path / "day.txt").write_text(day)
    out = tmp_path / "run"
    words = ("run", str(BENCH), "--set", "operate={}", "--clock", "fake", "--duration", "1.8",
             "--commands", str(tmp_path / "day.txt"), "--out", str(out))  # fmt: skip
    done = CliRunner().invoke(main, words)
    assert done.exit_code == 0, done.output
    return done.stdout, out


@pytest.fixture(scope="module")
def operated(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    return run(tmp_path_factory.mktemp("day"), DAY)


@pytest.mark.parametrize(
    ("engaged_s", "said", "is_eventful"),
    [(None, "never engaged", True), (0.8, "engaged 0.8 s of 1.8 s", True),
     (1.2, "engaged 1.2 s of 1.8 s", False)],
)  # fmt: skip
def test_how_long_it_was_engaged_is_said(
    engaged_s: float | None, said: str, is_eventful: bool
) -> None:
    """Of a run that was engaged for less than half of its time an event is made."""
    operation = {"engaged_s": engaged_s} if engaged_s else {}
    summary = Summary.model_validate({"duration_s": 1.8, "operation": operation})
    assert events(summary) == [said]
    assert eventful(summary) is is_eventful


@pytest.mark.slow
def test_the_terminal_says_what_people_did(operated: tuple[str, Path]) -> None:
    said = " ".join(operated[0].split())
    assert "engaged 0.798 s of 1.8 s" in said.partition("completed")[0]
    assert "episode 1 <b>pick</b>, red block?[31m: success, 700 ms to 1.3 s" in said
    assert "episode 2 next: no verdict, 1.35 s to 1.8 s" in said
    assert "refused 1; the last after 1 s: engage: not possible while engaged" in said


@pytest.mark.slow
def test_the_report_has_episodes_and_journal(operated: tuple[str, Path]) -> None:
    page = (operated[1] / "report.html").read_text()
    _, _, part = page.partition('<h2 id="operation">')
    cells = re.sub(r"<td[^>]*>", "<td>", part)
    assert "<td>&lt;b&gt;pick&lt;/b&gt;</td><td>red block\x1b[31m</td><td>success</td>" in cells
    assert "<td>engage</td><td>script</td><td>refused</td>" in cells


@pytest.mark.slow
def test_errors_count_only_while_the_pairs_are_coupled(operated: tuple[str, Path]) -> None:
    out = operated[1]
    rows = read_recording(out, ["operation.state", "lever.position_error"])
    coupled = rows["operation.state"] == 2
    error = rows["lever.position_error"]
    summary = json.loads((out / "summary.json").read_text())
    found = summary["pairs"]["lever"]["position_error"]
    assert found["rms"] == pytest.approx(np.sqrt(np.mean(error[coupled] ** 2)))
    assert found["rms"] != pytest.approx(np.sqrt(np.mean(error**2)), rel=0.01)
    assert summary["operation"]["engaged_s"] == pytest.approx(coupled.sum() / 1000.0)


@pytest.mark.slow
@pytest.mark.nightly
def test_a_run_that_was_never_engaged_has_no_error(tmp_path: Path) -> None:
    said, out = run(tmp_path, "0.5 hold\n")
    assert "position_error" not in json.loads((out / "summary.json").read_text())["pairs"]["lever"]
    assert "lever: was never engaged." in (out / "report.html").read_text()
    assert "never engaged" in " ".join(said.split())
