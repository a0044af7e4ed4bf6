"""`identify RECORDING --lever`, the lag of a force sensor, and the grip of a hand that moves."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from tautwave.analysis.identification.moving_encoder import moving_noise, moving_step
from tautwave.cli import main
from tautwave.errors import ConfigError, RecordingError
from tautwave.models.plant import plant_step
from tautwave.models.plant_params import PlantParams, plant_cache
from tautwave.session.identification.lever import identify_lever
from tautwave.session.identification.recorded import identify_recording

DATA = Path(__file__).parents[3] / "shared" / "data" / "teleop-1dof"
T, COUNT = 5e-4, 8000
TIMES = T * np.arange(COUNT)
STEP = 2.094e-5
INERTIA, VISCOUS, COULOMB = 1.5e-3, 0.015, 0.025
Cli = Callable[..., Result]
needs_data = pytest.mark.skipif(not DATA.is_dir(), reason=f"no recordings in {DATA}")


@pytest.fixture
def cli(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Cli:
    monkeypatch.chdir(tmp_path)
    return lambda *words: CliRunner().invoke(main, [str(word) for word in words])


def csv(path: Path, **columns: np.ndarray) -> Path:
    rows = np.column_stack([TIMES[: len(next(iter(columns.values())))], *columns.values()])
    head = ",".join(["time_s", *columns])
    np.savetxt(path, rows, "%.12g", ",", header=head, comments="")
    return path


def moved(stiffness: float = 0.0, noise: float = 1e-5) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position as an encoder shows it, the motor's effort, the effort of a spring on the lever."""
    p = PlantParams(INERTIA, VISCOUS, COULOMB, 0.0, 0.0, stiffness, 0.0, 0.0, 0.0, 0.0, 1.0)
    cache, rng = plant_cache(p, T), np.random.default_rng(3)
    effort = sum(
        a * np.sin(2 * np.pi * f * TIMES + a) for f, a in ((1.1, 0.05), (2.7, 0.05), (5.3, 0.08))
    )
    x, v, mode = 0.0, 0.0, 0
    places = np.empty(COUNT)
    for k in range(COUNT):
        places[k] = x
        held = float(effort[k]) - 0.2 * x - 0.003 * v  # a soft spring of the controller
        effort[k] = held
        x, v, mode, *_ = plant_step(p, cache, x, v, mode, held, 0.0, 0.0, T)
    shown = STEP * np.rint((places + noise * rng.standard_normal(COUNT)) / STEP)
    return shown, np.asarray(effort), -stiffness * places


def test_the_truth_of_a_lever_is_inside_its_intervals(tmp_path: Path) -> None:
    shown, effort, _ = moved()
    found = identify_lever(csv(tmp_path / "a.csv", angle_rad=shown, motor_nm=-effort))
    assert found.turned
    assert found.delay == 0.0
    fit = found.fit
    for estimate, truth in (
        (fit.inertia, INERTIA),
        (fit.damping, VISCOUS),
        (fit.coulomb, COULOMB),
        (fit.bias, 0.0),
    ):
        near = 0.005 * truth  # noise and steps are not the same at every speed
        assert estimate.lower - near <= truth <= estimate.upper + near
    assert fit.inertia.value == pytest.approx(INERTIA, rel=0.03)
    assert fit.coulomb.value == pytest.approx(COULOMB, rel=0.1)
    assert found.quantum == pytest.approx(STEP, rel=1e-3)
    assert found.noise.value == pytest.approx(1e-5, rel=0.15)
    assert "inertia: {value: 0.0015" in found.snippet


@pytest.mark.slow
def test_a_sensor_of_what_touched_it_is_compared_with_the_motor(tmp_path: Path) -> None:
    shown, effort, outside = moved(stiffness=2.0)
    file = csv(tmp_path / "a.csv", angle_rad=shown, motor_nm=effort, force=-2.0 * outside + 0.1)
    found = identify_lever(file, outside="force")
    assert found.fit.outside is not None
    assert found.fit.outside.value == pytest.approx(-0.5, rel=0.02)
    assert found.fit.inertia.value == pytest.approx(INERTIA, rel=0.05)
    assert found.fit.bias.value == pytest.approx(0.05, abs=0.005)  # what the sensor is off
    assert any("one unit of force is -0.5 units" in note for note in found.notes)
    assert "inertia: {" in found.snippet
    wild = csv(tmp_path / "w.csv", angle_rad=shown, motor_nm=effort, force=0.1 * outside)
    assert "inertia: {" not in identify_lever(wild, outside="force").snippet
    without = identify_lever(file)
    assert any(
        "something else (a hand, a contact, a weight) acts" in note for note in without.notes
    )
    assert ("inertia: {" in without.snippet) == (without.fit.inertia.lower > 0.0)


