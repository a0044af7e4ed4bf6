"""Modes of operation on an impedance axis and on a servo: what is asked for is what moves."""

from __future__ import annotations

import math

import pytest

from tests.sim.canopen.master import COUNTS, RATED, SPEED_MAP, TORQUE_MAP, Master, SdoRefusal

PP, PV, PT, HM, CSP, CSV, CST = 1, 3, 4, 6, 8, 9, 10
STEP = 2 * math.pi / COUNTS
MASS = 0.5
POSITION_MAP = ((0x60400010, 0x607A0020), TORQUE_MAP[1])


def node_in(mode: int, maps: object = TORQUE_MAP, **keys: object) -> Master:
    keys.setdefault("limit", 10.0)
    node = Master((1,), **keys)  # type: ignore[arg-type]
    node.bring_up(mode, maps)
    return node


def run(node: Master, target: int, cycles: int, word: int = 0x0F, size: int = 4) -> None:
    for _ in range(cycles):
        node.cycle(word, target.to_bytes(size, "little", signed=True))


def test_torque_moves_the_mass_by_newton() -> None:
    node = node_in(CST)
    for _ in range(101):
        node.torque(250)
    motor = node.device().drive.motor
    # 101 SYNCs: it acts for 100 whole slots, which began with the first of them
    assert motor.velocity() == pytest.approx(0.25 * RATED / MASS * 0.1)
    assert node.read(1, 0x6077, signed=True) == 250
    assert node.read(1, 0x6064, signed=True) == pytest.approx(motor.position() / STEP, abs=0.5)
    assert node.read(1, 0x606C, signed=True) == pytest.approx(motor.velocity() / STEP, abs=0.5)


def test_offset_limit_and_halt_of_torque() -> None:
    node = node_in(CST)
    node.write(1, 0x60B2, 0, 100, 2)
    node.torque(50)
    assert node.device().drive.motor.torque_counts == 150
    node.write(1, 0x6072, 0, 120, 2)
    status = int.from_bytes(node.torque(50)[1][:2], "little")
    assert node.device().drive.motor.torque_counts == 120
    assert status & 0x0800  # internal limit
    node.torque(-500)
    assert node.device().drive.motor.torque_counts == -120
    node.torque(50, 0x010F)
    assert node.device().drive.motor.torque_counts == 0


def test_a_truth_that_is_weaker_than_the_drive_says_limits() -> None:
    node = node_in(CST, limit=0.5)
    for _ in range(101):
        node.torque(1000)
    assert node.device().drive.motor.velocity() == pytest.approx(0.5 / MASS * 0.1)


def test_profile_torque_follows_its_slope() -> None:
    node = node_in(PT)
    node.write(1, 0x6087, 0, 1000, 4)  # per mille per second: 1 in a slot
    reported = []
    for _ in range(8):
        node.torque(5)
        reported.append(node.device().drive.motor.torque_counts)
    assert reported == [1, 2, 3, 4, 5, 5, 5, 5]


@pytest.mark.parametrize("servo", [False, True], ids=["impedance", "servo"])
@pytest.mark.parametrize("mode", [PV, CSV])
def test_speed_is_reached_and_kept(mode: int, servo: bool) -> None:
    node = node_in(mode, SPEED_MAP, servo=servo)
    run(node, 2000, 300)
    assert node.read(1, 0x606C, signed=True) == pytest.approx(2000, abs=20)
    status = node.read(1, 0x6041)
    assert bool(status & 0x400) == (mode == PV)
    run(node, 0, 400)
    assert abs(node.read(1, 0x606C, signed=True)) <= 20


def test_the_velocity_offset_is_added_in_the_cyclic_mode_only() -> None:
    for mode, speed in ((CSV, 2500), (PV, 2000)):
        node = node_in(mode, SPEED_MAP, servo=True)
        node.write(1, 0x60B1, 0, 500, 4)
        run(node, 2000, 300)
        assert node.read(1, 0x606C, signed=True) == pytest.approx(speed, abs=2)


def test_profile_velocity_ramps() -> None:
    node = node_in(PV, SPEED_MAP)
    node.write(1, 0x6083, 0, 20_000, 4)
    run(node, 2000, 51)
    assert node.device().drive.control.demand.velocity == pytest.approx(1020 * STEP)


@pytest.mark.parametrize("servo", [False, True], ids=["impedance", "servo"])
def test_cyclic_position_follows_a_ramp(servo: bool) -> None:
    node = node_in(CSP, POSITION_MAP, servo=servo, mass=0.005)
    for count in range(0, 2000, 4):
        run(node, count, 1)
    assert node.read(1, 0x6064, signed=True) == pytest.approx(1996, abs=40)
    run(node, 1996, 500)
    assert node.read(1, 0x6064, signed=True) == pytest.approx(1996, abs=2)


