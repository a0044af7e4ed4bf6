"""`python -m tests.lab papers` as a command: lists, tables, files, exit codes."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from tests.lab import papers as reproduce
from tests.lab.command import lab
from tests.lab.papers import CHAPTERS, Chapter, Row, positive_real
from tests.lab.papers.command import papers

Cli = Callable[..., Result]


@pytest.fixture
def laboratory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Cli:
    """The command line, in a directory of its own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(lab.commands, "papers", papers)
    return lambda *words: CliRunner().invoke(lab, [str(word) for word in words])


def test_a_row_that_differs_is_said_and_ends_in_1(
    laboratory: Cli, monkeypatch: pytest.MonkeyPatch
) -> None:
    reported = [Row("half", "1", 0.5, 0.5, 0.0, "arithmetic"), Row("two", "1", 2.1, 2.0, 0.05, "x")]
    monkeypatch.setattr(positive_real, "CHAPTER", Chapter(lambda: reported, {}))
    done = laboratory("papers", "positive-real")
    assert done.exit_code == 1
    assert "differs" in done.stdout.splitlines()[-1]
    assert done.stderr == "differs from the reference: positive-real: two\n"
    assert not Row("nothing", "1", math.nan, 1.0, 0.1, "x").agrees


def test_without_a_name_chapters_are_listed(laboratory: Cli) -> None:
    done = laboratory("papers")
    assert done.exit_code == 0
    for name, summary in CHAPTERS.items():
        assert name in done.stdout
        assert summary in done.stdout
    listed = json.loads(laboratory("papers", "--json").stdout)
    assert [entry["name"] for entry in listed] == list(CHAPTERS)


@pytest.mark.slow
def test_a_name_writes_table_and_figures(laboratory: Cli, tmp_path: Path) -> None:
    done = laboratory("papers", "positive-real", "--out", "papers")
    assert done.exit_code == 0, done.output
    assert {path.name for path in (tmp_path / "papers").iterdir()} == {
        f"positive-real.{ending}" for ending in ("txt", "json", "svg", "png")
    }
    rows = json.loads((tmp_path / "papers/positive-real.json").read_text())
    assert all(row["agrees"] for row in rows)
    assert "prefers-color-scheme: dark" in (tmp_path / "papers/positive-real.svg").read_text()


@pytest.mark.slow
def test_without_a_name_all_go_into_a_directory(
    laboratory: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        reproduce, "CHAPTERS", {k: CHAPTERS[k] for k in ("resonator", "positive-real")}
    )
    done = laboratory("papers", "--out", "all")
    assert done.exit_code == 0, done.output
    assert {path.stem for path in (tmp_path / "all").iterdir()} == {
        "resonator", "resonator-bode", "resonator-nyquist", "positive-real"
    }  # fmt: skip


def test_bad_names_and_directories_are_one_sentence(laboratory: Cli, tmp_path: Path) -> None:
    done = laboratory("papers", "resonater")
    assert done.exit_code == 2
    assert done.stderr == (
        "nothing to reproduce is called 'resonater'; did you mean 'resonator'?\n"
    )
    (tmp_path / "taken").write_text("a file")
    done = laboratory("papers", "positive-real", "--out", "taken")
    assert done.exit_code == 2
    assert done.stderr == "taken: cannot be a directory: File exists\n"
    assert (tmp_path / "taken").read_text() == "a file"