def test_friction_that_helps_is_doubtful_and_not_for_a_rig(tmp_path: Path) -> None:
    """A motor that follows the motion a little, and did not make it, explains itself only."""
    shown = 0.2 * np.sin(2 * np.pi * 1.1 * TIMES) + 0.05 * np.sin(2 * np.pi * 2.7 * TIMES)
    speed, jerk = np.gradient(shown, T), np.gradient(np.gradient(shown, T), T)
    echo = 4e-5 * jerk + 2e-3 * speed - 1e-3 * np.sign(speed)
    noise = 1e-5 * np.random.default_rng(5).standard_normal(COUNT)
    found = identify_lever(csv(tmp_path / "a.csv", angle_rad=shown + noise, motor_nm=echo))
    assert found.fit.coulomb.upper < 0.0
    assert "inertia: {" not in found.snippet
    assert any("friction comes out negative" in note for note in found.notes)


def test_what_is_missing_is_left_out_and_said(tmp_path: Path) -> None:
    """A sensor that begins late, samples without a number, and a gap spoil nothing."""
    shown, effort, outside = moved(stiffness=2.0)
    force = outside.copy()
    force[:300] = np.nan
    shown[1500:1530] = np.nan
    file = csv(tmp_path / "a.csv", angle_rad=shown, motor_nm=effort, force=force)
    lines = file.read_text().splitlines()
    file.write_text("\n".join(lines[:4000] + lines[4400:]))
    found = identify_lever(file, outside="force")
    assert found.fit.inertia.value == pytest.approx(INERTIA, rel=0.05)
    assert found.fit.outside is not None
    assert found.fit.outside.value == pytest.approx(1.0, rel=0.02)
    assert found.noise.value == pytest.approx(1e-5, rel=0.15)
    assert any("30 of" in note and "were left out" in note for note in found.notes)
    none = csv(tmp_path / "n.csv", angle_rad=outside, motor_nm=effort, force=force * np.nan)
    with pytest.raises(RecordingError, match="force holds no numbers"):
        identify_lever(none, outside="force")


def test_a_lever_that_stands_is_refused(tmp_path: Path) -> None:
    still = csv(tmp_path / "a.csv", angle_rad=np.zeros(COUNT), motor_nm=np.sin(TIMES))
    with pytest.raises(RecordingError, match="angle_rad never changes"):
        identify_lever(still)


def test_a_motor_that_never_changes_says_nothing(tmp_path: Path) -> None:
    """Motor off, a hand moves it: with a sensor that was an unexpected error."""
    shown, effort, outside = moved(stiffness=2.0)
    off = csv(tmp_path / "a.csv", angle_rad=shown, motor_nm=0.0 * effort, force=outside)
    for sensor in (None, "force"):
        with pytest.raises(RecordingError, match="motor_nm never changes"):
            identify_lever(off, outside=sensor)


@pytest.mark.parametrize("scale", [1e-310, 1e60, 1e308])
def test_what_no_lever_does_is_refused(tmp_path: Path, scale: float) -> None:
    """Squares of such numbers are none."""
    file = csv(tmp_path / "a.csv", angle_rad=scale * np.sin(TIMES), force=np.cos(TIMES))
    for fit in (identify_lever, identify_recording):
        with pytest.raises(
            (ConfigError, RecordingError),
            match=r"never changes|beyond the " r"plausible limit 1e\+50",
        ):
            fit(file, position="angle_rad", effort="force")


def test_a_recording_full_of_gaps_says_that(tmp_path: Path) -> None:
    shown, effort, _ = moved()
    file = csv(tmp_path / "a.csv", angle_rad=shown, motor_nm=effort)
    head, *lines = file.read_text().splitlines()
    file.write_text("\n".join([head, *(line for at, line in enumerate(lines) if at % 9)]))
    for fit in (identify_lever, identify_recording):
        with pytest.raises(RecordingError, match=r"8\d\d of 79\d\d samples are missing"):
            fit(file, position="angle_rad", effort="motor_nm")


@pytest.mark.parametrize(("step", "noise"), [(STEP, 2e-5), (9e-5, 3e-5), (0.0, 2e-5)])
def test_step_and_noise_are_found_in_motion(step: float, noise: float) -> None:
    rng = np.random.default_rng(1)
    x = 0.1 * np.sin(3.0 * TIMES) + noise * rng.standard_normal(COUNT)
    shown = step * np.rint(x / step) if step else x
    assert moving_step(shown) == pytest.approx(step, rel=1e-3)
    found = moving_noise(shown, step)
    assert found.value == pytest.approx(noise, rel=0.1)
    assert found.lower < found.value < found.upper


