"""`summary.json` is declared, frozen and versioned; wrong values are left out with a sentence."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from tautwave.errors import ConfigError, RecordingError
from tautwave.formats import SUMMARY
from tautwave.summary import (
    Summary,
    plain_summary,
    read_summary,
    summary_of,
    summary_schema,
    summary_text,
    write_summary,
)
from tautwave.summary.model import Outcome, Spread
from tests.commands import keep_in_one_process, tautwave


def test_a_key_that_nobody_declared_is_not_written() -> None:
    with pytest.raises(ValidationError, match="extra_forbidden"):
        Summary.model_validate({"rig": "a", "outcom": {}})
    with pytest.raises(ValidationError, match="frozen"):
        Summary(rig="a").rig = "b"  # type: ignore[misc]


def test_what_is_not_known_is_absent_and_what_is_not_finite_is_null() -> None:
    summary = Summary(rig="a", period_us=Spread(p50=float("nan"), max=float("inf")))
    said = {"format": SUMMARY, "rig": "a", "period_us": {"p50": None, "max": None}}
    assert json.loads(summary_text(summary)) == said
    assert summary.outcome.severity == "open"


def test_a_value_that_is_wrong_is_left_out_and_said(tmp_path: Path) -> None:
    data = {
        "format": SUMMARY,
        "rig": "a",
        "cycles": "many",
        "later": 1,
        "outcome": {"kind": "fault", "sentence": "s", "why": "later"},
        "left_out": [{"element": "a"}, {"reason": "b"}, 3],
        "pairs": {"x": {"kind": "round", "power_ratio": 2.0}, "y": 4},
        "operation": {"episodes": [{"number": 1, "name": "e"}]},
    }
    (tmp_path / "summary.json").write_text(json.dumps(data))
    summary, wrong = read_summary(tmp_path)
    assert summary.cycles is None
    assert summary.outcome == Outcome(kind="fault", sentence="s")
    assert [one.element for one in summary.left_out] == ["a"]
    assert list(summary.pairs) == ["x"]
    assert summary.pairs["x"].kind is None
    assert summary.pairs["x"].power_ratio == 2.0
    assert summary.operation is not None
    assert summary.operation.episodes == ()
    assert {one.partition(": ")[2].partition(":")[0] for one in wrong} == {
        "cycles",
        "left_out.1.element",
        "left_out.2",
        "pairs.x.kind",
        "pairs.y",
        "operation.episodes.0.begin_s",
        "operation.episodes.0.end_s",
    }


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=3),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=6,
)


@given(st.dictionaries(st.sampled_from(sorted(Summary.model_fields)), json_values, max_size=4))
def test_whatever_a_received_file_holds_it_is_read(data: dict[str, Any]) -> None:
    data.pop("format", None)
    summary, _ = summary_of(data)
    assert summary_of(plain_summary(summary)) == (summary, [])


def test_what_cannot_be_read_or_is_newer_is_said(tmp_path: Path) -> None:
    path = tmp_path / "summary.json"
    with pytest.raises(ConfigError, match=r"summary\.json"):
        read_summary(tmp_path)
    for text in ("{", "[]", "{}"):
        path.write_text(text)
        with pytest.raises(ConfigError, match=r"^summary\.json"):
            read_summary(tmp_path)
    path.write_text(json.dumps({"format": SUMMARY + 1}))
    with pytest.raises(RecordingError, match=f"format {SUMMARY + 1} is newer"):
        read_summary(tmp_path)


def test_the_schema_declares_the_keys_that_scripts_depend_on(tmp_path: Path) -> None:
    printed = json.loads(tautwave("report", "--schema", cwd=tmp_path).stdout)
    assert printed == summary_schema()
    wanted = (
        "cycles", "missed_cycles", "rate_hz", "period_us", "compute_us", "wall_time_s", "pairs",
        "energy_j", "axes", "certificate", "left_out",
    )  # fmt: skip
    assert set(wanted) <= set(printed["properties"])
    blocks = printed["$defs"]
    assert {"p50", "p99", "p999", "max"} == set(blocks["Spread"]["properties"])
    energies = {"gross_flow", "residual", "generated", "sensing_gap"}
    assert energies <= set(blocks["Energy"]["properties"])
    assert {"lost", "late", "faults"} == set(blocks["Axis"]["properties"])
    assert {"passed", "verdicts"} <= set(blocks["Certificate"]["properties"])


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    summary = Summary(rig="a", cycles=3, outcome=Outcome(kind="finished", sentence="s"))
    write_summary(tmp_path, summary)
    assert read_summary(tmp_path) == (summary, [])


RIGS = ("bench-1dof-loopback", "bench-gripper-loopback", "network-loopback", "arms/planar")


@pytest.mark.slow
@pytest.mark.parametrize("rig", RIGS)
def test_what_a_run_leaves_is_what_the_schema_says(
    rig: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    keep_in_one_process(monkeypatch)
    config = Path(__file__).parents[2] / "configs" / f"{rig}.yaml"
    words = ("--clock", "fake", "--duration", "0.2", "--out", "out", "--quiet")
    assert tautwave("run", config, *words, cwd=tmp_path).exit_code == 0
    left = json.loads((tmp_path / "out" / "summary.json").read_text())
    jsonschema.validate(left, summary_schema())
    assert left["format"] == SUMMARY
    assert summary_of(left)[1] == []
    assert plain_summary(summary_of(left)[0]) == left
