import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from tautwave.errors import RecordingError
from tautwave.report.figures.envelope import trace
from tautwave.report.run.complete import plant_energy
from tautwave.report.run.loading import load_run
from tautwave.report.run.rebuild import periods_us, rebuild_summary
from tautwave.report.run.rundir import Run
from tautwave.report.run.scratch import spread_columns
from tautwave.report.run.views import view_energy, view_pair
from tautwave.summary import Summary
from tests.report.synthetic import make_run, write_recording


@pytest.fixture
def run(tmp_path, columns):
    make_run(tmp_path, columns=columns)
    return load_run(tmp_path)


def test_efforts_are_turned_to_act_along_the_position(run, columns):
    view = view_pair(run, "wrist")
    contact = view.contacts["environment"][0]
    held = slice(contact.first + 200, contact.last - 50)
    true = columns["true.slave.wrist.environment_effort"][held]
    port = -columns["slave.wrist.port_effort"][held]
    assert np.corrcoef(port, -true)[0, 1] > 0.3
    assert view.lines["slave.port_effort"].value.max() > 1.0
    assert view.lines["slave.transmitted"].value.max() > 1.0
    assert view.lines["master.transmitted"].value.max() > 1.0
    assert view.lines["master.port_effort"].value.min() < -1.0


def test_the_slave_in_master_units_is_the_master_less_the_error(run, columns):
    line = view_pair(run, "wrist").lines["slave.position"]
    wanted = columns["master.wrist.position"] - columns["wrist.position_error"]
    assert np.array_equal(line.value, wanted)


def test_depth_is_measured_from_the_rigs_wall(run, columns):
    (first, *_) = view_pair(run, "wrist").contacts["environment"]
    inside = slice(first.first, first.last + 1)
    deepest = (columns["true.slave.wrist.position"][inside] - 0.08).max()
    assert first.peak_depth == pytest.approx(deepest, rel=1e-12)
    assert first.start_s == columns["time_s"][first.first]


def test_an_admittance_port_transmits_what_it_measures(tmp_path, columns):
    measured = columns["true.slave.wrist.environment_effort"]
    more = {**columns, "slave.wrist.measured_effort": measured}
    make_run(tmp_path, columns={**more, "slave.wrist.port_effort": 0.0 * measured})
    view = view_pair(load_run(tmp_path), "wrist")
    assert view.lines["slave.transmitted"].value.max() == -measured.min()


def test_a_spring_is_no_contact(tmp_path, columns):
    environment = {"wrist": {"type": "spring", "stiffness": 1.0, "position": 0.0}}
    top = {"simulation": {"environment": environment}}
    make_run(tmp_path, columns=columns, rig_top=top)
    assert "environment" not in view_pair(load_run(tmp_path), "wrist").contacts


def test_the_balance_sees_energy_that_no_element_booked(tmp_path, columns):
    make_run(tmp_path, columns=columns)
    assert view_energy(load_run(tmp_path), "wrist").balance.value.max() < 1e-13
    tampered = columns["wrist.line.stored"].copy()
    tampered[2000:] += 1e-6
    make_run(tmp_path, columns={**columns, "wrist.line.stored": tampered})
    run = load_run(tmp_path)
    assert view_energy(run, "wrist").balance.value.max() == pytest.approx(1e-6)
    assert rebuild_summary(run)["energy_j"]["residual"] == pytest.approx(1e-6)


def test_the_plants_residual_counts_what_an_arms_steps_are_wrong_by():
    energies = {"work": [0.0, 2.0, 3.0], "kinetic": [1.0, 2.0, 1.5], "potential": [0.5, 1.5, 3.0]}
    columns = {f"arm.hand.{name}": np.array(values) for name, values in energies.items()}
    run = Run(Path(), {}, "", Summary(), tuple(columns), 3, whole=columns)
    assert plant_energy(run, {})["plant_residual"] == pytest.approx(0.0)
    columns["arm.hand.kinetic"][1] += 0.25
    assert plant_energy(run, {})["plant_residual"] == pytest.approx(0.25)


def test_the_offset_of_the_line_is_that_of_the_effort_held(run, columns):
    reported = rebuild_summary(run)["pairs"]["wrist"]["expected_offset"]
    greatest = np.abs(columns["master.wrist.port_effort"]).max() * 0.02 / 6.0
    assert 0.8 * greatest < reported <= greatest


def test_a_run_lasts_from_its_first_row_to_its_last(run, columns):
    time = columns["time_s"]
    assert rebuild_summary(run)["duration_s"] == time.max() - time.min()


