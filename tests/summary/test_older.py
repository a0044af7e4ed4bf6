"""Summaries of older commits, each made by that commit, are read.

`older/COMMIT-WHAT.json`: `summary.json` of a run on the fake clock of 0.1 s to 1.5 s, of a rig in
`configs` as it was then; its `command` says of which. Nothing of them is changed but paths.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from tautwave.cli.terminal.summary import summary_sections
from tautwave.report.run.loading import load_run
from tautwave.summary import plain_summary, summary_of, summary_schema, summary_text

OLDER = sorted((Path(__file__).parent / "older").glob("*.json"))

NOT_KEPT = {"port_debt"}
"""Of a pair: what `motors.stated_debt` has."""


def differences(old: Any, new: Any, at: str = "") -> list[str]:
    """Return what two JSON values differ in, by path."""
    if isinstance(old, dict) and isinstance(new, dict):
        return [
            found
            for key in sorted(old.keys() | new.keys())
            for found in (
                differences(old[key], new[key], f"{at}.{key}")
                if key in old and key in new
                else [f"{at}.{key}"]
            )
        ]
    return [] if old == new else [at]


def test_there_are_twenty_of_many_commits() -> None:
    assert len(OLDER) >= 20
    assert len({path.name.partition("-")[0] for path in OLDER}) >= 7


@pytest.mark.parametrize("path", OLDER, ids=lambda path: path.stem)
def test_all_that_an_older_summary_says_is_read(path: Path) -> None:
    old = json.loads(path.read_text())
    summary, wrong = summary_of(old)
    assert wrong == []
    changed = differences(old, plain_summary(summary))
    allowed = {".format", ".left_out", ".faults", ".certificate.elements", ".certificate.loops"}
    changed = [one for one in changed if one not in allowed and not one.endswith(".faults")]
    assert {one.rpartition(".")[2] for one in changed} <= NOT_KEPT
    sentences = [f"{one.element}: {one.reason}" for one in summary.left_out]
    assert sentences == old["left_out"]
    assert [one.text for one in summary.faults] == old["faults"]


@pytest.mark.parametrize("path", OLDER, ids=lambda path: path.stem)
def test_it_is_written_as_the_newest_and_read_again(path: Path) -> None:
    summary, _ = summary_of(json.loads(path.read_text()))
    text = json.loads(summary_text(summary))
    jsonschema.validate(text, summary_schema())
    again, wrong = summary_of(text)
    assert wrong == []
    assert again == summary


@pytest.mark.parametrize("path", OLDER, ids=lambda path: path.stem)
def test_it_is_shown_on_a_terminal_and_loaded_by_the_report(path: Path, tmp_path: Path) -> None:
    (tmp_path / "summary.json").write_text(path.read_text())
    run = load_run(tmp_path)
    shown = summary_sections("older", run.result, tmp_path, 0)
    assert {section.title for section in shown} >= {"Devices", "Energy books"}
