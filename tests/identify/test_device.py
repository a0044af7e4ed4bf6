"""`identify RIG` on loopback: what it finds, what it refuses, and that it ends safely."""

from __future__ import annotations

import gc
import json
import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from can.interfaces.virtual import VirtualBus
from click.testing import CliRunner, Result

from tautwave.cli import main
from tautwave.config import Rig, load_rig, simulation_of
from tautwave.contracts import Endpoint
from tautwave.errors import BusTimeout, ConfigError, NotCertifiedError, RecordingError, SafetyStop
from tautwave.recordings.recording import read_recording
from tautwave.rig import BusWay, Way
from tautwave.session.identification import identifying
from tautwave.session.identification.exciting import Excitation, plan_excitation
from tautwave.session.identification.identifying import identify_device

CONFIGS = Path(__file__).parents[2] / "configs"
BENCH = CONFIGS / "bench-1dof-loopback.yaml"
Cli = Callable[..., Result]


@pytest.fixture
def cli(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Cli:
    monkeypatch.chdir(tmp_path)
    return lambda *words: CliRunner().invoke(main, [str(word) for word in words])


def found_and_true(rig: Rig, axis: str, directory: Path) -> list[tuple[str, bool, float]]:
    result = identify_device(rig, axis=axis, out=directory, clock="fake", duration_s=6.0)
    truth = simulation_of(rig, axis)
    assert not any("inertia is indistinguishable" in note for note in result.notes)
    pairs = []
    for name in ("inertia", "damping", "coulomb"):
        estimate, value = getattr(result.fit, name), getattr(truth, name)
        pairs.append((name, estimate.lower <= value <= estimate.upper, estimate.value / value))
    return pairs


@pytest.mark.sparse(3)
@pytest.mark.parametrize(
    ("name", "axis"),
    [
        ("bench-1dof-2khz", "slave.lever"),  # noise of 9e-5 rad
        ("bench-saturation-loopback", "master.lever"),  # friction, lost samples, overruns, delay
        ("bench-2axis-loopback", "slave.slide"),  # linear
    ],
)
def test_the_truth_of_a_simulated_rig_is_found(name: str, axis: str, tmp_path: Path) -> None:
    inside = []
    for seed in range(2):
        rig = load_rig(CONFIGS / f"{name}.yaml", [f"seed={seed}"])
        for what, held, ratio in found_and_true(rig, axis, tmp_path / str(seed)):
            inside.append(held)
            assert ratio == pytest.approx(1.0, abs=0.01 if what == "inertia" else 0.15)
    assert sum(inside) >= 5, f"{sum(inside)} of 6"


@pytest.mark.slow
def test_it_stays_within_what_it_promised(tmp_path: Path) -> None:
    rig = load_rig(BENCH, ["simulation.axes.master.lever.inertia=5.0e-4"])  # 3 x too light
    axis = rig.axes["master.lever"]
    result = identify_device(
        rig, axis="master.lever", out=tmp_path, clock="fake", duration_s=8.0, share=0.2
    )
    assert result.fit.inertia.value == pytest.approx(5e-4, rel=0.01)
    recording = read_recording(tmp_path / "recording.mcap")
    assert abs(recording["master.lever.commanded"]).max() <= 0.25 * axis.effort_limit
    assert axis.position_range is not None
    assert abs(recording["master.lever.position"]).max() < axis.position_range[1]
    assert abs(recording["slave.lever.commanded"]).max() == 0.0
    assert recording["master.lever.commanded"][-1] == pytest.approx(0.0, abs=0.01)
    assert result.interrupted is False


def test_a_heavy_device_is_shaken_harder_and_a_light_one_less() -> None:
    rig = load_rig(BENCH)
    plan = plan_excitation(rig, "master.lever", 8000, share=0.3, reach=None)
    heavy, light = Excitation(plan), Excitation(plan)
    for slot in range(3000):
        heavy.pass_slots(1)
        light.pass_slots(1)
        assert abs(heavy.effort(0.0, 0.0)) <= plan.effort
        light.effort(1.1 * plan.reach if slot > 1000 else 0.0, 0.0)
    assert heavy.gain > 1.5
    assert light.gain < 0.5


@pytest.mark.slow
def test_a_blocked_device_is_a_recording_that_tells_nothing(tmp_path: Path) -> None:
    rig = load_rig(BENCH, ["simulation.axes.master.lever.coulomb=1.0"])
    with pytest.raises(
        RecordingError, match="cannot be identified: the device hardly moved"
    ) as reported:
        identify_device(rig, axis="master.lever", out=tmp_path, clock="fake", duration_s=3.0)
    assert reported.value.exit_code == 2  # nothing was stopped: the run itself went as it should


@pytest.mark.slow
def test_leaving_the_range_stops_and_says_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Excitation, "effort", lambda *_: 0.05)  # the gain fails to follow
    with pytest.raises(SafetyStop, match=r"left its position range.* all axes stopped safely"):
        identify_device(
            load_rig(BENCH), axis="master.lever", out=tmp_path, clock="fake", duration_s=3.0
        )
    commanded = read_recording(tmp_path / "recording.mcap")["master.lever.commanded"]
    assert abs(commanded[-1]) < 0.01


@pytest.mark.slow
def test_an_axis_at_the_end_of_its_range_is_not_shaken(tmp_path: Path) -> None:
    rig = load_rig(BENCH, ["simulation.axes.master.lever.start_position=0.45"])
    with pytest.raises(SafetyStop, match="at the end of its range"):
        identify_device(rig, axis="master.lever", out=tmp_path, clock="fake", duration_s=3.0)


