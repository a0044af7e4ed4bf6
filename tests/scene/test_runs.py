"""Rigs with a scene, run: books, guards, limits, and what they leave behind."""

from __future__ import annotations

import json
import wave
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from tautwave.certificate import certify
from tautwave.cli import main
from tautwave.config import load_rig
from tautwave.errors import ConfigError
from tautwave.recordings.recording import read_recording
from tautwave.rig import build_rig
from tautwave.runtime.loop import Loop
from tautwave.session.running import run
from tautwave.simulation.kernel.pack import pack_rig
from tautwave_scenes.networks.live import SceneModel
from tautwave_scenes.rig.network import scene_forces
from tautwave_scenes.runtime.axes import SceneControl
from tests.commands import keep_in_one_process

CONFIGS = Path(__file__).parents[2] / "configs"


class Rows:
    """A sink that keeps every row."""

    def __init__(self, width: int) -> None:
        self.row = [0.0] * width
        self.rows: list[list[float]] = []

    def commit(self) -> None:
        self.rows.append(list(self.row))


def run_rig(name: str, duration: float, *overrides: str):
    rig = load_rig(CONFIGS / f"scene-{name}.yaml", overrides)
    built = build_rig(rig, clock="fake", duration_s=duration)
    sink = Rows(len(built.columns))
    loop = Loop(built.clock, built.buses, built.control, built.sources, sink)
    result = loop.run()
    data = dict(zip(built.columns, np.array(sink.rows).T, strict=True))
    return result, data, built


@pytest.mark.sparse(4)
@pytest.mark.parametrize(
    ("name", "duration"), [("resonator", 0.6), ("granular", 0.12), ("string", 0.3), ("drum", 0.25)]
)
def test_shipped_scenes_run_and_their_books_close(name, duration):
    ramps = ("scene.engage_ramp_s=0", "scene.release_ramp_s=0")  # they take energy of their own
    result, data, built = run_rig(name, duration, *ramps)
    assert result.error is None
    port = built.control.scene.model.network.ports[0]
    assert np.abs(data[f"master.{port}.port_effort"]).max() > 0.05
    assert np.abs(data["scene.residual"]).max() < 1e-12
    # Hold: what the device gave, exactly, less what the network got.
    given = data[f"master.{port}.port_energy"]
    assert data["scene.hold"] == pytest.approx(given - data["scene.port_work"], abs=1e-12)
    assert abs(data["scene.hold"][-1]) < 0.1 * data[f"master.{port}.gross_flow"][-1]


@pytest.mark.slow
def test_a_shipped_scene_runs_with_rk4_and_its_books_close():
    result, data, _ = run_rig("drum", 0.25, "scene.scheme=rk4", "scene.engage_ramp_s=0")
    assert result.error is None
    assert np.abs(data["scene.residual"]).max() < 1e-12
    given = data["master.stick.port_energy"]
    assert data["scene.hold"] == pytest.approx(given - data["scene.port_work"], abs=1e-12)
    assert np.abs(data["scene.numeric"]).max() < 1e-4 * np.abs(data["scene.port_work"]).max()
    _, kept, _ = run_rig("drum", 0.25, "scene.engage_ramp_s=0")
    middle = np.abs(data["scene.at.ring1"]).max()
    assert middle == pytest.approx(np.abs(kept["scene.at.ring1"]).max(), rel=0.02)


@pytest.mark.slow
def test_symplectic_scenes_close_their_books_and_take_no_hold():
    result, data, _ = run_rig("granular", 0.12, "scene.scheme=symplectic")
    assert result.error is None
    assert np.abs(data["scene.residual"]).max() < 1e-12
    armed = data["master.bar.port_effort"] == -0.0 + data["scene.asked.bar"]
    assert armed.mean() > 0.9  # where neither ramp nor limit cut off
    assert np.abs(data["scene.numeric"]).max() > 0.0


@pytest.mark.slow
def test_the_effort_is_the_scenes_answer_to_this_very_sample():
    _, data, built = run_rig("resonator", 0.4)
    x, at = data["master.stylus.position"], data["scene.at.object"]
    asked = data["scene.asked.stylus"]
    # k_c (x - x_v) at the sample; the recorded mass is where it will be at the next one.
    assert asked[1:] == pytest.approx(3000.0 * (x[1:] - at[:-1]), abs=1e-9)
    assert isinstance(built.control, SceneControl)


@pytest.mark.sparse(2)
@pytest.mark.parametrize("name", ["resonator", "granular"])
def test_a_recording_replays_to_the_bit(name):
    """Measured positions and the seed's forces are all a scene depends on."""
    more = ["scene.forces.strikes.per_second=40"] if name == "resonator" else []
    _, data, built = run_rig(name, 0.1, *more)
    rig = load_rig(CONFIGS / f"scene-{name}.yaml", more)
    network = built.control.scene.model.network
    port = network.ports[0]
    positions = data[f"master.{port}.position"]
    forces = scene_forces(rig, network, len(positions))
    model = SceneModel(network, built.control.scene.model.scheme, rig.period_s)
    model.reset([positions[0]])
    for k in range(len(positions)):
        (effort,) = model.advance([positions[k]], [force[k] for force in forces])
        assert effort == data[f"scene.asked.{port}"][k]
    assert max(abs(force) for force in forces[0]) > 0.1


