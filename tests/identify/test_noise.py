"""`identify --noise`: step, deviation and colour of an encoder, and what it refuses."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from tautwave.analysis.identification.encoder_noise import LAGS, fit_noise, lattice
from tautwave.analysis.identification.regression import Estimate
from tautwave.cli import main
from tautwave.config import load_rig
from tautwave.errors import RecordingError
from tautwave.models.noise_colour import TOLERANCE, least_spectrum
from tautwave.session.identification.recorded_columns import Series
from tautwave.session.identification.still import _doubts, identify_noise
from tautwave.streams import normal_noise

ROOT = Path(__file__).parents[2]
DATA = ROOT.parent / "shared" / "data" / "teleop-1dof"
PERIOD, COUNT = 5e-4, 20_000
STEP = 2.094e-5
TAPER = 1.0 - np.arange(1, LAGS + 1) / (LAGS + 1.0)
Cli = Callable[..., Result]


@pytest.fixture
def cli(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Cli:
    monkeypatch.chdir(tmp_path)
    return lambda *words: CliRunner().invoke(main, [str(word) for word in words])


def fit(position: np.ndarray, known: np.ndarray | None = None):
    return fit_noise(position, PERIOD, np.ones(len(position), bool) if known is None else known)


def lags_of(name: str) -> np.ndarray:
    """Autocorrelation of known noises, over as many lags as they need."""
    at = np.arange(1, 129)
    return {
        "white": np.zeros(1),
        "two-sample mean": np.array([0.5]),
        "MA(-.5)": np.array([-0.4]),
        "AR(.9)": 0.9**at,
        "narrow band": 0.97**at * np.cos(1.67 * at) * (1.0 - at / 129.0),
    }[name]


def noise_of(name: str, seed: int = 1, count: int = COUNT) -> np.ndarray:
    return normal_noise((seed, 5), count, tuple(lags_of(name).tolist()))


def drifting(noise: np.ndarray, step: float) -> np.ndarray:
    """Around 0.12 rad, with a creep of 1e-4 rad, in steps."""
    position = 0.12 + 1e-4 * np.linspace(0.0, 1.0, len(noise)) ** 2 + noise
    return step * np.rint(position / step) if step else position


@pytest.mark.parametrize("step", [0.0, STEP, 9e-5])
@pytest.mark.parametrize("name", ["white", "two-sample mean", "MA(-.5)", "AR(.9)", "narrow band"])
def test_noise_of_known_colour_is_found_beside_step_and_drift(name: str, step: float) -> None:
    found = fit(drifting(9e-5 * noise_of(name), step))
    assert found.quantum == pytest.approx(step, rel=1e-6, abs=1e-12)
    assert found.deviation.value == pytest.approx(9e-5, rel=0.05)
    assert found.autocorrelation is not None
    wanted = np.zeros(LAGS)
    known = lags_of(name)[:LAGS]
    wanted[: len(known)] = known
    assert found.autocorrelation == pytest.approx(wanted * TAPER, abs=0.05)
    assert least_spectrum(found.autocorrelation)[0] > -TOLERANCE
    assert 0.0 < found.lag_error < 0.06


def test_intervals_contain_the_truth_as_often_as_they_say() -> None:
    inside = 0
    for seed in range(40):
        found = fit(9e-5 * noise_of("two-sample mean", seed, 4000))
        inside += found.deviation.lower <= 9e-5 <= found.deviation.upper
    assert 34 <= inside < 40


@pytest.mark.parametrize(
    ("spoil", "step"),
    [
        (lambda x: x.astype(np.float32).astype(float), STEP),
        (lambda x: np.round(x, 6), STEP),
        (lambda x: np.array([float(f"{value:.9g}") for value in x]), STEP),
        (lambda x: x[np.abs(x - 0.12) > 1.5 * STEP], STEP),  # places that never occur
    ],
)
def test_the_step_is_found_behind_rounding(spoil: Callable, step: float) -> None:
    position = STEP * np.rint((0.12 + 9e-5 * noise_of("white")) / STEP)
    found, _ = lattice(spoil(position))
    assert found == pytest.approx(step, rel=2e-3)


def test_what_is_printed_finely_has_no_step_that_matters() -> None:
    assert fit(np.round(0.5 + 9e-5 * noise_of("white"), 6)).quantum == 0.0


@pytest.mark.parametrize("share", [0.1, 0.3, 0.5])
def test_noise_below_half_a_step_is_not_distinguished_from_it(share: float) -> None:
    between = STEP * np.rint(1e4 + 0.5 + share * noise_of("white"))
    found = fit(between)
    assert found.quantum == pytest.approx(STEP)
    assert found.autocorrelation is None
    assert share * STEP < found.deviation.value < 0.7 * STEP
    assert found.deviation.lower < found.deviation.value < found.deviation.upper
    assert fit(np.full(COUNT, STEP)).quantum is None
    creeping = STEP * np.rint(1e4 + np.linspace(0.0, 4.0, COUNT))
    assert fit(creeping).deviation == Estimate(0.0, 0.0, 0.0)  # it only drifts


def test_the_step_s_own_share_is_taken_off() -> None:
    found = fit(drifting(0.7 * STEP * noise_of("MA(-.5)"), STEP))
    assert found.deviation.value == pytest.approx(0.7 * STEP, rel=0.02)
    assert found.autocorrelation is not None
    assert found.autocorrelation[0] == pytest.approx(-0.4 * TAPER[0], abs=0.03)


TIMES = PERIOD * np.arange(COUNT)


@pytest.mark.parametrize(
    "motion",
    [
        2e-3 * TIMES / TIMES[-1],
        0.01 * np.sin(3.0 * TIMES),
        0.01 * np.sin(60.0 * TIMES),
        2e-3 * np.exp(-(((TIMES - 5.0) / 0.05) ** 2)),
        4e-4 * (TIMES > 5.0),
    ],
    ids=["creep", "slow", "fast", "knock", "jump"],
)
def test_a_lever_that_moved_is_refused(motion: np.ndarray) -> None:
    with pytest.raises(ValueError, match="it moved"):
        fit(drifting(motion + 9e-5 * noise_of("white"), STEP))


def test_missing_samples_change_nothing_much() -> None:
    known = np.random.default_rng(1).random(COUNT) > 0.05
    position = np.where(known, drifting(9e-5 * noise_of("two-sample mean"), STEP), math.nan)
    found = fit(np.nan_to_num(position), known)
    assert found.deviation.value == pytest.approx(9e-5, rel=0.03)
    assert found.autocorrelation is not None
    assert found.autocorrelation[0] == pytest.approx(0.5 * TAPER[0], abs=0.05)


def csv(path: Path, position: np.ndarray, **more: np.ndarray) -> Path:
    columns = {"time_s": PERIOD * np.arange(len(position)), "position_rad": position, **more}
    np.savetxt(path, np.stack(list(columns.values()), 1), delimiter=",", comments="",
               header=",".join(columns), fmt="%.9g")  # fmt: skip
    return path


@pytest.mark.slow
def test_the_lines_are_those_of_a_rig_file(cli: Cli, tmp_path: Path) -> None:
    source = csv(tmp_path / "still.csv", drifting(9e-5 * noise_of("AR(.9)"), STEP))
    done = cli("identify", source, "--noise", "--out", "out")
    assert done.exit_code == 0, done.output
    assert (tmp_path / "out/identification.png").stat().st_size > 10_000
    changes = [
        f"master.axes.lever.{line.strip().replace(': ', '=')}"
        for line in done.stdout.splitlines()
        if line.strip().startswith(("encoder_quantum:", "position_noise"))
    ]
    assert len(changes) == 3
    axis = load_rig(ROOT / "configs/bench-1dof-2khz.yaml", changes).axes["master.lever"]
    assert axis.encoder_quantum == pytest.approx(STEP)
    assert axis.position_noise_autocorrelation is not None
    assert axis.position_noise_autocorrelation[0] == pytest.approx(0.9 * TAPER[0], abs=0.03)


@pytest.mark.slow
def test_a_simulated_rig_that_stands_still_shows_its_colour(cli: Cli, tmp_path: Path) -> None:
    rig = ROOT / "configs/bench-1dof-2khz-noisy.yaml"
    colour = "simulation.axes.slave.lever.position_noise_autocorrelation=[-0.4]"
    words = ("--set", colour, "--noise", "--axis", "slave.lever", "--clock", "fake")
    done = cli("identify", rig, *words, "--duration", "6", "--out", "run")
    assert done.exit_code == 0, done.output
    again = identify_noise(tmp_path / "run", axis="slave.lever")
    assert again.fit.quantum == pytest.approx(2.094e-5)
    assert again.fit.deviation.value == pytest.approx(9e-5, rel=0.03)
    assert again.fit.autocorrelation is not None
    assert again.fit.autocorrelation[0] == pytest.approx(-0.4 * TAPER[0], abs=0.04)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--noise", "--model", "auto"), "--model cannot be combined with --noise"),
        (("--noise", "--to", "0.1"), "201 samples are too few to estimate noise"),
        (("--noise", "--axis", "a.b"), "is no recording of ours and has no axes"),
        (("--noise", "--position", "x"), "there is no column 'x'"),
    ],
)
def test_what_cannot_be_measured_is_one_sentence(
    words: tuple[str, ...], sentence: str, cli: Cli, tmp_path: Path
) -> None:
    done = cli("identify", csv(tmp_path / "s.csv", 9e-5 * noise_of("white")), *words)
    assert done.exit_code == 2
    assert sentence in done.stderr


@pytest.mark.skipif(not DATA.is_dir(), reason="the bench's recordings are not here")
def test_recorded_motion_is_no_lever_at_rest() -> None:
    for name in ("m1_d_rigid", "m2_a_rigid", "m2_a_free_motion"):
        with pytest.raises(
            RecordingError, match=r"slave_position_rad: it moved .* clamp the lever"
        ):
            identify_noise(DATA / f"{name}.csv", position="slave_position_rad")


@pytest.mark.skipif(not DATA.is_dir(), reason="the bench's recordings are not here")
@pytest.mark.parametrize("side", ["master", "slave"])
def test_the_bench_at_rest_is_all_step_and_no_noise(side: str) -> None:
    """Its documents say 9e-5 rad of noise; at the end of a press it creeps by less than a step."""
    found = identify_noise(
        DATA / "m1_d_spring.csv", position=f"{side}_position_rad", begin_s=3.845, end_s=4.7
    ).fit
    assert found.quantum == pytest.approx(2.0 * math.pi / 300_000, rel=3e-3)
    assert found.deviation.value < 0.3 * found.quantum
    assert found.autocorrelation is None


@pytest.mark.parametrize("step", [0.0, STEP])
def test_only_values_without_a_step_are_reported_to_have_none(step: float) -> None:
    found = fit(drifting(9e-5 * noise_of("white"), step))
    series = Series("", "", "", True, 0.0, 1e-3, *(np.zeros(1),) * 2, np.ones(1, bool), ())
    assert any("Any step" in note for note in _doubts(series, found)) == (step == 0.0)