def test_periods_count_lateness_only_on_the_grid():
    late = {"lateness_us": np.array([0.0, 30.0, 10.0])}
    grid = np.array([0.0, 0.001, 0.003])
    assert np.allclose(periods_us(grid, late, 1000.0), [1030.0, 1980.0])
    measured = np.array([0.0, 0.00103, 0.00301])
    assert np.allclose(periods_us(measured, late, 1000.0), [1030.0, 1980.0])


def test_columns_spread_in_a_file_are_the_columns(tmp_path, columns, monkeypatch):
    path = tmp_path / "recording.mcap"
    write_recording(path, columns)
    monkeypatch.setattr("tautwave.report.run.scratch.BLOCK_CELLS", 777 * len(columns))
    scratch = spread_columns(path, tuple(columns), 3000)
    for name, values in columns.items():
        assert np.array_equal(scratch.read(name), values)
    assert np.array_equal(scratch.read("time_s", slice(5, 9)), columns["time_s"][5:9])
    assert [p.name for p in tmp_path.iterdir()] == ["recording.mcap"]


@pytest.mark.parametrize("fits", [False, True])
def test_columns_are_spread_only_where_the_disk_has_room_for_all(
    tmp_path, columns, monkeypatch, fits
):
    path = tmp_path / "recording.mcap"
    write_recording(path, columns)
    free = 2 * 8 * 3000 * len(columns) + fits
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: SimpleNamespace(free=free))
    assert (spread_columns(path, tuple(columns), 3000) is not None) == fits


def test_noise_is_distinguished_from_a_signal():
    time = np.arange(20_000) * 1e-3
    noise = np.random.default_rng(1).normal(0.0, 0.05, len(time))
    assert not trace(time, np.sin(time)).is_rough()
    rough = trace(time, np.sin(time) + noise)
    assert rough.is_rough()
    assert np.abs(rough.middle - np.sin(rough.middle_time)).max() < 0.06
    assert not trace(time[:100], noise[:100]).is_rough()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a: &a [x]\nb: [*a, *a]\n", "anchors (&a) are not supported; write it out."),
        ("a: " + "[" * 50_000, "rig.yaml:1:28: nested deeper than 24 levels."),
        ("a: [", "rig.yaml:1:5: YAML syntax: "),
        ("a: 1\na: 2\n", "rig.yaml:2: a: duplicate key 'a', first at line 1."),
        (b"name: \xff\n", "rig.yaml: not UTF-8 text (byte 0xff at offset 6)."),
    ],
    ids=["aliases", "deep", "syntax", "twice", "binary"],
)
def test_a_rig_file_that_nobody_can_read_is_a_note(tmp_path, columns, text, said):
    make_run(tmp_path, columns=columns)
    (tmp_path / "rig.yaml").write_bytes(text if isinstance(text, bytes) else text.encode())
    assert any(said in note for note in load_run(tmp_path).notes)


def test_numbers_of_the_rig_file_are_those_of_yaml_1_2(tmp_path, columns):
    make_run(tmp_path, columns=columns)
    (tmp_path / "rig.yaml").write_text("rate_hz: 1e3\nname: no\nposition: 010\n")
    assert load_run(tmp_path).rig == {"rate_hz": 1000.0, "name": "no", "position": 10}


@pytest.mark.parametrize("text", ["[" * 100_000, '{"a": ' * 100_000, "{", '{"a": 1} x'])
def test_a_summary_that_nobody_can_read_is_a_note(tmp_path, columns, text):
    make_run(tmp_path, columns=columns)
    (tmp_path / "summary.json").write_text(text)
    run = load_run(tmp_path)
    assert any(note.startswith("summary.json cannot be read: line 1") for note in run.notes)
    assert not any("summary.json is missing" in note for note in run.notes)
    assert run.result.cycles == run.rows


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, "no summary.json and"),
        ("{", "summary.json cannot be read: line 1, column 2: "),
        ("[1]", "summary.json holds no summary and"),
        ("\udcff", "summary.json: not UTF-8 text (byte 0xff at offset 0) and"),
    ],
)
def test_with_no_recording_either_it_is_said_what_the_summary_lacks(tmp_path, text, said):
    if text is not None:
        (tmp_path / "summary.json").write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(RecordingError) as caught:
        load_run(tmp_path)
    assert f"nothing to report: {said}" in str(caught.value)
    assert str(caught.value).endswith("no readable recording.mcap (recording.mcap is missing)")