@pytest.mark.slow
def test_a_late_force_is_not_taken_for_negative_damping(tmp_path: Path) -> None:
    stiffness, damping, lag = 250.0, 0.05, 3
    x = 0.004 * np.sin(2 * np.pi * 2.0 * TIMES) + 0.002 * np.sin(2 * np.pi * 7.1 * TIMES)
    x = x + 0.0005 * np.sin(2 * np.pi * 23.0 * TIMES)
    v = np.gradient(x, T)
    force = np.where(x > 0.001, stiffness * (x - 0.001) + damping * v, 0.0)
    shown = np.concatenate([np.zeros(lag), force[:-lag]])
    rng = np.random.default_rng(2)
    file = csv(
        tmp_path / "a.csv", angle_rad=x + 1e-6 * rng.standard_normal(COUNT),
        force_nm=shown + 1e-3 * rng.standard_normal(COUNT),
    )  # fmt: skip
    found = identify_recording(file, filter_hz=60.0)
    late = found.chosen.parameters["lag"]
    assert late.lower <= lag * T <= late.upper
    assert late.value == pytest.approx(lag * T, abs=0.4e-3)
    assert found.chosen.parameters["stiffness"].value == pytest.approx(stiffness, rel=0.02)
    assert found.chosen.parameters["damping"].upper > 0.0
    assert any("lags the motion by" in note for note in found.notes)


@pytest.mark.parametrize(
    ("sign", "damping"),
    [(1.0, 0.03), (-1e-4, -0.005)],
    ids=["as mounted", "the other way, of a tiny hand that pushes on"],
)
def test_the_grip_of_a_hand_that_moves_is_found_from_what_it_wanted(
    tmp_path: Path, sign: float, damping: float
) -> None:
    mass, stiffness = 8e-4, 3.0
    wanted = 0.2 * np.sin(2 * np.pi * 1.3 * TIMES) + 0.05 * np.sin(2 * np.pi * 6.0 * TIMES)
    x, v = np.empty(COUNT), 0.0
    at, force, rate = 0.0, np.empty(COUNT), np.gradient(wanted, T)
    for k in range(COUNT):
        x[k] = at
        grip = stiffness * (wanted[k] - at) + damping * (rate[k] - v)
        bent = (grip - 0.02 * v) / (mass + 1.6e-3)
        force[k] = grip - mass * bent
        v += T * bent
        at += T * v
    file = csv(tmp_path / "a.csv", angle_rad=x, wanted=wanted, force_nm=sign * (force + 0.02))
    found = identify_recording(file, intent="wanted").chosen.parameters
    scale = abs(sign)
    assert found["stiffness"].value == pytest.approx(scale * stiffness, rel=0.02)
    assert found["damping"].value == pytest.approx(scale * damping, rel=0.05)
    assert found["mass"].value == pytest.approx(scale * mass, rel=0.05)
    assert found["offset"].value == pytest.approx(sign * 0.02, rel=0.1)


@pytest.mark.slow
def test_the_command_prints_it(cli: Cli, tmp_path: Path) -> None:
    shown, effort, _ = moved()
    csv(tmp_path / "a.csv", angle_rad=shown, motor_nm=effort)
    done = cli("identify", "a.csv", "--lever", "--json", "--out", "out")
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    assert found["parameters"]["inertia"]["value"] == pytest.approx(INERTIA, rel=0.05)
    assert found["encoder_quantum"] == pytest.approx(STEP, rel=1e-3)
    assert (tmp_path / "out/identification.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--outside", "x"), "--outside requires --lever"),
        (("--lever", "--model", "spring"), "--model cannot be combined with --lever"),
        (("--lever", "--share", "0.1"), "--share is for a rig"),
    ],
)
def test_options_that_do_not_go_together(cli: Cli, words: tuple[str, ...], said: str) -> None:
    Path("a.csv").write_text("t,x\n")
    done = cli("identify", "a.csv", *words)
    assert done.exit_code == 2
    assert said in done.output


@needs_data
@pytest.mark.parametrize(
    ("name", "columns"),
    [
        ("m1_d_free_motion", {}),
        ("m2_a_free_motion", {}),
        ("m1_a_foam", {
            "position": "master_position_rad", "effort": "minus_master_command_nm",
            "outside": "minus_hand_torque_nm",
        }),
    ],
)  # fmt: skip
def test_levers_of_real_recordings(name: str, columns: dict[str, str]) -> None:
    """Coulomb 0.02 to 0.04 N m, viscous 0.01 to 0.025, inertia 1.0 to 1.8e-3, noise to 1.7e-5."""
    found = identify_lever(DATA / f"{name}.csv", **columns)
    fit = found.fit
    assert 0.9e-3 < fit.inertia.value < 1.8e-3
    assert 0.009 < fit.damping.value < 0.025
    assert 0.02 < fit.coulomb.value < 0.04
    assert found.quantum == pytest.approx(2 * np.pi / 300_000, rel=1e-3)
    assert 0.3e-5 < found.noise.value < 1.7e-5
    assert fit.explained > 0.97
    if fit.outside is not None:
        assert fit.outside.value == pytest.approx(1.0, abs=0.05)


@needs_data
@pytest.mark.slow
@pytest.mark.parametrize("name", ["m1_d_rigid", "m2_a_rigid"])
def test_rigid_contacts_of_real_recordings_are_late_and_not_negative(name: str) -> None:
    found = identify_recording(DATA / f"{name}.csv").chosen.parameters
    assert 0.8e-3 < found["lag"].value < 2.5e-3
    assert found["damping"].upper > 0.0
    assert 165.0 < found["stiffness"].value < 370.0
