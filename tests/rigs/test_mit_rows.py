"""A rig over simulated MIT motors against one on loopback, and what ends such a run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from tests.rigs.running import Run, Tree, books, rig_of, run_rig

CONFIG = Path(__file__).parents[2] / "configs" / "bench-mit-virtual.yaml"


def tree(**options: Any) -> Tree:
    data: Tree = yaml.safe_load(CONFIG.read_text(encoding="utf-8"))
    data["buses"]["can"]["options"].update(options)
    return data


def robstride(**options: Any) -> Tree:
    """Return the rig with RobStride's motors, the same ranges in 16 bits."""
    data = tree(family="robstride", **options)
    for motor in data["buses"]["can"]["options"]["motors"]:
        motor["feedback_id"] = 0xFD
    return data


def loopback(data: Tree) -> Tree:
    """Return the same rig on a loopback bus, with the steps and the command delay of the motors."""
    rig = rig_of(data)
    out: Tree = yaml.safe_load(yaml.safe_dump(data))
    period = 1.0 / rig.rate_hz
    out["buses"] = {"can": {"driver": "loopback", "options": {"command_delay_s": period}}}
    for side in ("master", "slave"):
        for key in ("encoder_quantum", "effort_quantum"):
            out[side]["axes"]["lever"][key] = getattr(rig.axes[f"{side}.lever"], key)
    return out


@pytest.fixture(scope="module")
def rows() -> Run:
    return run_rig(tree(), duration_s=2.0)


@pytest.mark.slow
def test_it_moves_as_on_loopback_but_for_the_codes(rows: Run) -> None:
    """Codes lie half a step beside multiples of it: no bit is equal, and no place is far off."""
    other = run_rig(loopback(tree()), duration_s=2.0)
    step = 25.0 / 65535
    for side in ("master", "slave"):
        column = f"true.{side}.lever.position"
        assert np.abs(rows[column]).max() > 0.1
        assert np.abs(rows[column] - other[column]).max() < 5.0 * step
    closed = books(rows, "lever")
    assert closed.residual < 1e-9 * closed.gross_flow


@pytest.mark.slow
def test_robstrides_motors_move_as_on_loopback_but_for_the_codes() -> None:
    mine = run_rig(robstride(), duration_s=2.0)
    other = run_rig(loopback(robstride()), duration_s=2.0)
    for side in ("master", "slave"):
        column = f"true.{side}.lever.position"
        assert np.abs(mine[column]).max() > 0.1
        assert np.abs(mine[column] - other[column]).max() < 5.0 * 25.0 / 65535
    told, acted = mine["slave.lever.commanded"], mine["slave.lever.motor_effort"]
    assert np.abs(told).max() > 0.05
    assert np.abs(acted[2:] - told[:-2]).max() <= 0.51 * 20.0 / 65535
    closed = books(mine, "lever")
    assert closed.residual < 1e-9 * closed.gross_flow


@pytest.mark.slow
@pytest.mark.parametrize(
    "options", [{"data_bitrate": 5_000_000}, {"bitrate": 750_000}], ids=["fd", "slower"]
)
def test_the_wire_changes_no_row(rows: Run, options: dict[str, Any]) -> None:
    """What a motor is told acts from its slot on, however long its frame takes."""
    other = run_rig(tree(**options), duration_s=2.0)
    for side in ("master", "slave"):
        for column in (f"{side}.lever.position", f"true.{side}.lever.position"):
            assert np.array_equal(rows[column], other[column])


@pytest.mark.slow
def test_what_the_motors_report_is_recorded(rows: Run) -> None:
    """A command is sent one period later, and reported with the sample after that."""
    step = 20.0 / 4095
    told, acted = rows["slave.lever.commanded"], rows["slave.lever.motor_effort"]
    assert np.abs(told).max() > 5.0 * step
    assert np.abs(acted[2:] - told[:-2]).max() <= 0.51 * step
    assert (rows["slave.lever.rotor_temperature"] == 25.0).all()


@pytest.mark.parametrize(
    ("quirk", "words"),
    [
        ({"restarts_at_s": 0.05}, "slave.lever: motor 2: disabled: it was switched off and on"),
        ({"error_at_s": 0.05, "error": 14}, "slave.lever: motor 2: overload"),
        ({"silent_at_s": 0.05}, "slave.lever on bus 'can': no sample in 3 cycles"),
    ],
)
def test_what_befalls_a_motor_ends_the_run_in_words(quirk: dict[str, Any], words: str) -> None:
    run = run_rig(tree(simulator={"motors": {"2": quirk}}), raises=False, duration_s=0.1)
    assert words in str(run.result.error)
    last = run["true.slave.lever.velocity"][-1]
    assert np.isfinite(last)
    simulator = run.assembly.simulators[0]
    assert all(motor.state != 1 for motor in simulator.world.motors if motor.present)


@pytest.mark.parametrize(
    ("quirk", "words"),
    [
        ({"restarts_at_s": 0.05}, "slave.lever: motor 2: stopped: its CAN timeout has passed"),
        ({"error_at_s": 0.05, "error": 16}, "slave.lever: motor 2: stalled or overloaded"),
        ({"silent_at_s": 0.05}, "slave.lever on bus 'can': no sample in 3 cycles"),
    ],
)
def test_what_befalls_a_robstride_motor_ends_the_run_in_words(
    quirk: dict[str, Any], words: str
) -> None:
    data = robstride(simulator={"motors": {"2": quirk}})
    run = run_rig(data, raises=False, duration_s=0.1)
    assert words in str(run.result.error)
    simulator = run.assembly.simulators[0]
    assert all(not motor.on for motor in simulator.world.motors if motor.present)
