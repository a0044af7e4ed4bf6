"""Effort sensors of axes that take effort, and motors that report theirs: read and recorded."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tautwave_drivers.modbus
from tautwave import load_rig, simulate
from tautwave.config import Rig
from tautwave.errors import ConfigError
from tautwave.models.sensors.effort import SensorParams, follow_effort, sensor_reading
from tautwave.simulation.kernel.device import begin_sensor
from tautwave.simulation.kernel.pack import pack_rig
from tautwave.simulation.kernel.records import DeviceState
from tests.rigs.running import run_rig

CONFIGS = Path(__file__).parents[2] / "configs"
BENCH, CAN = CONFIGS / "bench-1dof-2khz.yaml", CONFIGS / "bench-canopen-virtual.yaml"
SLAVE = "slave.axes.lever.effort_sensor"
TOUCHED = "simulation.hand.lever.reference={type: minimum_jerk, waypoints: [[0, 0], [0.3, 0.2]]}"
FASTER = TOUCHED.replace("0.3, 0.2", "0.12, 0.2")
TRUE = "{quantum: 1.0e-3, noise: 2.0e-3, bandwidth_hz: 200, delay_s: 0.001, offset: 0.05, scale: 2}"


def bench(*changes: str, seconds: float = 0.4) -> Rig:
    return load_rig(BENCH, [f"duration_s={seconds}", TOUCHED, *changes])


@pytest.mark.parametrize("engine", ["python", pytest.param("compiled", marks=pytest.mark.slow)])
def test_simulations_are_the_live_run_to_the_bit(engine: str) -> None:
    rig = bench(f"{SLAVE}={TRUE}", "master.axes.lever.effort_sensor={}", seconds=0.3)
    live, done = run_rig(rig), simulate(rig, engine=engine)
    assert done.columns == tuple(live.columns)
    np.testing.assert_array_equal(done.data, live.table)


@pytest.mark.slow
@pytest.mark.nightly
def test_compiled_devices_of_a_live_run_have_the_same_sensors() -> None:
    from tautwave.rig import build_rig
    from tautwave.simulation.live.devices import CompiledDevices
    from tautwave.simulation.memory import run_in_memory

    rig = bench(f"{SLAVE}={TRUE}", seconds=0.2)
    _, made = run_in_memory(build_rig(rig, clock="fake", devices=CompiledDevices))
    np.testing.assert_array_equal(made, run_rig(rig).table)


def test_a_sensor_shows_at_once_what_a_device_rests_against() -> None:
    """Hand and environment as they are felt together, in its delay as well."""
    more = ("simulation.environment.lever={type: spring, stiffness: 40, position: 0.1}",
            f"simulation.axes.slave.lever.effort_sensor={TRUE}")  # fmt: skip
    job = pack_rig(bench(f"{SLAVE}={TRUE}", *more))
    d = job.devices[job.axes.index("slave.lever")]
    b, table = DeviceState(x=0.3), job.table.tolist()
    begin_sensor(b, d, table)
    assert b.shown == b.felt == pytest.approx(-40.0 * 0.2)
    assert table[d.sensed : d.sensed + d.sensor.delay] == [b.felt] * d.sensor.delay
    assert d.sensor.delay == 2


def test_offset_and_scale_are_taken_off_and_what_is_left_is_lag_and_noise() -> None:
    run = simulate(bench(f"{SLAVE}={TRUE}"), engine="python")
    shown = run["slave.lever.measured_effort"]
    true = run["true.slave.lever.environment_effort"]
    assert np.abs(true).max() > 0.1
    late, keep = 2, np.exp(-2.0 * np.pi * 200.0 * 5e-4)
    lagged = np.empty_like(true)
    state = 0.0
    for k, value in enumerate(true):
        lagged[k] = state = value + keep * (state - value)
    apart = shown[late:] - lagged[:-late]
    assert np.std(apart) == pytest.approx(np.hypot(1e-3, 1e-3 / 2 / np.sqrt(12)), rel=0.1)
    assert abs(np.mean(apart)) < 2e-4
    plain = simulate(bench(), engine="python")
    same = [name for name in run.columns if name in plain.columns]
    for name in same:  # it is recorded, and no coupling here uses it
        np.testing.assert_array_equal(run[name], plain[name])


def test_a_sensor_between_hand_and_lever_does_not_show_the_hands_own_inertia() -> None:
    run = simulate(bench("master.axes.lever.effort_sensor={}"), engine="python")
    mass = 0.143 * 0.075**2
    bent = np.diff(run["true.master.lever.velocity"]) / 5e-4
    grip = run["true.master.lever.hand_effort"]
    shown = run["master.lever.measured_effort"]
    np.testing.assert_allclose(shown[1:], grip[1:] - mass * bent, atol=1e-12)
    assert np.std(shown - grip) > 1e-3


def test_a_belief_that_is_wrong_leaves_its_share() -> None:
    truth = f"simulation.axes.slave.lever.effort_sensor={TRUE}"
    run = simulate(bench(f"{SLAVE}={{scale: 1, offset: 0.02}}", truth), engine="python")
    right = simulate(bench(f"{SLAVE}={TRUE}"), engine="python")
    np.testing.assert_allclose(
        run["slave.lever.measured_effort"],
        2.0 * right["slave.lever.measured_effort"] + 0.03,
        atol=1e-12,
    )


def test_its_step_answer_is_that_of_a_first_order_filter() -> None:
    p = SensorParams(0.0, 0.9, 0, 2.0, 0.1, 0.0, 0.01)
    state = 0.0
    for _ in range(10):
        state = follow_effort(p, state, 1.0)
    assert state == pytest.approx(1.0 - 0.9**10)
    assert sensor_reading(p, state, 0.0) == pytest.approx(2.0 * state + 0.1, abs=0.005)


NODE = "buses.can.options.nodes"
LEAN = (f"{NODE}.1.mapping=lean",)
INPUT = f"{NODE}.1.effort_sensor={{effort: -1.0e-4, zero: 300}}"


def drives(*changes: str) -> Rig:
    return load_rig(CAN, ["duration_s=0.3", FASTER, *changes])


def test_an_analogue_input_of_a_drive_shows_the_effort_in_its_counts() -> None:
    run = run_rig(drives(*LEAN, INPUT, f"{SLAVE}={{}}"))
    shown = run["slave.lever.measured_effort"]
    true = run["true.slave.lever.environment_effort"]
    assert np.abs(true).max() > 0.1
    moving = slice(30, -30)
    np.testing.assert_allclose(shown[moving], true[moving], atol=0.5001e-4)


def test_torques_that_a_drive_reports_are_recorded() -> None:
    run = run_rig(drives(*LEAN, f"{NODE}.1.report_torque=true"))
    motor = run["slave.lever.motor_effort"][30:-30]
    sent = run["slave.lever.commanded"][30:-30]
    np.testing.assert_allclose(motor[1:], sent[:-1], atol=0.5001e-3)
    assert np.abs(motor).max() > 0.05


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ((INPUT, f"{SLAVE}={{}}"), "room for it only with mapping: lean"),
        ((*LEAN, INPUT, f"{NODE}.1.report_torque=true", f"{SLAVE}={{}}"), "room for one of both"),
        ((f"{SLAVE}={{}}",), "node 2 does not define it; add effort_sensor: {index: 0x6401"),
        ((*LEAN, INPUT), "slave.lever has none; add effort_sensor: {} to the axis"),
    ],
)
def test_a_drive_that_cannot_report_it_is_refused(changes: tuple[str, ...], said: str) -> None:
    with pytest.raises(ConfigError) as found:
        drives(*changes)
    assert said in str(found.value)


def test_a_servo_reports_its_motor_and_no_outside_effort() -> None:
    servos = CONFIGS / "bench-dynamixel-sim.yaml"
    run = run_rig(load_rig(servos, ["duration_s=1.0"]))
    names = [name for name in run.columns if name.endswith(".motor_effort")]
    assert names
    assert np.nanmax(np.abs(run[names[0]])) > 0.0
    side, name, _ = names[0].split(".")
    with pytest.raises(ConfigError, match="no effort from outside; remove effort_sensor"):
        load_rig(servos, [f"{side}.axes.{name}.effort_sensor={{}}"])


def test_a_register_shows_the_effort_in_its_counts(tmp_path: Path) -> None:
    shipped = Path(tautwave_drivers.modbus.__file__).with_name("profiles") / "generic.yaml"
    text = shipped.read_text().replace(
        "  torque:          {address: 8,",
        "  force:           {address: 9, type: i16, access: r}\n  torque:          {address: 8,",
    )
    (tmp_path / "own.yaml").write_text(text)
    device = "buses.arm.options.devices.0"
    rig = load_rig(
        CONFIGS / "bench-modbus-tcp-sim.yaml",
        [
            f"{device}.profile={tmp_path / 'own.yaml'}",
            f"{device}.effort_sensor={{register: force, effort: 2.0e-4, zero: -50}}",
            f"{device}.report_torque=true",
            f"{SLAVE}={{}}",
            "duration_s=1.5",
            TOUCHED,
        ],
    )
    run = run_rig(rig)
    shown = run["slave.lever.measured_effort"]
    true = run["true.slave.lever.environment_effort"]
    read = np.flatnonzero(np.diff(shown))[3:-3] + 1  # a slow bus: in these slots it is fresh
    assert np.abs(true).max() > 0.05
    late = min(
        np.abs(shown[read] - true[read - lag]).max() for lag in range(12)
    )  # a sample is of the slot its request came in
    assert late < 2e-4
    assert np.nanmax(np.abs(run["slave.lever.motor_effort"])) > 0.02


def test_a_master_is_fed_what_the_slave_measures() -> None:
    law = "{law: position_force, pairs: {lever: {effort: %s, stiffness: 8.0, damping: 0.09}}}"
    runs = {
        kind: simulate(bench(f"coupling={law % kind}", f"{SLAVE}={{}}"), engine="python")
        for kind in ("measured", "observed")
    }
    run = runs["measured"]
    np.testing.assert_array_equal(
        run["slave.lever.believed_effort"], run["slave.lever.measured_effort"]
    )
    np.testing.assert_array_equal(
        run["slave.lever.measured_effort"][1:-400],
        run["true.slave.lever.environment_effort"][1:-400],
    )
    pushed = run["true.slave.lever.environment_effort"]
    assert np.abs(pushed).max() > 0.02
    held = runs["observed"]["slave.lever.believed_effort"]
    assert np.sign(np.mean(held)) == np.sign(np.mean(pushed))
    with pytest.raises(ConfigError, match="the slave has no effort_sensor"):
        simulate(bench(f"coupling={law % 'measured'}"), engine="python")
