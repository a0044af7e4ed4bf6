"""The motors move in slots of the bus: to the bit what a command delay of one period makes."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tautwave.truth import AxisModel
from tautwave_sim.axis import SimulatedAxis
from tautwave_sim.modbus.drive import Drive
from tautwave_sim.modbus.options import DeviceKeys, Quirks
from tests.examples import tried
from tests.sim.modbus.masters import Bench, pair, read, read_write, signed, words, write_many
from tests.sim.truths import truth

PERIOD_NS = 20_000_000
COUNTS = 65536.0
QUANTUM = math.tau / COUNTS
STEP = 1e-3
"""Of torque: one per mille of 1 N m."""
DECIRPM = math.tau / 600.0


def slow(*, servo: bool = False, missing: float = 0.0) -> AxisModel:
    made = truth(
        servo=servo,
        quantum=QUANTUM,
        noise=3 * QUANTUM,
        effort_quantum=STEP,
        velocity_quantum=DECIRPM if servo else 0.0,
        grip=(30.0, 1.0),
        reference=[0.3 * math.sin(0.05 * k) for k in range(400)],
        missing=missing,
    )
    return made._replace(period=PERIOD_NS * 1e-9)


def expected(model: AxisModel, commands: list[float], slots: list[int]) -> list[float]:
    """Return the positions at these slots, a command written after slot k acting from k + 1 on."""
    axis = SimulatedAxis("reference", model)
    positions, at, reported = [], 0, 0.0
    for slot, command in zip(slots, commands, strict=True):
        while at < slot:
            axis.pass_slot()
            at += 1
        positions.append(axis.measure().position)
        axis.command(
            reported
        )  # what came with the exchange of this slot was written after the last
        reported = command
    return positions


def enabled(link: str, units: tuple[int, ...], model: AxisModel, **more: object) -> Bench:
    servo = model.servo is not None
    bench = Bench(
        link,
        units=units,
        truths=[model] * len(units),
        causality="admittance" if servo else "impedance",
        **more,  # type: ignore[arg-type]
    )
    for unit in units:
        bench.set("mode", 1 if servo else 2, unit)
        bench.set("control", 1, unit)
    return bench


COMMANDS = [round(500 * math.sin(0.9 * k)) for k in range(60)]


@pytest.mark.parametrize("link", ["tcp", "rtu"])
@pytest.mark.parametrize("servo", [False, True])
def test_to_the_bit_like_a_command_delay_of_one_period(link: str, servo: bool) -> None:
    model = slow(servo=servo)
    bench = enabled(link, (1, 2), model)
    begin = bench.clock.now_ns()
    seen: dict[int, list[float]] = {1: [], 2: []}
    reported = 0
    for k, command in enumerate(COMMANDS):
        bench.until(begin + k * PERIOD_NS)
        for unit in (1, 2):  # the second has its request in the middle of the cycle
            address, value = (19, pair(reported)) if servo else (18, (reported,))
            got = words(bench.ask(read_write(4, 2, address, *value), unit))
            seen[unit].append(signed(*got) * QUANTUM)
        reported = command
    quantum = DECIRPM if servo else STEP
    reference = expected(model, [c * quantum for c in COMMANDS], list(range(len(COMMANDS))))
    assert seen == {1: reference, 2: reference}


@settings(max_examples=tried(25))
@given(
    st.lists(st.integers(-45, 45), min_size=3, max_size=25),
    st.floats(0.0, 0.95),
    st.lists(st.booleans(), min_size=25, max_size=25),
)
def test_jitter_phase_and_left_out_cycles_move_nothing(
    jitter: list[int], phase: float, left_out: list[bool]
) -> None:
    model = slow()
    bench = enabled("tcp", (1, 2), model)
    begin = bench.clock.now_ns() + PERIOD_NS
    slots = [k for k in range(len(jitter)) if k == 0 or not left_out[k]]
    reported, got = 0, []
    second = []
    for k in slots:
        late = jitter[k] * PERIOD_NS // 100 if k else 0
        asked = begin + k * PERIOD_NS + late
        bench.until(max(asked, bench.clock.now_ns()))
        got.append(signed(*words(bench.ask(read_write(4, 2, 18, reported), 1))) * QUANTUM)
        bench.until(max(begin + k * PERIOD_NS + round(phase * PERIOD_NS), bench.clock.now_ns()))
        bench.ask(read_write(4, 2, 18, 0), 2)
        second.append(bench.drive(2).motor.axis._slot)
        reported = COMMANDS[k]
    reference = expected(model, [COMMANDS[k] * STEP for k in slots], slots)
    assert second == slots
    assert got == reference


@pytest.mark.parametrize("phase", [0.0, 0.4, 0.7, 0.95])
@pytest.mark.parametrize("late", [0.0, 0.3])
def test_what_is_read_after_a_command_is_of_its_slot(phase: float, late: float) -> None:
    model = slow()
    bench = enabled("tcp", (1,), model, device={"function_codes": [3, 16]})
    begin, reported, got = bench.clock.now_ns(), 0, []
    for k, command in enumerate(COMMANDS):
        asked = begin + round((k + (late if k else 0.0)) * PERIOD_NS)
        bench.until(asked)
        bench.ask(write_many(18, reported))
        bench.until(max(asked + round(phase * PERIOD_NS), bench.clock.now_ns()))
        got.append(signed(*words(bench.ask(read(4, 2)))) * QUANTUM)
        reported = command
    slots = list(range(len(COMMANDS)))
    assert got == expected(model, [c * STEP for c in COMMANDS], slots)


def test_until_the_first_command_somebody_holds_the_axis() -> None:
    bench = enabled("tcp", (1,), slow())
    for _ in range(10):
        bench.until(bench.clock.now_ns() + PERIOD_NS)
        bench.number("position")
    assert bench.drive().motor.axis._slot == 0
    bench.ask(read_write(4, 2, 18, 0))
    bench.until(bench.clock.now_ns() + PERIOD_NS)
    bench.number("position")
    assert bench.drive().motor.axis._slot == 1


def test_switched_off_and_on_again_it_is_held_anew() -> None:
    bench = enabled("tcp", (1,), slow())
    bench.ask(read_write(4, 2, 18, 100))
    bench.until(bench.clock.now_ns() + 5 * PERIOD_NS)
    bench.set("control", 0)
    assert bench.drive().motor.axis._slot == 5
    bench.until(bench.clock.now_ns() + 5 * PERIOD_NS)
    bench.set("control", 1)  # it coasted until now
    assert bench.drive().motor.axis._slot == 10
    bench.until(bench.clock.now_ns() + 7 * PERIOD_NS)
    bench.number("position")
    assert bench.drive().motor.axis._slot == 10
    bench.ask(read_write(4, 2, 18, 100))
    bench.until(bench.clock.now_ns() + 2 * PERIOD_NS)
    bench.number("position")
    assert bench.drive().motor.axis._slot == 12


def test_a_missing_sample_is_an_answer_that_does_not_come() -> None:
    model = slow(missing=0.3)
    bench = enabled("tcp", (1,), model)
    bench.patience_ns = 2_000_000
    reference = SimulatedAxis("reference", model)
    begin, reported = bench.clock.now_ns(), 0
    came = []
    for k, command in enumerate(COMMANDS):
        bench.until(begin + k * PERIOD_NS)
        came.append(bench.ask(read_write(4, 2, 18, reported)) is not None)
        assert bench.ask(read(2, 2)) is not None  # what is no sample comes
        if k:
            reference.pass_slot()
        assert came[-1] == reference.measure().valid
        reported = command
    assert 0 < came.count(False) < len(came)


def test_a_linear_axis_and_a_drive_that_counts_the_other_way() -> None:
    # The rig computed its step in another order: one count is that step all the same.
    model = truth(quantum=math.nextafter(0.01 / (4096.0 * 5.0), 1.0))
    device = {
        "counts_per_revolution": 4096.0,
        "gear_ratio": 5.0,
        "feed": 0.01,
        "direction": -1,
        "rated_torque": 0.5,
    }
    drive = Drive(DeviceKeys(unit=1, **device), Quirks(), "slave.x", "linear", model)  # type: ignore[arg-type]
    assert drive.motor.scale.position == model.encoder_quantum
    assert drive.motor.scale.effort == pytest.approx(0.5e-3 * 5.0 * math.tau / 0.01)
    drive.motor.free = True
    drive.motor.command(1000)
    for _ in range(100):
        drive.motor.pass_slot()
    drive.latch()
    assert drive.motor.axis.physics.x < 0
    assert drive.motor.position_counts > 0
    assert drive.motor.position_counts == -round(
        drive.motor.axis.measure().position / model.encoder_quantum
    )


def test_a_servo_tells_the_torque_it_holds_with() -> None:
    model = slow(servo=True)
    bench = enabled("tcp", (1,), model)
    bench.ask(read_write(4, 2, 19, 0, 0))
    for _ in range(20):
        bench.until(bench.clock.now_ns() + PERIOD_NS)
        got = bench.drive().bank.registers["torque"].decode(words(bench.ask(read(8))))
    outside = sum(bench.drive().motor.axis.physics.forces(*bench.drive().motor.axis.hand()))
    assert outside != 0.0
    assert got * STEP == pytest.approx(-outside, abs=STEP / 2)
