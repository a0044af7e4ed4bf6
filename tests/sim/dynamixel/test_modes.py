"""The motor: each operating mode does what it is for, and the registers say so."""

from __future__ import annotations

import itertools
import math

import pytest

from tests.sim.dynamixel.line import STEP, Host


def on(mode: int, model: str = "XM430-W350", **options: object) -> Host:
    host = Host((1,), model, **options)  # type: ignore[arg-type]
    host.write(1, "Operating Mode", mode)
    if mode == 0:
        host.write(1, "Goal Current", 0)
    host.write(1, "Torque Enable", 1)
    return host


@pytest.mark.parametrize("mode", [3, 4, 5])
def test_position_modes_arrive_and_stay(mode: int) -> None:
    host = on(mode)
    assert host.read(1, "Goal Position") == 2048  # where it was
    host.write(1, "Goal Position", 3000)
    host.pass_time(0.1)
    assert host.read(1, "Moving") == 1
    assert host.read(1, "Moving Status") & 1 == 0
    assert 2048 < host.read(1, "Present Position") < 3000
    host.pass_time(1.5)
    assert host.read(1, "Present Position") == pytest.approx(3000, abs=2)
    assert host.read(1, "Moving") == 0
    assert host.read(1, "Moving Status") & 1 == 1
    assert host.read(1, "Present Velocity") == 0


def test_extended_positions_go_over_many_turns() -> None:
    host = on(4)
    host.write(1, "Goal Position", -3 * 4096)
    host.pass_time(8.0)
    assert host.read(1, "Present Position") == pytest.approx(-3 * 4096, abs=2)


@pytest.mark.parametrize("speed", [60, -60])
def test_velocity_mode_holds_a_speed_against_friction(speed: int) -> None:
    host = on(1, truths={"viscous": 0.05})
    host.write(1, "Goal Velocity", speed)
    host.pass_time(1.0)
    assert host.read(1, "Present Velocity") == pytest.approx(speed, abs=1)
    turned = host.read(1, "Present Position") - 2048
    expected = speed * 0.229 * math.tau / 60.0 / STEP
    assert turned == pytest.approx(expected, rel=0.05)
    assert math.copysign(1, host.read(1, "Present Current")) == math.copysign(1, speed)


def test_current_is_torque_by_the_torque_constant() -> None:
    host = on(0, servos=[{"id": 1, "model": "XM430-W350", "torque_constant": 1.5}])
    host.write(1, "Goal Current", 40)
    host.pass_time(0.01)
    begin = host.servos[0].axis.physics.v
    host.pass_time(0.1)
    torque = 40 * 2.69e-3 * 1.5
    assert host.servos[0].motor.commanded == pytest.approx(torque)
    gained = host.servos[0].axis.physics.v - begin
    assert gained == pytest.approx(torque / 0.01 * 0.1, rel=1e-6)
    assert host.read(1, "Present Current") == 40


def test_it_is_back_drivable() -> None:
    """A hand moves a servo whose current is zero; nothing holds it."""
    reference = [0.001 * k for k in range(2000)]
    host = on(0, truths={"reference": reference, "grip": (5.0, 0.2)})
    host.pass_time(1.0)
    assert host.read(1, "Present Position") > 2048 + 500
    assert host.read(1, "Present Current") == 0


def test_direction_gear_and_zero_turn_and_scale() -> None:
    host = on(0, servos=[{"id": 1, "model": "XM430-W350", "direction": -1, "gear_ratio": 2.0}])
    host.write(1, "Goal Current", 20)
    host.pass_time(0.05)
    joint = host.servos[0].joint
    x = host.servos[0].axis.physics.x
    assert x < 0.0
    assert host.servos[0].motor.commanded == pytest.approx(-20 * 2.69e-3 * 4.1 / 2.3 * 2.0)
    assert joint.position == pytest.approx(STEP / 2.0)
    assert host.read(1, "Present Position") > 2048
    assert host.read(1, "Present Velocity") > 0


def test_pwm_mode_reaches_its_share_of_the_no_load_speed() -> None:
    host = on(16)
    host.write(1, "Goal PWM", 442)
    host.pass_time(2.0)
    no_load = 46.0 / 0.229
    assert host.read(1, "Present Velocity") == pytest.approx(0.5 * no_load, rel=0.05)
    assert host.read(1, "Present PWM") == pytest.approx(442, abs=30)


def test_current_based_position_is_soft() -> None:
    host = on(5, truths={"grip": (50.0, 1.0)})
    host.write(1, "Goal Current", 10)
    host.write(1, "Goal Position", 2048 + 1000)
    host.pass_time(1.0)
    limit = 10 * 2.69e-3 * 4.1 / 2.3
    assert host.servos[0].axis.physics.x == pytest.approx(limit / 50.0, rel=0.1)
    assert host.read(1, "Present Current") == pytest.approx(10, abs=1)


def test_a_profile_limits_velocity_and_acceleration() -> None:
    host = on(3)
    host.write(1, "Profile Velocity", 50)
    host.write(1, "Profile Acceleration", 10)
    host.write(1, "Goal Position", 4000)
    speeds = []
    for _ in range(150):
        host.pass_time(0.02)
        speeds.append(host.servos[0].motor.trajectory_velocity)
    fastest = 50 * 0.229 * math.tau / 60.0
    steepest = 10 * 214.577 * math.tau / 3600.0
    assert max(speeds) == pytest.approx(fastest, rel=1e-6)
    rises = [after - before for before, after in itertools.pairwise(speeds)]
    assert max(map(abs, rises)) <= steepest * 0.04 + 1e-9
    assert host.read(1, "Velocity Trajectory") == 0
    assert host.read(1, "Position Trajectory") == 4000


def test_load_servos_report_a_share_of_their_torque() -> None:
    host = on(1, "XL430-W250", truths={"grip": (200.0, 1.0)})
    host.write(1, "Goal Velocity", 30)
    host.pass_time(0.3)
    effort = host.servos[0].motor.commanded
    assert host.read(1, "Present Load") == pytest.approx(effort / 1.4 * 1000, abs=1)
    assert host.read(1, "Present Load") > 20


def test_an_admittance_axis_follows_and_reports_the_outside_effort() -> None:
    reference = [0.0] * 4000
    host = Host(
        (1,),
        causality="admittance",
        simulator={"factory": False},
        truths={"reference": reference, "grip": (5.0, 0.1)},
    )
    assert host.read(1, "Operating Mode") == 1
    host.write(1, "Torque Enable", 1)
    host.write(1, "Goal Velocity", 20)
    host.pass_time(0.5)
    physics = host.servos[0].axis.physics
    assert physics.v == pytest.approx(20 * 0.229 * math.tau / 60.0)
    outside = sum(physics.forces(0.0, 0.0))
    assert outside < 0.0
    quantum = 2.69e-3 * 4.1 / 2.3
    assert host.read(1, "Present Current") == pytest.approx(-outside / quantum, abs=1)


def test_the_tick_counts_milliseconds_and_wraps() -> None:
    host = Host((1,))
    before = host.read(1, "Realtime Tick")
    host.pass_time(1.0)
    assert host.read(1, "Realtime Tick") - before == pytest.approx(1004, abs=2)
    host.pass_time(32.0)
    assert host.read(1, "Realtime Tick") < 2000
