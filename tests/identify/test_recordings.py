"""`identify RECORDING`: columns, gaps, runs, and the bench's own recordings where they are."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner, Result

from tautwave.analysis.identification.regression import Estimate
from tautwave.cli import main
from tautwave.config import load_rig, parse_rig
from tautwave.session import run
from tautwave.session.identification.recorded import contact_snippet, identify_recording
from tautwave.session.identification.recorded_columns import csv_columns
from tests.analysis.test_identify_models import contact_recording

ROOT = Path(__file__).parents[2]
DATA = ROOT.parent / "shared" / "data" / "teleop-1dof"
needs_data = pytest.mark.skipif(not DATA.is_dir(), reason="the bench's recordings are not here")
Cli = Callable[..., Result]


@pytest.fixture
def cli(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Cli:
    monkeypatch.chdir(tmp_path)
    return lambda *words: CliRunner().invoke(main, [str(word) for word in words])


def write(path: Path, columns: Mapping[str, object]) -> Path:
    header = ",".join(columns)
    table = np.stack([np.asarray(c, dtype=float) for c in columns.values()], axis=1)
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.9g")
    return path


NAMES = ("time_s", "arm_position_m", "contact_force_n")
STILL = {"time_s": np.arange(5000) * 1e-3, "position": np.zeros(5000), "force": np.zeros(5000)}
SHORT = {"time_s": [0, 0.1, 0.2], "position": [0, 1, 2], "force": [0, 1, 2]}


def contact_csv(path: Path, kind: str = "contact", names: tuple[str, str, str] = NAMES) -> Path:
    position, effort = contact_recording(kind, 1)
    time, place, force = names
    return write(path, {time: np.arange(len(position)) * 5e-4, place: position, force: effort})


# -- the bench's recordings; the bands are of repeated contacts of one bench ----------------------


@pytest.mark.sparse(6)
@needs_data
@pytest.mark.parametrize(
    ("name", "model", "low", "high"),
    [
        ("m1_d_rigid", "contact", 330.0, 400.0),
        ("m2_a_rigid", "contact", 270.0, 325.0),
        ("m1_d_spring", "preloaded", 8.1, 8.5),
        ("m2_a_spring", "spring", 3.4, 3.8),
        ("m2_a_foam", "hunt_crossley", 4.0, 12.0),
        ("m1_d_foam", "preloaded", 4.0, 11.0),
    ],
)
def test_the_bench(name: str, model: str, low: float, high: float) -> None:
    result = identify_recording(DATA / f"{name}.csv")
    assert result.series.position_name == "slave_position_rad"
    assert result.series.effort_name == "environment_torque_nm"
    assert result.found
    assert result.chosen.name == model
    assert low < result.chosen.working_stiffness.value < high
    assert result.chosen.explained > 0.9
    if result.chosen.side:  # a free part shows the sensor's offset: what it reads at no contact
        motion = np.loadtxt(DATA / f"{name}.csv", delimiter=",", skiprows=1, usecols=(2, 4))
        free = motion[motion[:, 0] < np.quantile(motion[:, 0], 0.05), 1]
        offset = result.chosen.parameters["offset"].value
        assert offset == pytest.approx(float(np.median(free)), abs=0.015)


@pytest.mark.slow
@needs_data
@pytest.mark.parametrize("name", ["m1_a_free_motion", "m1_d_free_motion", "m2_a_free_motion"])
def test_free_motion_is_no_contact(name: str, cli: Cli) -> None:
    result = identify_recording(DATA / f"{name}.csv")
    assert not result.found
    assert result.as_dict()["snippet"] is None
    assert any("No contact found" in note for note in result.notes)


@pytest.mark.slow
@needs_data
def test_a_rigid_contact_on_the_command_line(cli: Cli, tmp_path: Path) -> None:
    done = cli("identify", DATA / "m1_d_rigid.csv", "--out", "out")
    assert done.exit_code == 0, done.output
    assert "N m/rad" in done.stdout
    assert "lag  " in done.stdout  # with its interval, from 0 on: no negative damping in its place
    assert (tmp_path / "out/identification.png").stat().st_size > 10_000
    reported = json.loads((tmp_path / "out/identification.json").read_text())
    assert reported["model"] == "contact"
    assert reported["side"] == "above"


# -- any recording --------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_csv_file_from_the_command_line(cli: Cli, tmp_path: Path) -> None:
    source = contact_csv(tmp_path / "press.csv")
    done = cli("identify", source, "--json")
    assert done.exit_code == 0, done.output
    reported = json.loads(done.stdout)
    assert reported["axis_kind"] == "linear"
    assert reported["effort_sense"] == -1
    assert reported["model"] == "contact"
    stiffness = reported["parameters"]["stiffness"]
    assert stiffness["lower"] <= 20.0 <= stiffness["upper"]
    assert Path(reported["figure"]).is_file()


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["spring", "contact", "preloaded", "hunt_crossley"])
def test_the_snippet_is_a_block_of_a_rig(kind: str, tmp_path: Path) -> None:
    result = identify_recording(contact_csv(tmp_path / "press.csv", kind))
    assert result.chosen.name == kind
    block = contact_snippet(result.chosen)
    rig = ROOT / "configs/bench-1dof-loopback.yaml"
    loaded = load_rig(rig, [f"simulation.environment.lever={block}"])
    assert loaded.simulation is not None
    place = loaded.simulation.environment["lever"].model_dump()["position"]
    truth = {"spring": -0.03 / 4.0, "preloaded": 0.01 - 0.2 / 8.0}.get(kind, 0.01)
    assert place == pytest.approx(truth, abs=2e-3)


def test_a_hand_that_holds_still(tmp_path: Path) -> None:
    t = np.arange(6000) * 1e-3
    omega = 2 * np.pi * np.array([1.1, 4.3, 9.1])[:, None]
    x = (0.01 * np.sin(omega * t)).sum(axis=0)
    v = (0.01 * omega * np.cos(omega * t)).sum(axis=0)
    a = -(0.01 * omega**2 * np.sin(omega * t)).sum(axis=0)
    force = -(0.143 * a + 5.0 * v + 538.0 * x)
    source = write(tmp_path / "hand.csv", {"time_s": t, "position_m": x, "hand_force_n": force})
    fit = identify_recording(source, model="mass").chosen
    found = [fit.parameters[name].value for name in ("mass", "damping", "stiffness")]
    assert found == pytest.approx([0.143, 5.0, 538.0], rel=1e-6)


@pytest.mark.slow
def test_columns_are_found_by_their_names_or_requested(cli: Cli, tmp_path: Path) -> None:
    bench = ["time_s", "master_position_rad", "slave_position_rad", "minus_hand_torque_nm"]
    bench += ["environment_torque_nm", "slave_command_nm"]
    path = tmp_path / "x.csv"
    assert csv_columns(path, bench, None, None) == ("slave_position_rad", "environment_torque_nm")
    assert csv_columns(path, bench, None, "minus_hand_torque_nm")[0] == "master_position_rad"
    assert csv_columns(path, bench, "master_position_rad", None)[1] == "minus_hand_torque_nm"
    named = contact_csv(tmp_path / "odd.csv", names=("clock", "a", "b"))
    missing = cli("identify", named)
    assert missing.exit_code == 2
    assert missing.stderr.strip() == (
        f"{named}: no column name matches the time; give it with --time, or with --rate HZ "
        "where rows are evenly spaced (there are clock, a, b)"
    )
    wrong = cli("identify", named, "--time", "clock", "--position", "c")
    assert "there is no column 'c'; there are clock, a, b" in wrong.stderr
    done = cli("identify", named, "--time", "clock", "--position", "a", "--effort", "b")
    assert done.exit_code == 0, done.output
    two = write(
        tmp_path / "two.csv",
        {"time_s": [0, 1], "position": [0, 1], "left_force": [0, 1], "right_force": [0, 1]},
    )
    assert "choose with --effort" in cli("identify", two).stderr


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda p: p / "none.csv", "no such recording"),
        (lambda p: p / "none.doc", "is not a rig"),
        (lambda p: write(p / "s.csv", SHORT), "too few"),
        (lambda p: write(p / "c.csv", STILL), "never changes"),
    ],
)
def test_a_recording_that_says_nothing_is_one_sentence(
    make: Callable[[Path], Path], words: str, cli: Cli, tmp_path: Path
) -> None:
    done = cli("identify", make(tmp_path))
    assert done.exit_code == 2
    assert words in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_gaps_are_left_out(tmp_path: Path) -> None:
    position, effort = contact_recording("contact", 4)
    t = np.arange(len(position)) * 5e-4
    kept = np.ones(len(t), dtype=bool)
    kept[2000:2400] = False
    kept[np.random.default_rng(0).integers(0, len(t), 40)] = False
    source = write(
        tmp_path / "g.csv",
        {"time_s": t[kept], "position": position[kept], "force": effort[kept]},
    )
    result = identify_recording(source, model="contact")
    stiffness = result.chosen.parameters["stiffness"]
    assert stiffness.lower <= 20.0 <= stiffness.upper
    inside = (result.chosen.time_s > 1.0) & (result.chosen.time_s < 1.2)
    assert not inside.any()


@pytest.mark.slow
@pytest.mark.nightly
def test_a_run_is_a_recording(cli: Cli, tmp_path: Path) -> None:
    path = ROOT / "configs/bench-1dof-loopback.yaml"
    run(load_rig(path), out="run", clock="fake", duration_s=4.0, allow_uncertified=True)
    done = cli("identify", "run", "--json", "--out", "reported")
    assert done.exit_code == 0, done.output
    reported = json.loads(done.stdout)
    assert reported["effort"] == "true.slave.lever.environment_effort"
    assert reported["axis_kind"] == "rotary"
    simulation = parse_rig((tmp_path / "run/rig.yaml").read_text()).simulation
    assert simulation is not None
    wall = simulation.environment["lever"].model_dump()
    stiffness = reported["working_stiffness"]["value"]
    assert stiffness == pytest.approx(wall["stiffness"], rel=0.03)
    assert reported["parameters"]["surface"]["value"] == pytest.approx(wall["position"], abs=1e-3)
    axis = cli("identify", "run", "--axis", "slave.wrist", "--out", "other")
    assert "there is no axis 'slave.wrist'" in axis.stderr


def test_a_mass_below_nothing_is_none_in_the_rig() -> None:
    found = {"mass": -1e-3, "damping": 2.0, "stiffness": 50.0}
    parameters = {name: Estimate(value, value, value) for name, value in found.items()}
    snippet = contact_snippet(SimpleNamespace(name="mass", parameters=parameters, side=0))  # type: ignore[arg-type]
    assert snippet == "{mass: 0, damping: 2, stiffness: 50, lever_arm: 1}"