def test_what_is_refused(cli: Cli, tmp_path: Path) -> None:
    rig = shutil.copy(BENCH, tmp_path / "rig.yaml")
    several = cli("identify", rig)
    assert several.exit_code == 2
    assert several.stderr.strip() == (
        "bench-1dof: choose an axis with --axis: master.lever, slave.lever"
    )
    wrong = cli("identify", rig, "--axis", "master.wrist")
    assert "no axis 'master.wrist'" in wrong.stderr
    admittance = cli(
        "identify", CONFIGS / "bench-admittance-loopback.yaml", "--axis", "slave.lever"
    )
    assert admittance.exit_code == 2
    assert "is an admittance axis" in admittance.stderr
    mixed = cli("identify", rig, "--axis", "master.lever", "--position", "x")
    assert mixed.exit_code == 2
    assert "--position is for a recording" in mixed.stderr
    assert not (tmp_path / "runs").exists()


def test_an_axis_without_a_range_is_not_shaken() -> None:
    rig = load_rig(BENCH)
    axes = {"lever": rig.master.axes["lever"].model_copy(update={"position_range": None})}
    rig = rig.model_copy(update={"master": rig.master.model_copy(update={"axes": axes})})
    with pytest.raises(ConfigError, match=r"--set 'master\.axes\.lever\.position_range"):
        identifying.axis_to_identify(rig, "master.lever")


def test_uncertified_hardware_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rig = load_rig(BENCH).model_copy(update={"simulation": None})
    way = BusWay(Way.HARDWARE, Endpoint("real", "/dev/ttyUSB0"))
    monkeypatch.setattr(identifying, "bus_ways", lambda *_, **__: dict.fromkeys(rig.buses, way))
    plugin: Any = SimpleNamespace(hardware=True)
    monkeypatch.setattr(identifying, "load_driver", lambda _: plugin)
    monkeypatch.setattr(
        identifying, "certificate_of", lambda *_: {"passed": False, "sentences": ["because"]}
    )
    with pytest.raises(NotCertifiedError, match="allow-uncertified"):
        identify_device(rig, axis="master.lever", out=tmp_path / "out", clock="fake")
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_the_lines_can_be_pasted_and_check_reads_them(cli: Cli, tmp_path: Path) -> None:
    text = BENCH.read_text()
    rig = tmp_path / "rig.yaml"
    rig.write_text(text)
    words = ("--axis", "master.lever", "--clock", "fake", "--duration", 6, "--out", "out")
    done = cli("identify", rig, *words, "--json")
    assert done.exit_code == 0, done.output
    reported = json.loads(done.stdout)
    assert "bus hand  simulated here, in memory" in done.stderr
    for name in ("identification.json", "identification.png", "recording.mcap", "rig.yaml"):
        assert (tmp_path / "out" / name).stat().st_size > 0
    again = cli("identify", rig, *words)
    assert again.exit_code == 2
    assert "not empty" in again.stderr
    belief = reported["beliefs"]["inertia"]
    assert belief["lower"] < reported["parameters"]["inertia"]["lower"] < belief["value"]
    lines = text.splitlines()
    at = next(k for k, line in enumerate(lines) if line.strip().startswith("inertia:"))
    assert lines[at + 1].strip().startswith("damping:")
    lines[at : at + 2] = ["      " + line for line in reported["snippet"].splitlines()]
    rig.write_text("\n".join(lines) + "\n")
    loaded = load_rig(rig).axes["master.lever"]
    assert loaded.inertia is not None
    assert loaded.inertia.model_dump() == belief
    assert loaded.damping.model_dump() == reported["beliefs"]["damping"]
    assert loaded.coulomb.model_dump() == reported["beliefs"]["coulomb"]
    checked = cli("check", rig, "--json")
    assert checked.exit_code in (0, 3)
    assert "master.lever" in checked.stdout


@pytest.mark.slow
def test_the_table_names_what_was_found(cli: Cli) -> None:
    done = cli("identify", BENCH, "--axis", "slave.lever", "--clock", "fake", "--duration", 5)
    assert done.exit_code == 0, done.output
    for words in (
        "inertia",
        "kg m^2",
        "Coulomb friction",
        "source: identified",
        "coupling was off",
    ):
        assert words in done.stdout


def test_a_stop_outranks_a_recording_that_is_incomplete_and_names_both() -> None:
    with pytest.raises(SafetyStop, match=r"too fast; .*smaller --reach or --share; disk full"):
        identifying._tell("master.lever", SafetyStop("too fast"), "disk full")
    with pytest.raises(BusTimeout, match=r"^arm: no answer; disk full$"):
        identifying._tell("master.lever", BusTimeout("arm: no answer"), "disk full")


@pytest.mark.slow
@pytest.mark.realtime
def test_no_virtual_bus_stays_open(tmp_path: Path) -> None:
    """Else python-can tells a person at the end that it was not shut down."""
    rig = load_rig(CONFIGS / "bench-canopen-virtual.yaml", ["loop.overrun_limit=5000"])
    with suppress(RecordingError):  # of so short a run
        identify_device(
            rig, axis="master.lever", out=tmp_path, duration_s=1.0, allow_uncertified=True
        )
    assert (tmp_path / "recording.mcap").exists()
    buses = [one for one in gc.get_objects() if type(one) is VirtualBus]
    assert [one for one in buses if one._is_shutdown]
    assert not [one for one in buses if not one._is_shutdown]