def test_a_command_delay_is_in_the_books_and_in_the_certificate():
    late = ["buses.hand.options={command_delay_s: 2.0e-4}"]
    result, data, _ = run_rig("resonator", 0.4, *late)
    assert result.error is None
    assert np.abs(data["scene.residual"]).max() < 1e-12
    motor = data["plant.master.stylus.motor_work"]
    assert data["master.stylus.port_energy"] == pytest.approx(-motor, abs=1e-12)
    prompt = certify(load_rig(CONFIGS / "scene-resonator.yaml")).elements[1].numbers
    reported = certify(load_rig(CONFIGS / "scene-resonator.yaml", late)).elements[1].numbers
    assert reported["needed_damping"] > 2.0 * prompt["needed_damping"]


def test_limits_and_ramps_hold():
    _, data, _ = run_rig("resonator", 0.4, "master.axes.stylus.effort_limit=1")
    effort = np.abs(data["master.stylus.port_effort"])
    assert effort.max() == 1.0
    assert np.abs(data["scene.asked.stylus"]).max() > 1.5
    ramp = np.minimum(1.0, (np.arange(len(effort)) + 1.0) / 500.0)
    assert (effort[:400] <= ramp[:400] + 1e-12).all()
    assert np.abs(data["scene.residual"]).max() < 1e-12


def test_a_guard_stops_the_run_and_the_scene_lets_go():
    result, data, _ = run_rig("drum", 0.3, "master.axes.stick.velocity_limit=0.2")
    assert "exceeded its velocity limit" in str(result.error)
    stopped = np.abs(data["master.stick.port_effort"][-200:])
    assert (stopped <= 0.3 * np.abs(data["master.stick.velocity"][-200:]) + 1e-12).all()


@pytest.mark.slow
def test_lost_samples_and_skipped_slots_cost_nothing_of_the_books():
    result, data, _ = run_rig(
        "drum",
        0.3,
        "simulation.faults.missing_probability=0.05",
        "simulation.faults.overrun_probability=0.01",
        "loop.missing_limit=40",  # skipped slots count, too
    )
    assert result.error is None
    assert result.missed_cycles > 0
    assert result.lost[0] > 0
    assert np.abs(data["scene.residual"]).max() < 1e-12


@pytest.mark.slow
def test_two_axes_touch_one_scene(tmp_path):
    text = (CONFIGS / "scene-resonator.yaml").read_text()
    second = text[text.index("    stylus:\n") : text.index("scene:\n")]
    text = text.replace(
        second, second + second.replace("stylus:", "finger:").replace("id: 1", "id: 2"), 1
    )
    text = text.replace(
        "    stylus: {to", "    finger: {to: object, stiffness: 500}\n    stylus: {to"
    )
    path = tmp_path / "two.yaml"
    path.write_text(text)
    rig = load_rig(path)
    built = build_rig(rig, clock="fake", duration_s=0.3)
    sink = Rows(len(built.columns))
    loop = Loop(built.clock, built.buses, built.control, built.sources, sink)
    assert loop.run().error is None
    data = dict(zip(built.columns, np.array(sink.rows).T, strict=True))
    assert np.abs(data["scene.residual"]).max() < 1e-12
    assert np.abs(data["master.finger.position"]).max() > 1e-5  # moved by what the other hand does


@pytest.mark.slow
@pytest.mark.nightly
def test_what_a_run_leaves_behind(tmp_path):
    out = tmp_path / "run"
    rig = str(CONFIGS / "scene-resonator.yaml")
    command = ["run", rig, "--clock", "fake", "--duration", "0.5", "--out", str(out)]
    done = CliRunner().invoke(main, command)
    assert done.exit_code == 0, done.output
    page = (out / "report.html").read_text()
    assert 'id="scene"' in page
    for name in ("scene", "certificate"):
        assert "<svg" in (out / f"{name}.svg").read_text()
    assert "<title>certificate of this rig</title>" in page
    for part in ("data:audio/wav;base64,", "data:image/gif;base64,", "data:image/png;base64,"):
        assert part in page
    assert '<a href="scene.gif">' in page
    assert '<a href="output.wav">' in page
    assert 'class="drawn turned" src="data:image/gif' in page  # dark where dark is wanted
    assert "coupling of stylus" in page
    summary = json.loads((out / "summary.json").read_text())
    assert summary["energy_j"]["residual"] < 1e-12
    assert summary["scene"]["elements"]["object"]["lost"] > 0.0
    with wave.open(str(out / "output.wav")) as sound:
        assert sound.getframerate() == 44_100
        assert sound.getnchannels() == 1
        heard = np.frombuffer(sound.readframes(sound.getnframes()), "<i2")
    assert abs(len(heard) - 22_050) <= 2
    assert np.abs(heard).max() == pytest.approx(0.9 * 32767, abs=1)
    with Image.open(out / "scene.gif") as image:
        assert image.n_frames > 30
    rows = read_recording(out / "recording.mcap")
    assert "scene.at.object" in rows.columns


