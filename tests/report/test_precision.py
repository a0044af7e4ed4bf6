"""A report says how exact its run was: against the oracle, and at half and double the rate."""

from __future__ import annotations

import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tautwave.bench.rigs import ONE_PAIR
from tautwave.config import Rig, load_rig, resolved_yaml
from tautwave.report import write_report
from tautwave.report.precision import oracle as precision
from tautwave.report.precision import table as precision_table
from tautwave.report.precision.oracle import distance, measure_precision, precision_of, resampled
from tautwave.report.run.complete import write_summary
from tautwave.report.run.loading import load_run
from tautwave.report.run.rundir import Run
from tautwave.simulation.rows import Simulation
from tautwave.simulation.run import simulate
from tautwave.summary import Summary, summary_of
from tests.report.rows_of import put
from tests.report.synthetic import make_run, write_recording

SECONDS = 1.2


def rig_of(*given: str) -> Rig:
    moves = "simulation.hand.lever.reference.waypoints=[[0.1, 0.0], [0.5, 0.25], [0.9, 0.05]]"
    return load_rig(ONE_PAIR.path(), [f"duration_s={SECONDS}", moves, *given])


def leave_run(directory: Path, rig: Rig, rows: Simulation, clock: str = "fake") -> Path:
    """Write what a run of `rows` leaves behind."""
    directory.mkdir(parents=True)
    (directory / "rig.yaml").write_text(resolved_yaml(rig))
    summary = {"rig": rig.name, "clock": clock, "rate_hz": rig.rate_hz, "pairs": {}}
    (directory / "summary.json").write_text(json.dumps(summary))
    columns = {name: rows[name] for name in rows.columns}
    write_recording(directory / "recording.mcap", columns)
    return directory


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> tuple[Rig, Path]:
    rig = rig_of()
    rows = simulate(rig, engine="python")
    return rig, leave_run(tmp_path_factory.mktemp("runs") / "one", rig, rows)


@pytest.fixture(scope="module")
def reported(simulated: tuple[Rig, Path]) -> dict[str, Any]:
    run = load_run(simulated[1])
    run.result = measure_precision(run)
    write_summary(run)
    found: dict[str, Any] = run.result.precision
    return found


def test_the_run_is_replayed_to_the_bit(reported: dict[str, Any]) -> None:
    assert reported["kind"] == "simulated"
    assert reported["replayed_equal"] is True
    assert reported["whole"] is True
    assert reported["span_s"] == pytest.approx(SECONDS)


def test_the_exact_devices_are_their_oracle(reported: dict[str, Any]) -> None:
    oracle = reported["pairs"]["lever"]["oracle"]
    assert oracle["position"] < 1e-9 * reported["pairs"]["lever"]["travel"]


@pytest.mark.slow
def test_a_coarse_integrator_is_distinguished_from_its_oracle(tmp_path: Path) -> None:
    rig = rig_of("simulation.integrator.scheme=symplectic_euler")
    run = load_run(leave_run(tmp_path / "run", rig, simulate(rig, engine="python")))
    found = precision_of(run, rig)["pairs"]["lever"]
    exact = simulate(rig_of(), engine="python")["true.slave.lever.position"]
    own = run.read("true.slave.lever.position")["true.slave.lever.position"]
    want = np.abs(own - exact).max()
    assert found["oracle"]["position"] == pytest.approx(want, rel=1e-3)
    assert want > 1e-5


@pytest.mark.slow
def test_half_and_double_rate_are_those_rigs_simulated(
    simulated: tuple[Rig, Path], reported: dict[str, Any]
) -> None:
    rig, _ = simulated
    name = "true.slave.lever.position"
    base = simulate(rig, engine="python")[name]
    double = simulate(rig.model_copy(update={"rate_hz": 2000.0}), engine="python")[name]
    half = simulate(rig.model_copy(update={"rate_hz": 500.0}), engine="python")[name]
    found = reported["pairs"]["lever"]
    assert found["double"]["position"] == pytest.approx(np.abs(double[::2] - base).max())
    assert found["half"]["position"] == pytest.approx(np.abs(half - base[::2]).max())
    assert 0.0 < found["double"]["position"] < found["half"]["position"]


def test_the_laws_of_a_hardware_run_give_its_efforts_again(simulated: tuple[Rig, Path]) -> None:
    rig, directory = simulated
    found = precision_of(load_run(directory), rig.model_copy(update={"simulation": None}))
    assert found["kind"] == "hardware"
    for side in ("master", "slave"):
        part = found["pairs"]["lever"][side]
        assert part["replayed"] == 0.0
        assert 0.0 < part["double"]["effort_rms"] < part["half"]["effort_rms"] < part["effort"]


def test_another_law_does_not(simulated: tuple[Rig, Path]) -> None:
    _, directory = simulated
    rig = rig_of("coupling.pairs.lever.wave_impedance=0.03")
    found = precision_of(load_run(directory), rig.model_copy(update={"simulation": None}))
    assert found["pairs"]["lever"]["slave"]["replayed"] > 1e-3


@pytest.mark.slow
@pytest.mark.usefixtures("unpainted")
def test_the_page_says_it(simulated: tuple[Rig, Path], reported: dict[str, Any]) -> None:
    assert reported
    page = write_report(simulated[1]).read_text()
    part = page[page.index('id="precision"') :]
    assert "the whole run, 1.2" in part
    assert "at half the rate" in part
    assert "extrapolated, sampling moves the slave by" in part
    assert "bit for bit" in part


