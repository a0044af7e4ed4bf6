"""How a run that generated energy ends, and what a person is told of one that did not do well."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import yaml
from click.testing import Result

from tautwave.report.run.loading import load_run
from tautwave.report.run.verdicts import verdicts
from tests.commands import keep_in_one_process, page_of, tautwave
from tests.report.test_judging import BUZZING, HASTY, lost
from tests.rigs.running import Plain, Tree, tree

EARLY = {"simulation.hand.a.reference.waypoints": HASTY}


def judged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: Tree, *words: str
) -> tuple[Result, dict[str, Any]]:
    """Run the spring that has no room for a lost sample, changed; return its summary too."""
    keep_in_one_process(monkeypatch)
    file = tmp_path / "rig.yaml"
    file.write_text(yaml.dump(tree(change, base=BUZZING), Dumper=Plain, sort_keys=False))
    done = tautwave("run", file, "--clock", "fake", "--out", "out", *words, cwd=tmp_path)
    assert (tmp_path / "out").exists(), done.output
    return done, json.loads((tmp_path / "out" / "summary.json").read_text())


def test_a_run_that_generated_energy_is_exit_code_3_with_both_numbers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done, summary = judged(tmp_path, monkeypatch, lost(0.5) | EARLY, "--duration", "2")
    assert done.exit_code == 3, done.output
    assert summary["certificate"]["passed"]
    [found] = summary["certificate"]["after_run"]["generated"].values()
    assert found["rule"] == "spring"
    assert found["given_j"] > found["floor_j"]
    last = done.stderr.splitlines()[-1]
    assert last.startswith(found["sentence"])
    assert "lower its stiffness" in last
    assert (
        "more than the damping of its devices, by its lower bounds, could have dissipated" in last
    )
    said = " ".join(done.stdout.split())
    assert "certificate passive: conditional, before the run; invalidated by it" in said
    assert said.count(" ".join(found["sentence"].split())) == 1
    page = page_of(tmp_path / "out")
    assert page.index("This run generated energy") < page.index("Energy books")
    assert "Before the run: passive: conditional" in page
    assert "Its energy is judged by what its spring holds" in page


@pytest.mark.slow
def test_the_same_run_with_every_sample_is_exit_code_0(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done, summary = judged(tmp_path, monkeypatch, EARLY, "--duration", "1")
    assert done.exit_code == 0, done.output
    [found] = summary["certificate"]["after_run"]["generated"].values()
    assert found["passed"]
    assert found["given_j"] <= found["floor_j"]
    assert summary["warnings"] == []
    assert "certificate passive: conditional energy books closed" in " ".join(done.stdout.split())


@pytest.mark.slow
def test_a_safety_stop_outranks_it_and_the_sentence_is_there_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    change = {**lost(0.5), **EARLY, "slave.axes.a.position_range": [-1.0, 0.062]}
    done, summary = judged(tmp_path, monkeypatch, change, "--duration", "8")
    assert done.exit_code == 6, done.output
    first, second = done.stderr.splitlines()[-2:]
    assert "left its position range" in first
    [found] = summary["certificate"]["after_run"]["generated"].values()
    assert second == found["sentence"]


@pytest.mark.slow
def test_no_more_than_stability_is_required_and_it_is_a_note(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    change = {**lost(0.5), **EARLY, "require": "coupled_stable"}
    done, summary = judged(tmp_path, monkeypatch, change, "--duration", "2")
    assert done.exit_code == 0, done.output
    after = summary["certificate"]["after_run"]
    [found] = after["generated"].values()
    assert not found["passed"]
    assert any(found["sentence"] in note and "allows that" in note for note in after["notes"])


@pytest.mark.slow
def test_a_condition_that_the_run_did_not_keep_is_named_with_its_cycles(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A spring with room to spare, and a motor that is slow: no joule too much, but no proof."""
    change = {
        **EARLY,
        "coupling.pairs.a": {"stiffness": 300, "damping": 0.0},
        "master.axes.a.effort_rate_limit": 20.0,
        "slave.axes.a.effort_rate_limit": 20.0,
    }
    done, summary = judged(tmp_path, monkeypatch, change, "--duration", "1")
    assert done.exit_code == 0, done.output
    [master, slave] = summary["certificate"]["after_run"]["broken_conditions"]
    assert "if the effort_rate_limit of master.a is not reached in the coupling; it was" in master
    assert "slave.a" in slave
    assert "on conditions that this run did not meet" in done.stdout
    found = verdicts(load_run(tmp_path / "out"))[-1]
    assert found.status == "note"
    assert found.sentences[0] == "Passed, on conditions that this run did not meet."


@pytest.mark.slow
@pytest.mark.parametrize("stalls", [0.0, 0.02])
def test_a_gap_longer_than_a_spring_s_condition_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stalls: float
) -> None:
    limits = {f"{side}.axes.a.velocity_limit": 0.5 for side in ("master", "slave")}
    change = {
        **EARLY,
        **limits,
        **{f"{side}.axes.a.effort_rate_limit": 1e5 for side in ("master", "slave")},
        "coupling.pairs.a": {"stiffness": 60, "damping": 0.0},
        "coupling.engage_ramp_s": 0.02,
        "loop": {"missing_limit": 20, "overrun_limit": 30},
        "simulation.faults": {"overrun_probability": stalls, "overrun_slots": 20},
    }
    done, summary = judged(tmp_path, monkeypatch, change, "--duration", "1")
    assert done.exit_code == 0, done.output
    said = summary["certificate"]["after_run"]["broken_conditions"]
    assert bool(said) == (stalls > 0.0)
    for one in said:
        assert "if no gap between samples of" in one
        assert one.endswith("; it had no sample for 21\u202fms.")


STUCK = {
    "duration_s": 2.0,
    **EARLY,
    "require": "coupled_stable",
    "coupling.pairs.a": {"stiffness": 300, "damping": 0.0},
    "master.axes.a.effort_limit": 1.0,
    "slave.axes.a.effort_limit": 0.02,
    "slave.axes.a.coulomb": {"value": 0.1, "lower": 0.05, "source": "measured"},
    "simulation.axes": {"slave.a": {"coulomb": 0.1}},
}  # fmt: skip
"""A slave that never moves: its motor cannot break its friction loose."""


@pytest.mark.slow
@pytest.mark.parametrize("expect", [[], ["at_limit", "position_error"]])
def test_a_slave_that_never_moves_is_warned_of_unless_it_is_meant(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, expect: list[str]
) -> None:
    change = {**STUCK, "expect": expect}
    done, summary = judged(tmp_path, monkeypatch, change, "--allow-uncertified")
    assert done.exit_code == 0, done.output
    page = page_of(tmp_path / "out")
    if expect:
        assert summary["warnings"] == []
        assert "Warnings" not in page
        return
    slave, apart = summary["warnings"]
    assert slave.startswith("slave.a was at its limit in ")
    assert "its ends were " in apart
    said = " ".join(done.stdout.split())
    for sentence in summary["warnings"]:
        assert " ".join(sentence.partition("(")[0].split()) in said
        assert sentence in page


@pytest.mark.slow
def test_an_operated_day_that_was_hardly_engaged_is_warned_of(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "day.txt").write_text("0.7 engage\n0.9 hold\n")
    change = {"operate": {}, "coupling.engage_ramp_s": 0.05}
    words = ("--duration", "1", "--commands", "day.txt")
    done, summary = judged(tmp_path, monkeypatch, change, *words)
    assert done.exit_code == 0, done.output
    [warned] = summary["warnings"]
    assert warned.startswith("Engaged for ")
    assert warned.endswith("of 1\u202fs.")