@pytest.mark.sparse(2)
@pytest.mark.parametrize("servo", [False, True], ids=["impedance", "servo"])
def test_profile_position_goes_there_and_tells(servo: bool) -> None:
    node = node_in(PP, POSITION_MAP, servo=servo, mass=0.005)
    node.write(1, 0x6081, 0, 4000, 4)
    run(node, 1500, 1, 0x1F)
    assert node.read(1, 0x6041) & 0x1400 == 0x1000  # acknowledged, not reached
    run(node, 1500, 200)
    speed = node.read(1, 0x606C, signed=True)
    assert 500 < speed <= 4100
    run(node, 1500, 800)
    assert node.read(1, 0x6064, signed=True) == pytest.approx(1500, abs=10)
    assert node.read(1, 0x6041) & 0x1400 == 0x0400
    run(node, -500, 1, 0x5F)  # relative
    run(node, -500, 1000)
    assert node.read(1, 0x6064, signed=True) == pytest.approx(1000, abs=10)


def test_homing_makes_here_home() -> None:
    node = node_in(CST)
    for _ in range(100):
        node.torque(100)
    node.write(1, 0x607C, 0, 77, 4)
    node.write(1, 0x6060, 0, HM, 1)
    node.torque(0)
    assert node.read(1, 0x6041) & 0x3400 == 0
    node.torque(0, 0x1F)
    assert node.read(1, 0x6041) & 0x3400 == 0x1400
    assert node.read(1, 0x6064, signed=True) == pytest.approx(77, abs=30)
    with pytest.raises(SdoRefusal, match="06090030"):
        node.write(1, 0x6098, 0, 17, 1)


@pytest.mark.parametrize("option", [1, 2])
def test_quick_stop_brakes_by_its_ramp_in_a_torque_mode_too(option: int) -> None:
    node = node_in(CST, mass=0.05)
    node.write(1, 0x605A, 0, option, 2)
    node.write(1, 0x6084, 0, 1000, 4)
    node.write(1, 0x6085, 0, 10_000, 4)
    for _ in range(100):
        node.torque(50)
    speed = node.device().drive.motor.velocity() / STEP
    slots = 0
    node.torque(0, 0x02)
    while node.state() == "QUICK_STOP":
        node.torque(0, 0x02)
        slots += 1
    assert node.state() == "SWITCH_ON_DISABLED"
    assert slots == pytest.approx(speed / {1: 1, 2: 10}[option], abs=3)
    assert abs(node.device().drive.motor.velocity() / STEP) < 15
    assert node.device().drive.motor.torque_counts == 0


@pytest.mark.sparse(4)
@pytest.mark.parametrize("mode", [PV, PP])
@pytest.mark.parametrize(("option", "step"), [(1, 1000), (2, 20_000)])
def test_halt_brakes_as_605d_says(mode: int, option: int, step: int) -> None:
    node = node_in(mode, SPEED_MAP if mode == PV else POSITION_MAP, mass=0.005)
    for index, value in ((0x6084, 1000), (0x6085, 20_000), (0x6081, 2000)):
        node.write(1, index, 0, value, 4)
    node.write(1, 0x605D, 0, option, 2)
    target = 2000 if mode == PV else 1_000_000
    run(node, target, 1, 0x1F)
    run(node, target, 300)
    before = node.device().drive.control.demand.velocity / STEP
    assert before == pytest.approx(2000)
    run(node, target, 10, 0x10F)
    assert node.device().drive.control.demand.velocity / STEP == pytest.approx(2000 - step / 100)
    run(node, target, 3000 if option == 1 else 200, 0x10F)
    assert node.device().drive.control.demand.velocity == 0.0
    assert abs(node.device().drive.motor.velocity()) < 3 * STEP


def test_without_power_an_axis_moves_freely() -> None:
    node = node_in(CST)
    for _ in range(100):
        node.torque(100)
    node.torque(100, 0x06)
    speed = node.device().drive.motor.velocity()
    here = node.device().drive.motor.position()
    for _ in range(100):
        node.torque(100, 0x06)
    assert node.device().drive.motor.velocity() == speed
    assert node.device().drive.motor.position() == pytest.approx(here + 0.1 * speed)


