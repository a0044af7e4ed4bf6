"""What goes wrong on a Dynamixel bus in the middle of a run: the loop's answer, and the exit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from click.testing import CliRunner

from tautwave.cli import main
from tautwave.errors import DeviceFault, DriverError
from tests.commands import PATIENT, assert_ran_to_its_end
from tests.rigs.running import Run, Tree, books, run_rig, tree
from tests.rigs.test_dynamixel_rows import ONE, TWO, axis, rig_tree, servos

pytestmark = pytest.mark.realtime

CONFIGS = Path(__file__).parents[2] / "configs"


def run_with(*events: Tree, read: str = "sync", **changes: Any) -> Run:
    line = servos(ONE, TWO, read=read, simulator={"faults": {"events": list(events)}})
    data = rig_tree({"line": line}, axis("line", 1), axis("line", 2), **changes)
    data.setdefault("loop", {})["missing_limit"] = 20
    return run_rig(data, raises=False)


def test_an_unplugged_adapter_ends_in_a_passive_stop_and_a_clear_sentence() -> None:
    run = run_with({"kind": "unplug", "at_s": 0.4})
    assert isinstance(run.result.error, DeviceFault)
    assert "unplugged; plug it in and run again" in str(run.result.error)
    # Ramped down, not cut: the loop goes on for the release and then leaves.
    assert 400 < run.result.cycles < 1200
    assert books(run).residual < 1e-9 * books(run).gross_flow


@pytest.mark.sparse(2)
@pytest.mark.parametrize("read", ["sync", "fast_sync"])
def test_a_servo_away_for_a_while_costs_its_own_samples_only(read: str) -> None:
    away = {"kind": "remove", "at_s": 0.40, "id": 1}, {"kind": "restore", "at_s": 0.41, "id": 1}
    run = run_with(*away, read=read)
    assert run.result.error is None
    master, slave = run.result.lost
    assert 10 <= master <= 12
    assert slave <= 1  # whoever waits for the one before, waits once
    closed = books(run)
    assert closed.residual < 1e-9 * closed.gross_flow


def test_a_servo_that_stays_away_ends_the_run() -> None:
    run = run_with({"kind": "remove", "at_s": 0.4, "id": 2})
    assert isinstance(run.result.error, DriverError)
    assert "slave.a on bus 'line': no sample in 20 cycles in a row" in str(run.result.error)
    assert run.result.lost[0] <= 1


@pytest.mark.sparse(2)
@pytest.mark.parametrize(
    ("kind", "words"),
    [("overload", "overloaded for too long"), ("overheat", "overheated")],
)
def test_a_hardware_error_ends_the_run_in_words(kind: str, words: str) -> None:
    run = run_with({"kind": kind, "at_s": 0.4, "id": 2})
    assert isinstance(run.result.error, DeviceFault)
    assert str(run.result.error).startswith("slave.a: servo 2: ")
    assert words in str(run.result.error)


@pytest.mark.slow
def test_random_faults_leave_the_books_closed_and_are_reproducible() -> None:
    chances = {"lost": 0.02, "corrupted": 0.02, "truncated": 0.01, "extra_bytes": 0.02, "seed": 3}
    line = servos(ONE, TWO, simulator={"faults": chances})
    data = rig_tree({"line": line}, axis("line", 1), axis("line", 2))
    first, second = run_rig(data), run_rig(data)
    assert sum(first.result.lost) > 20
    assert np.array_equal(first.table, second.table, equal_nan=True)  # NaN: no status came
    closed = books(first)
    assert closed.residual < 1e-9 * closed.gross_flow
    other = tree(base=data)
    other["buses"]["line"]["options"]["simulator"]["faults"]["seed"] = 4
    assert not np.array_equal(run_rig(other).table, first.table)


@pytest.mark.nightly
@pytest.mark.slow
@pytest.mark.parametrize("name", ["bench-dynamixel-sim", "bench-mixed-sim"])
def test_a_shipped_rig_runs_over_a_real_pty(name: str, tmp_path: Path) -> None:
    """However busy the machine is: what may be missing is not what is tested here."""
    words = [
        "run",
        str(CONFIGS / f"{name}.yaml"),
        "--duration",
        "2",
        "--out",
        str(tmp_path / "run"),
    ]
    words += PATIENT
    patient = {"dynamixel": "watchdog_s=2.5", "canopen": "heartbeat_timeout_ms=5000"}
    rig = yaml.safe_load((CONFIGS / f"{name}.yaml").read_text())
    for bus, block in rig["buses"].items():
        words += ["--set", f"buses.{bus}.options.{patient[block['driver']]}"]
    done = CliRunner().invoke(main, words)
    summary = assert_ran_to_its_end(done.exit_code, tmp_path / "run", done.output)
    energy = summary["energy_j"]
    assert energy["residual"] <= 1e-9 * energy["gross_flow"] + 1e-15
