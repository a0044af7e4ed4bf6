"""The resolved rig: every default explicit, and it loads back to an equal rig."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.config import parse_rig, resolved_yaml
from tautwave.config.text.yaml12 import parse_yaml
from tests.config.bench import BENCH

CONFIGS = sorted((Path(__file__).parents[2] / "configs").glob("*.yaml"))


@pytest.mark.sparse(3)
@pytest.mark.installed
@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_round_trip_of_shipped_rigs(path: Path) -> None:
    rig = parse_rig(path.read_text(), path)
    text = resolved_yaml(rig)
    again = parse_rig(text)
    assert again == rig
    assert resolved_yaml(again) == text


def test_every_key_is_there() -> None:
    rig = parse_rig(BENCH)
    values = parse_yaml(resolved_yaml(rig)).value
    absent = ("scene", "link", "operate", "sites", "calibration")
    assert list(values) == [key for key in type(rig).model_fields if key not in absent]
    assert values["loop"]["ring_rows"] == 8192
    assert values["coupling"]["pairs"]["wrist"]["force_scale"] == 1.0
    assert values["simulation"]["axes"]["slave.wrist"]["inertia"] == 1.5e-3


def test_a_recorded_network_loads_back(tmp_path: Path) -> None:
    (tmp_path / "path.csv").write_text("time_s,delay_s,lost\n0.0,0.02,0\n0.001,0.02,1\n")
    source = next(path for path in CONFIGS if path.stem == "network-loopback")
    text = source.read_text()
    rig = parse_rig(text, tmp_path / "rig.yaml", ["link={trace: path.csv}"])
    again = parse_rig(resolved_yaml(rig))
    assert again.link is not None
    assert again.link.trace is not None
    assert Path(again.link.trace).name == "path.csv"


def test_recording_keeps_its_place(tmp_path: Path) -> None:
    (tmp_path / "hand.csv").write_text("time_s,x\n0,0.1\n0.1,0\n")
    override = "simulation.hand.wrist.reference={type: recording, file: hand.csv, column: x}"
    rig = parse_rig(BENCH, tmp_path / "rig.yaml", [override])
    assert parse_rig(resolved_yaml(rig), "elsewhere/rig.yaml") == rig


@given(st.text(st.characters(exclude_categories=["Cs"]), min_size=1))
def test_any_name_survives(name: str) -> None:
    rig = parse_rig(BENCH).model_copy(update={"name": name})
    assert parse_rig(resolved_yaml(rig)).name == name


@given(st.floats(min_value=1e-15, max_value=1e15))
def test_any_number_survives(value: float) -> None:
    rig = parse_rig(BENCH, overrides=[f"slave.axes.wrist.effort_limit={value!r}"])
    assert rig.slave.axes["wrist"].effort_limit == value
    assert parse_rig(resolved_yaml(rig)) == rig


@pytest.mark.parametrize("name", ["no", "1e3", "12:30", "null", "~", "a: b", "# x", "- a", "it's"])
def test_names_that_look_like_something_else(name: str) -> None:
    rig = parse_rig(BENCH).model_copy(update={"name": name})
    assert parse_rig(resolved_yaml(rig)).name == name