@pytest.mark.slow
def test_a_negative_damper_is_refused_with_exit_3(tmp_path):
    out = tmp_path / "run"
    feeding = "scene.links.minus={type: negative_damper, between: [object, ground], damping: 0.02}"
    command = ["run", str(CONFIGS / "scene-resonator.yaml"), "--clock", "fake", "--duration", "0.3"]
    command += ["--set", "scene.scheme=discrete_gradient", "--set", feeding, "--out", str(out)]
    done = CliRunner().invoke(main, command)
    assert done.exit_code == 3
    assert "minus: a negative damper or an energy source supplies energy" in done.output
    assert not out.exists()


@pytest.mark.slow
def test_check_lists_what_is_left_out():
    more = ["scene.masses.far={mass: 1, count: 3}"]
    more += ["scene.links.far={type: spring, between: [far, far], chain: true, stiffness: 1}"]
    command = ["check", "--verbose", str(CONFIGS / "scene-resonator.yaml")]
    for override in more:
        command += ["--set", override]
    done = CliRunner().invoke(main, command)
    assert done.exit_code == 0, done.output
    for part in ("far1", "far3", "far2", "no path of links leads from it"):
        assert part in done.output


def test_what_needs_a_pair_says_that_a_scene_is_none(tmp_path):
    rig = CONFIGS / "scene-resonator.yaml"
    with pytest.raises(ConfigError, match="a scene is simulated by the live loop only"):
        pack_rig(load_rig(rig))
    sweep = tmp_path / "sweep.yaml"
    cases = "cases: {a: {columns: {seed: [1, 2]}}}"
    sweep.write_text(f"name: s\nrig: {rig}\nmeasures: [growth_rate]\n{cases}\n")
    done = CliRunner().invoke(main, ["sweep", str(sweep), "--out", str(tmp_path / "out")])
    assert done.exit_code == 2
    assert "a sweep varies rigs with a coupling" in done.output


RUNAWAY = """
name: runaway
rate_hz: 1000
duration_s: 2
require: coupled_stable
buses: {hand: {driver: loopback}}
master:
  axes:
    bar:
      bus: hand
      id: 1
      kind: linear
      inertia: {value: 0.1, lower: 0.08, source: data sheet}
      damping: {value: 0.5, lower: 0.3, source: data sheet}
      effort_limit: 20
      velocity_limit: 5
      position_range: [-0.1, 0.1]
scene:
  scheme: symplectic
  masses: {m1: {mass: 0.001}, m2: {mass: 0.001}}
  links:
    a: {type: spring, between: [bar, m1], stiffness: 100}
    source: {type: negative_damper, between: [m1, m2], damping: 1.0}
    hit: {type: contact, between: [m2, m1], stiffness: 100, exponent: 2}
  ports: {bar: {}}
  engage_ramp_s: 0.02
  release_ramp_s: 0.02
simulation:
  axes: {master.bar: {inertia: 0.11, damping: 0.4}}
  hand:
    bar:
      reference: {type: minimum_jerk, waypoints: [[0.05, 0.0], [0.3, -0.016], [1.0, -0.005]]}
"""


@pytest.mark.sparse(2)
@pytest.mark.parametrize("scheme", ["discrete_gradient", "symplectic"])
def test_an_instrument_that_runs_away_is_stopped_and_reported(tmp_path, scheme, monkeypatch):
    drawn = scheme == "symplectic"  # as the other one would be
    if not drawn:
        keep_in_one_process(monkeypatch)
    path = tmp_path / "runaway.yaml"
    path.write_text(RUNAWAY.replace("symplectic", scheme))
    done = run(load_rig(path), out=tmp_path / "out", clock="fake", allow_uncertified=True)
    assert done.exit_code == 6
    written = (tmp_path / "out" / "summary.json").read_text()
    summary = json.loads(written, parse_constant=pytest.fail)
    reported = summary["outcome"]["sentence"]
    assert "master.bar received a scene effort over a million times its limit of" in reported
    assert summary["cycles"] < 1500
    assert "report_error" not in summary
    assert not drawn or (tmp_path / "out" / "report.html").stat().st_size > 10_000
    data = read_recording(tmp_path / "out" / "recording.mcap")
    assert np.isfinite(data["scene.asked.bar"]).all()
    assert np.isfinite(data["master.bar.commanded"]).all()
