"""Rigs with points in space, run: books, columns, guards, and what they leave behind."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from tautwave.cli import main
from tautwave.config import load_rig, parse_rig
from tautwave.recordings.recording import read_recording
from tautwave.report.run.loading import load_run
from tautwave.rig import build_rig
from tautwave.runtime.loop import Loop
from tautwave.session.running import run
from tautwave.simulation.run import simulate
from tautwave_scenes.networks3d.live import Model3d
from tautwave_scenes.report3d.view import project, view_scene3d
from tautwave_scenes.rig.network3d import forces3d, pruned_network3d
from tests.commands import keep_in_one_process
from tests.scene.test_runs import Rows

CONFIGS = Path(__file__).parents[2] / "configs"
AXES = ("right", "away", "up")


def run_net(duration: float, *overrides: str):
    rig = load_rig(CONFIGS / "scene-net.yaml", overrides)
    built = build_rig(rig, clock="fake", duration_s=duration)
    sink = Rows(len(built.columns))
    loop = Loop(built.clock, built.buses, built.control, built.sources, sink)
    result = loop.run()
    data = dict(zip(built.columns, np.array(sink.rows).T, strict=True))
    return result, data, built


def test_the_net_runs_and_its_books_close():
    result, data, _ = run_net(0.4, "scene.engage_ramp_s=0", "scene.release_ramp_s=0")
    assert result.error is None
    assert np.abs(data["scene.residual"]).max() < 1e-14
    assert min(data["scene.asked.up"]) < -5.0  # pressed, it pushes up
    assert abs(data["scene.asked.right"]).max() > 0.5
    # Of the symplectic scheme the axes give exactly what the network gets.
    assert np.abs(data["scene.hold"]).max() < 1e-14
    middle = data["scene.at.knot25.z"]
    assert middle.min() < -0.01
    assert abs(middle[-1]) < 3e-3


@pytest.mark.slow
def test_it_holds_its_energy_with_discrete_gradients():
    result, data, _ = run_net(0.13, "scene.scheme=discrete_gradient", "scene.engage_ramp_s=0")
    assert result.error is None
    assert np.abs(data["scene.residual"]).max() < 1e-14
    assert np.abs(data["scene.numeric"]).max() == 0.0
    assert min(data["scene.asked.up"]) < -1.0


def test_a_recording_replays_to_the_bit():
    hum = "scene.forces={hum: {type: noise, 'on': knot, amplitude: 0.05}}"
    _, data, built = run_net(0.15, hum)
    rig = load_rig(CONFIGS / "scene-net.yaml", [hum])
    network = pruned_network3d(rig).network
    forces = forces3d(rig, network, len(data["time_s"]))
    model = Model3d(network, "symplectic", rig.period_s)
    places = np.stack([data[f"master.{name}.position"] for name in AXES], axis=1)
    model.reset(places[0].tolist())
    for k, where in enumerate(places):
        efforts = model.advance(where.tolist(), [force[k] for force in forces])
        assert efforts == [data[f"scene.asked.{name}"][k] for name in AXES]
    assert built.control.scene.model.network == network


def test_one_axis_may_move_a_point_aslant_at_a_scale():
    """The work of an effort is that of the force: a scale of 2 doubles motion and effort alike."""
    text = (CONFIGS / "scene-net.yaml").read_text()
    first = text.index("    away:\n")
    text = text[:first] + text[text.index("scene:\n") :]
    text = text.replace("axes: [right, away, up]", "axes: [right], directions: [[3, 0, -4]]")
    text = text.replace("offset: [0.004, 0.003, 0.03]", "position_scale: 2, offset: [0, 0, 0.03]")
    text = text.replace("output: {port: up}", "output: {port: right}")
    head, tail = text[: text.index("simulation:")], text[text.index("simulation:") :]
    hand = "  hand: {right: {reference: {type: minimum_jerk, waypoints: [[0, 0], [0.2, 0.02]]}}}\n"
    tail = "simulation:\n  axes: {master.right: {inertia: 0.085, damping: 0.45}}\n" + hand
    rig = parse_rig(head + tail, "net.yaml", ["scene.engage_ramp_s=0", "scene.release_ramp_s=0"])
    built = build_rig(rig, clock="fake", duration_s=0.4)
    sink = Rows(len(built.columns))
    result = Loop(built.clock, built.buses, built.control, built.sources, sink).run()
    data = dict(zip(built.columns, np.array(sink.rows).T, strict=True))
    assert result.error is None
    assert np.abs(data["scene.asked.right"]).max() > 1.0
    assert np.abs(data["scene.hold"]).max() < 1e-14
    assert np.abs(data["scene.residual"]).max() < 1e-14


def test_simulate_gives_the_rows_of_a_run():
    rig = load_rig(CONFIGS / "scene-net.yaml")
    rows = simulate(rig, duration_s=0.12, engine="python")
    _, data, built = run_net(0.12)
    assert list(rows.columns) == list(built.columns)
    for at, name in enumerate(rows.columns):
        assert np.array_equal(rows.data[:, at], data[name], equal_nan=True), name


@pytest.mark.slow
@pytest.mark.nightly
def test_what_a_run_leaves_behind(tmp_path):
    out = tmp_path / "run"
    rig = str(CONFIGS / "scene-net.yaml")
    plane = ["--set", "scene.grounds={table: [0, 0, -0.03]}", "--set"]
    plane.append("scene.links.table={type: contact, between: [knot, table], stiffness: 1.0e4, "
                 "normal: [0, 0, 1]}")  # fmt: skip
    command = ["run", rig, "--clock", "fake", "--duration", "0.3", "--out", str(out), *plane]
    done = CliRunner().invoke(main, command)
    assert done.exit_code == 0, done.output
    page = (out / "report.html").read_text()
    assert "25 masses and 134 links in space under finger (right, away, up)" in page
    summary = json.loads((out / "summary.json").read_text())
    assert summary["energy_j"]["residual"] < 1e-13
    assert summary["scene"]["elements"]["knot25"]["lost"] > 0.0
    assert (out / "output.wav").stat().st_size > 20_000
    drawn = (out / "scene.svg").read_text()
    for title in ("Heights", "in the plane", "Force on the device", "Sound", "energy"):
        assert title in drawn  # a panel of its own
    with Image.open(out / "scene-still.png") as image:
        assert len(image.convert("RGB").getcolors(1 << 20) or ()) > 50
    with Image.open(out / "scene.gif") as image:
        assert image.n_frames > 30
    rows = read_recording(out / "recording.mcap")
    assert {f"scene.at.knot25.{c}" for c in "xyz"} <= set(rows.columns)
    view = view_scene3d(load_run(out))
    assert view is not None
    for c, (axis, offset) in enumerate(zip(AXES, (0.004, 0.003, 0.03), strict=True)):
        assert view.at["finger"][:, c] == pytest.approx(rows[f"master.{axis}.position"] + offset)
    assert view.at["knot25"].shape == (len(view.time), 3)
    far, near, high = np.eye(3)[0] * -1.0, np.eye(3)[0], np.eye(3)[2]
    assert project(near)[2] > project(far)[2]
    assert project(high)[1] > 0.9
    assert project(high)[0] == 0.0


@pytest.mark.slow
def test_check_says_what_it_is_and_what_is_left_out():
    far = ["scene.masses.far={mass: 1, count: 3, spacing: [1, 0, 0]}"]
    far += ["scene.links.far={type: spring, between: [far, far], chain: true, stiffness: 1}"]
    command = ["check", "--verbose", str(CONFIGS / "scene-net.yaml")]
    for override in far:
        command += ["--set", override]
    done = CliRunner().invoke(main, command)
    assert done.exit_code == 0, done.output
    for part in ("in three dimensions", "25 masses, 109 links", "moved by right, away, up",
                 "far1", "no path of links leads from it"):  # fmt: skip
        assert part in done.output


RUNAWAY = [
    "scene.masses.knot.count=3",
    "scene.masses.knot.rows=3",
    "scene.masses.knot.position=[-0.025, -0.025, 0]",
    "scene.links.source={type: negative_damper, between: [knot, ground], damping: 5}",
    "scene.links.hair={type: spring, between: [finger, knot], stiffness: 100}",
    "scene.masses.knot.velocity=[0.1, 0.2, 0.3]",
]


@pytest.mark.slow
def test_what_runs_away_is_stopped_with_discrete_gradients_as_well():
    result, data, _ = run_net(0.5, "scene.scheme=discrete_gradient", *RUNAWAY)
    assert "over a million times its limit" in str(result.error)
    for name in AXES:
        assert np.isfinite(data[f"scene.asked.{name}"]).all()


@pytest.mark.slow
def test_an_instrument_that_becomes_unstable_is_stopped_and_reported(tmp_path, monkeypatch):
    keep_in_one_process(monkeypatch)
    rig = load_rig(CONFIGS / "scene-net.yaml", RUNAWAY)
    done = run(rig, out=tmp_path / "out", clock="fake", allow_uncertified=True)
    assert done.exit_code == 6
    written = (tmp_path / "out" / "summary.json").read_text()
    summary = json.loads(written, parse_constant=pytest.fail)
    assert "over a million times its limit" in summary["outcome"]["sentence"]
    assert "report_error" not in summary
    data = read_recording(tmp_path / "out" / "recording.mcap")
    for name in AXES:
        assert np.isfinite(data[f"scene.asked.{name}"]).all()
        assert np.isfinite(data[f"master.{name}.commanded"]).all()


@pytest.mark.parametrize(("axis", "limit"), [("right", 0.05), ("up", 0.2)])
def test_a_guard_of_any_axis_stops_the_run_in_its_own_cycle(axis: str, limit: float):
    """The first axes of a scene are no later than the last, which lets the scene think."""
    result, data, _ = run_net(0.6, f"master.axes.{axis}.velocity_limit={limit}")
    assert f"master.{axis} exceeded its velocity limit" in str(result.error)
    over = int(np.argmax(np.abs(data[f"master.{axis}.velocity"]) > limit))
    release = round(0.02 * 2000)
    assert len(data["time_s"]) == over + 1 + release
