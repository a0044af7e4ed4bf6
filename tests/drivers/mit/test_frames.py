"""Frames and codes against vectors of public clients, and their arithmetic."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.contracts import AxisSpec
from tautwave_drivers.mit import damiao
from tautwave_drivers.mit.axis import Axis
from tautwave_drivers.mit.options import Motor, Scale, scale_of

KEYS = {"id": 1, "feedback_id": 17, "p_max": 12.5, "v_max": 30.0, "t_max": 10.0}


def scale(**more: object) -> Scale:
    return scale_of(Motor(**{**KEYS, **more}))  # type: ignore[arg-type]


def test_all_zero_is_what_rounding_clients_send() -> None:
    # damiao-motor 1.0.6, rounded: neither spring nor damper, and the upper code beside zero torque
    assert damiao.command(0x800).hex() == "8000800000000800"
    assert damiao.command(0xA66).hex()[-3:] == "a66"


def test_timeout_of_100_ms_as_damiao_motor_writes_it() -> None:
    # damiao-motor 1.0.6: id 7FF 01005509d0070000, 2000 counts
    assert damiao.write_register(1, damiao.TIMEOUT, 2000).hex() == "01005509d0070000"


def test_torque_of_3_newton_metres_is_the_rounded_code() -> None:
    assert scale().coder(10.0)(3.0, True) in (0xA65, 0xA66)  # truncated, rounded


def test_a_command_is_enabled_feedback_of_its_nibble_only() -> None:
    data = bytes.fromhex("11 8000 80 08 00 1e 19")
    found = damiao.feedback(data, 1)
    assert found == damiao.Feedback(1, 0x8000, 0x800, 0x800, 30, 25)
    assert damiao.feedback(data, 2) is None
    assert damiao.feedback(data[:7], 1) is None


@pytest.mark.parametrize(
    "text",
    [
        "0100550a01000000",  # echo of a write to CTRL_MODE: -12.47 rad as feedback
        "0100cc0000000000",  # another master asks for feedback: -12.42 rad
        "0100331500004841",  # an answer about PMAX
        "1100550900000000",  # of motor 11h, whose first byte looks like "enabled"
    ],
)
def test_what_is_about_a_register_is_never_feedback(text: str) -> None:
    data = bytes.fromhex(text)
    assert damiao.feedback(data, data[0]) is None


@given(st.floats(-1.0, 1.0), st.booleans(), st.sampled_from([1, -1]))
def test_a_code_is_off_by_at_most_its_step(effort: float, upper: bool, direction: int) -> None:
    one = scale(direction=direction)
    found = one.torque_of(one.coder(1.0)(effort, upper))
    assert abs(found - effort) <= 0.7501 * one.torque


@given(st.integers(-200, 200), st.sampled_from([1, -1]))
def test_what_alternates_has_the_commanded_step_as_its_mean(steps: int, direction: int) -> None:
    one = scale(direction=direction)
    effort = steps * one.torque
    pair = [one.torque_of(one.coder(10.0)(effort, upper)) for upper in (True, False)]
    assert math.isclose(sum(pair) / 2.0, effort, abs_tol=1e-12)
    assert abs(pair[0] - pair[1]) == pytest.approx(one.torque)


@pytest.mark.parametrize("wild", [math.nan, math.inf, -math.inf, 1e300, -50.0])
def test_no_wild_number_reaches_a_motor(wild: float) -> None:
    one = scale()
    found = one.torque_of(one.coder(2.0)(wild, True))
    assert abs(found) <= 2.0 + one.torque
    if math.isnan(wild):
        assert abs(found) <= one.torque


@given(st.binary(min_size=8, max_size=8), st.sampled_from([1, -1]), st.floats(-1.0, 1.0))
def test_an_axis_reads_a_frame_as_the_manual_has_it(
    data: bytes, direction: int, zero: float
) -> None:
    motor = Motor(**{**KEYS, "id": data[0] & 0xF or 16, "direction": direction, "zero": zero})  # type: ignore[arg-type]
    axis = Axis(AxisSpec("a", motor.id, "rotary", "impedance", 1.0), motor, 1e-3)
    said = damiao.feedback(data, motor.id)
    assert axis.take(data, 7) == (said is not None)
    if said is not None:
        one = scale_of(motor)
        assert (axis.state, axis.arrived_ns) == (said.state, 7)
        assert axis.position == pytest.approx(one.position_of(said.position), abs=1e-12)
        assert axis.velocity == pytest.approx(one.velocity_of(said.velocity), abs=1e-12)
        assert axis.torque == pytest.approx(one.torque_of(said.torque), abs=1e-12)


@given(st.binary(max_size=12), st.integers(0, 0x7FF))
def test_bytes_never_raise(data: bytes, number: int) -> None:
    damiao.feedback(data, number)
    damiao.register_value(data, number, damiao.P_MAX)
