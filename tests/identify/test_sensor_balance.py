"""Offset and scale of an effort sensor by what the motor holds at rest."""

from __future__ import annotations

import math
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from tautwave import load_rig, simulate
from tautwave.analysis.identification.sensor_balance import (
    Rests,
    SensorBalance,
    find_rests,
    sensor_balance,
)
from tautwave.cli import main
from tautwave.session.acceptance.sensors import rest_now
from tautwave.session.identification.lever import identify_lever

DATA = Path(__file__).parents[3] / "shared" / "data" / "teleop-1dof"
needs_data = pytest.mark.skipif(not DATA.exists(), reason="the recordings are kept elsewhere")
BENCH = Path(__file__).parents[2] / "configs" / "bench-1dof-2khz.yaml"
TOUCHED = (
    "simulation.hand.lever.reference={type: minimum_jerk, "
    "waypoints: [[0, 0], [0.2, 0.11], [0.5, 0.11], [0.6, 0.16], [1, 0.16]]}"
)
FRICTION = 0.0375
"""What the bench's axes may hold: 1.5 times the friction believed in."""


@given(
    st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)), min_size=1, max_size=12),
    st.floats(0.1, 5.0),
    st.floats(-1.0, 1.0),
)
def test_the_truth_is_always_among_what_is_possible(
    rests: list[tuple[float, float]], scale: float, offset: float
) -> None:
    """Whatever friction does within its bound, at whatever torques."""
    motor = np.array([one for one, _ in rests])
    outside = -motor + 0.1 * np.array([other for _, other in rests])
    shown = offset + scale * outside
    found = sensor_balance(Rests(shown, np.full(len(rests), 1e-9), motor), 0.1)
    assert found is not None
    assert found.scale.lower <= scale <= found.scale.upper
    wide = abs(scale - found.at) * float(np.max(np.abs(outside)) + 0.1) + 1e-6
    assert found.offset.lower - wide <= offset <= found.offset.upper + wide


def test_two_rests_bound_a_scale_by_their_distance_and_the_friction() -> None:
    """1 N m apart with 0.1 of friction: 2 units of shown effort are 2 / 1.2 to 2 / 0.8 of it."""
    rests = Rests(np.array([0.3, 2.3]), np.zeros(2), np.array([0.0, -1.0]))
    found = sensor_balance(rests, 0.1)
    assert found is not None
    assert found.scale == pytest.approx((2.0 / 1.2, 2.0 / 0.8))
    assert sensor_balance(Rests(np.zeros(0), np.zeros(0), np.zeros(0)), 0.1) is None
    one = sensor_balance(Rests(np.array([0.3]), np.zeros(1), np.zeros(1)), 0.1)
    assert one is not None
    assert one.scale == (0.0, math.inf)
    assert one.offset == pytest.approx((0.2, 0.4))


def at_rest(fault: str) -> SensorBalance:
    """What the slave's rests allow: away from a wall, and pressed against it twice."""
    rig = load_rig(
        BENCH,
        [
            "duration_s=1",
            TOUCHED,
            "slave.axes.lever.effort_sensor={}",
            f"simulation.axes.slave.lever.effort_sensor={fault}",
        ],
    )
    run = simulate(rig, engine="python")
    columns = (run[f"slave.lever.{what}"] for what in ("position", "commanded", "measured_effort"))
    position, motor, shown = columns
    play = 2.0 * 2.094e-5 + 6.0 * 1.5e-5
    found = sensor_balance(
        find_rests(position, motor, shown, window=100, play=play, quantum=0.0), FRICTION
    )
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("fault", "scale", "offset"),
    [
        ("{noise: 2.0e-3}", 1.0, 0.0),
        ("{offset: 0.1, noise: 2.0e-3}", 1.0, 0.1),
        ("{scale: 3, noise: 2.0e-3}", 3.0, 0.0),
    ],
)
def test_a_simulated_sensors_fault_is_found_and_a_good_one_is_not_blamed(
    fault: str, scale: float, offset: float
) -> None:
    found = at_rest(fault)
    assert found.rests >= 3
    assert scale in found.scale
    assert (1.0 in found.scale) == (scale == 1.0)
    if scale == 1.0:
        assert offset in found.offset
        assert (0.0 in found.offset) == (offset == 0.0)


@pytest.mark.slow
@pytest.mark.nightly
def test_a_run_says_which_key_should_be_what(tmp_path: Path) -> None:
    words = [
        "run",
        str(BENCH),
        "--clock",
        "fake",
        "--duration",
        "1",
        "--out",
        str(tmp_path / "out"),
    ]
    words += ["--set", TOUCHED, "--set", "slave.axes.lever.effort_sensor={}"]
    fault = "simulation.axes.slave.lever.effort_sensor={offset: 0.1}"
    done = CliRunner().invoke(main, [*words, "--set", fault])
    assert done.exit_code == 0, done.output
    said = " ".join(done.output.split())
    [number] = re.findall(r"effort_sensor\.offset should be about ([\d.]+\d)", said)
    assert float(number) == pytest.approx(0.1, abs=0.03)


@needs_data
@pytest.mark.slow
def test_the_sessions_of_the_recordings_do_not_agree_on_a_newton_metre() -> None:
    """The same spring, by the sensor 3.4 and 9.5 N m/rad, and by the motors one and the same."""
    columns = {"position": "slave_position_rad", "effort": "slave_command_nm",
               "outside": "environment_torque_nm"}  # fmt: skip
    units = []
    for name in ("m1_d_spring", "m2_a_spring"):
        found = identify_lever(DATA / f"{name}.csv", **columns)
        assert found.fit.outside is not None
        units.append(abs(found.fit.outside.value))
        assert any("one of both scales" in note for note in found.notes)
        assert found.sensor_offset is not None
    assert units[1] > 2.0 * units[0]


def test_a_sensor_is_looked_at_for_a_while_and_an_axis_without_one_is_not() -> None:
    for sensor, rests in ((None, []), (SimpleNamespace(quantum=0.02), [(0.5, 0.01, 0.1)])):
        rig: Any = SimpleNamespace(axes={"slave.a": SimpleNamespace(effort_sensor=sensor)})
        control: Any = SimpleNamespace(now_ns=0, outside=lambda _: 0.5)
        looking, found, slots = rest_now(rig, "slave.a", 0.1, control), None, 0
        while found is None:
            try:
                next(looking)
            except StopIteration as ended:
                found = ended.value
            control.now_ns += 50_000_000
            slots += 1
        assert [tuple(one) for one in found] == rests
        assert slots == (5 if sensor else 1)
