"""`tautwave compile` as a command."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from tautwave.cli import main
from tautwave.simulation import run

pytest.importorskip("numba")
pytestmark = pytest.mark.timeout(400)  # where the kernel is not in the cache yet
RIG = Path(__file__).parents[2] / "configs" / "bench-1dof-loopback.yaml"


def test_what_is_in_the_cache_is_said_to_be(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "is_compiled", lambda rig: True)
    done = CliRunner().invoke(main, ["compile", str(RIG)])
    assert done.exit_code == 0, done.output
    assert done.output == "bench-1dof: law wave: in the cache already\n"


def test_a_compile_says_what_it_waits_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "is_compiled", lambda rig: False)
    done = CliRunner().invoke(main, ["compile"])
    assert done.exit_code == 0, done.output
    assert "bench-1dof: compiling law wave, about half a minute" in done.output
    assert "law wave: compiled in" in done.output
    [entry] = json.loads(CliRunner().invoke(main, ["compile", "--json"]).stdout)
    assert entry["rig"] == "bench-1dof"
    assert entry["compiled"]


def test_a_file_that_is_not_there_is_one_sentence() -> None:
    done = CliRunner().invoke(main, ["compile", "nowhere.yaml"])
    assert done.exit_code == 2
    assert "nowhere.yaml" in done.output