def test_an_axis_stands_until_it_is_enabled_and_slot_0_is_the_sync_after_its_report() -> None:
    reference = [0.001 * slot for slot in range(1000)]
    node = Master((1,), reference=reference, grip=(50.0, 0.1))
    node.wait()
    node.map(1)
    node.write(1, 0x6060, 0, CST, 1)
    node.send("000#0101")
    axis = node.world.axes[0]
    for word in (6, 7, 15):
        response = node.torque(0, word)
        node.wait(50_000_000)
        assert (axis.physics.x, axis.hand()[0]) == (0.0, 0.0)
    assert response[1][0] & 0x6F == 0x27
    for slot in range(3):
        node.torque(0)
        assert axis.hand()[0] == reference[slot]


def test_all_wait_for_the_slowest_drive() -> None:
    node = Master((1, 2), quirks={"transition_ms": 5}, reference=[0.1] * 99, grip=(50.0, 0.1))
    node.bring_up()
    while node.state(1) != "ENABLED":
        node.torque(500)
        assert [axis.physics.x for axis in node.world.axes] == [0.0, 0.0]
    for _ in range(3):
        node.torque(0)
    assert all(axis.physics.x > 0.0 for axis in node.world.axes)


def test_looking_before_it_moves_spends_no_random_number() -> None:
    def reported(looks: int) -> list[dict[int, bytes]]:
        node = Master((1,), noise=1e-2)
        node.wait()
        for _ in range(looks):
            assert node.read(1, 0x6064) == 0
        node.bring_up()
        return [node.torque(0) for _ in range(5)]

    assert reported(0) == reported(3)


def test_a_lost_sync_lets_the_old_command_act_and_time_go_on() -> None:
    node = node_in(CST)
    node.torque(100)
    node.wait(7_000_000)
    node.torque(0)
    motor = node.device().drive.motor
    assert motor.velocity() == pytest.approx(0.1 * RATED / MASS * 8e-3)


@pytest.mark.parametrize(("early_us", "slots"), [(0, 6), (300, 6), (-300, 6), (600, 5), (-600, 7)])
def test_a_sync_latches_the_slot_it_is_nearest_to(early_us: int, slots: int) -> None:
    node = node_in(CST, reference=[0.001 * slot for slot in range(100)], grip=(1.0, 0.0))
    node.torque(0)  # slot 1: slot 0 was the last SYNC of the bring-up
    node.wait(4_000_000 - 1000 * early_us)
    node.torque(0)
    assert node.world.axes[0].hand()[0] == pytest.approx(0.001 * slots)


def test_a_mode_that_does_not_exist_is_refused() -> None:
    node = node_in(CST)
    for mode in (2, 7, 11, -1):
        with pytest.raises(SdoRefusal, match="06090030"):
            node.write(1, 0x6060, 0, mode, 1)
    assert node.read(1, 0x6061) == CST


def test_with_halt_set_the_mode_stays() -> None:
    node = node_in(CST)
    node.torque(0, 0x010F)
    node.write(1, 0x6060, 0, CSV, 1)
    node.torque(0, 0x010F)
    assert node.read(1, 0x6061) == CST
    node.torque(0)
    assert node.read(1, 0x6061) == CSV


def test_a_servo_measures_the_torque_against_what_pulls_it() -> None:
    node = node_in(CSV, SPEED_MAP, servo=True, reference=[0.1] * 50, grip=(5.0, 0.0))
    data = node.cycle(0x0F, bytes(4))[1]
    torque = int.from_bytes(data[6:8], "little", signed=True)
    # the hand pulls with 0.5 N m, the motor holds against it: 250 per mille of 2 N m
    assert torque == -250


def test_the_following_error_is_a_fault_if_asked_for() -> None:
    node = node_in(CSP, POSITION_MAP)
    node.write(1, 0x6065, 0, 100, 4)
    node.write(1, 0x6066, 0, 5, 2)
    node.write(1, 0x6072, 0, 1, 2)  # too weak to follow
    for count in range(0, 1000, 10):
        run(node, count, 1)
    assert node.emergencies() == [0x8611]
    run(node, 1000, 400)
    assert node.state() == "FAULT"


def test_a_change_of_mode_takes_over_where_the_motor_is() -> None:
    """Without a new set-point profile position stands there, not where the drive was enabled."""
    node = node_in(CST)
    for _ in range(300):
        node.torque(250)
    node.write(1, 0x6060, 0, PP, 1)
    left = node.read(1, 0x6064, signed=True)
    assert left > 5
    for _ in range(300):
        node.torque(0)
    assert node.read(1, 0x6061, signed=True) == PP
    assert node.read(1, 0x6064, signed=True) >= left
    assert abs(node.read(1, 0x606C, signed=True)) <= 1