def test_hardware_has_a_table_too(simulated: tuple[Rig, Path]) -> None:
    rig, directory = simulated
    run = load_run(directory)
    bare = rig.model_copy(update={"simulation": None})
    found = precision_of(run, bare)
    found["pairs"]["lever"]["slave"]["replayed"] = 0.0123456
    put(run, {"precision": found})
    (table,) = precision_table.precision_tables(run)
    assert [row[0] for row in table.rows] == ["master.lever", "slave.lever"]
    assert [row[2] for row in table.rows] == [
        f"{value}\N{NARROW NO-BREAK SPACE}{unit}"
        for value, unit in (("0", "N m"), ("12.3", "mN m"))
    ]
    assert any(
        "run again on the recorded positions" in s for s in precision_table.precision_sentences(run)
    )


@pytest.mark.slow
def test_what_cannot_be_replayed_is_said(tmp_path: Path) -> None:
    make_run(tmp_path / "run")  # of another framework's rig
    run = load_run(tmp_path / "run")
    run.result = measure_precision(run)
    assert run.result.precision["error"]
    assert next(precision_table.precision_sentences(run)).startswith("Not computed: ")


def test_a_long_run_is_replayed_compiled_or_in_part(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = rig_of()
    monkeypatch.setattr(precision, "kernel_is_kept", lambda *_: False)
    assert precision.replay_of(rig, 10.0) == precision.Replay(2.0, "python", False)
    monkeypatch.setattr(precision, "kernel_is_kept", lambda *_: True)
    assert precision.replay_of(rig, 10.0) == precision.Replay(10.0, "compiled", True)
    assert precision.replay_of(rig, 3600.0) == precision.Replay(120.0, "compiled", False)


@pytest.mark.slow
def test_a_part_has_no_ramp_at_its_end(
    simulated: tuple[Rig, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    rig, directory = simulated
    monkeypatch.setattr(precision, "FEW_CYCLES", 700)
    monkeypatch.setattr(precision, "kernel_is_kept", lambda *_: False)
    run = load_run(directory)
    assert precision_of(run, rig)["replayed_equal"] is True
    bare = rig.model_copy(update={"simulation": None})
    found = precision_of(run, bare)
    assert found["span_s"] == pytest.approx(0.7)
    assert found["pairs"]["lever"]["master"]["replayed"] == 0.0


def test_resampling_keeps_samples_and_is_third_order_between() -> None:
    errors = []
    for n in (50, 100):
        time = np.linspace(0.0, 1.0, n + 1)
        fine = np.linspace(0.0, 1.0, 2 * n + 1)
        found = resampled(fine, time, np.sin(7.0 * time))
        assert np.array_equal(found[::2], np.sin(7.0 * time))
        errors.append(np.abs(found - np.sin(7.0 * fine))[4:-4].max())
    assert math.log2(errors[0] / errors[1]) > 2.7
    assert resampled(np.array([2.0]), time, time)[0] == 1.0


def test_distance_is_at_common_instants_only() -> None:
    t = np.linspace(0.0, 4e-3, 5)
    x = np.linspace(0.0, 4.0, 5)
    u = np.linspace(0.0, 4e-3, 9)
    gap = distance(t, x, u, np.linspace(0.25, 4.25, 9))
    assert gap == pytest.approx(np.full(5, 0.25))
    assert distance(t, x, t[::2], x[::2] - 1.0) == pytest.approx(np.full(3, -1.0))


def test_the_order_is_that_of_the_two_differences() -> None:
    found = {"half": {"position_rms": 4e-3}, "double": {"position_rms": 1e-3}}
    (words,) = precision_table.order_notes(found, "m")
    assert "to the power 2;" in words
    assert "1.3" in words  # 1e-3 * 4 / 3
    found["double"]["position_rms"] = 4e-3
    (words,) = precision_table.order_notes(found, "m")
    assert "no convergence order" in words


def test_a_run_without_pairs_is_left_alone(simulated: tuple[Rig, Path]) -> None:
    rig, directory = simulated
    run = Run(directory, {}, "", Summary())
    assert "error" in precision_of(run, rig)


def test_less_than_an_encoder_step_is_called_that(simulated: tuple[Rig, Path]) -> None:
    run = load_run(simulated[1])
    found = {"oracle": {"position": 1e-6}}
    (words,) = precision_table.step_notes(run, "lever", found)
    assert "20.9" in words
    found["oracle"]["position"] = 1e-3
    assert not list(precision_table.step_notes(run, "lever", found))
    without: Any = SimpleNamespace(rig={})  # a rig that states no encoder step has none
    assert not list(precision_table.step_notes(without, "lever", {"oracle": {"position": 1e-6}}))


@pytest.mark.parametrize(
    ("facts", "why"),
    [
        ({}, ""),
        ({"missed_cycles": 3}, ": in the run cycles were missed"),
        (
            {"axes": {"master.lever": {"lost": 0, "late": 2}}, "outcome": {"kind": "interrupted"}},
            ": in the run samples were lost or late, it was stopped",
        ),
        ({"faults": ["arm: overheated"]}, ": in the run devices reported faults"),
    ],
    ids=["unknown", "missed", "late and stopped", "faults"],
)
def test_a_replay_that_differs_says_what_the_run_had(facts: dict[str, Any], why: str) -> None:
    summary = {**facts, "precision": {"kind": "simulated", "span_s": 1.0, "replayed_equal": False}}
    run: Any = SimpleNamespace(result=summary_of(summary)[0])
    *_, last = precision_table.precision_sentences(run)
    assert last.endswith(f"recorded truth bit for bit{why}.")
