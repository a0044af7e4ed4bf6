"""Counts to SI and back, over whole ranges, and drive by drive from their public documents."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tautwave.errors import ConfigError
from tautwave.models.encoder import quantise
from tautwave_drivers.cia402.si_units import is_length, position_unit, unit_text, velocity_unit
from tautwave_drivers.cia402.units import (
    INT16,
    INT32,
    MICRO,
    MILLI,
    AxisScale,
    Transmission,
    axis_scale,
    limit_counts,
    to_counts,
)

GEARS = st.builds(Transmission, st.integers(1, 5000), st.integers(1, 200), st.just(0.0), st.just(1))
SCREWS = st.builds(
    Transmission,
    st.integers(1, 50),
    st.integers(1, 50),
    st.floats(1e-5, 0.5),
    st.integers(1, 7),
)
SCALES = st.builds(
    axis_scale,
    st.one_of(GEARS, SCREWS),
    st.integers(1, 2**24),
    st.floats(1e-4, 500.0),
    encoder_revolutions=st.integers(1, 9),
    velocity_quantum=st.just(0.0),
)


def test_effort_round_trip_over_the_whole_16_bit_range() -> None:
    quantum = axis_scale(Transmission(23, 1), 4096, 0.533).effort_quantum
    for counts in range(-INT16, INT16 + 1):
        assert to_counts(counts * quantum, quantum, INT16) == counts


@given(scale=SCALES, counts=st.integers(-INT32, INT32))
def test_position_and_velocity_round_trip(scale: AxisScale, counts: int) -> None:
    for quantum in (scale.encoder_quantum, scale.velocity_quantum):
        assert to_counts(counts * quantum, quantum, INT32) == counts


@given(scale=SCALES, share=st.floats(-1.0, 1.0))
def test_what_is_sent_is_what_quantise_says_bit_for_bit(scale: AxisScale, share: float) -> None:
    for quantum, greatest in (
        (scale.effort_quantum, INT16),
        (scale.velocity_quantum, INT32),
        (scale.encoder_quantum, INT32),
    ):
        value = share * greatest * quantum
        assert to_counts(value, quantum, greatest) * quantum == quantise(value, quantum)


@given(quantum=st.floats(1e-9, 1e3), half=st.integers(-30000, 30000))
def test_halves_go_up_as_in_quantise(quantum: float, half: int) -> None:
    value = (half + 0.5) * quantum
    assert to_counts(value, quantum, INT16) * quantum == quantise(value, quantum)


@given(st.floats(), st.floats(1e-9, 1e6), st.integers(0, INT16))
@example(math.nan, 1e-3, 1000)
@example(-math.inf, 1e-3, 1000)
def test_any_float_gives_a_count_within_its_limit(value: float, quantum: float, most: int) -> None:
    counts = to_counts(value, quantum, most)
    assert -most <= counts <= most
    if not math.isfinite(value):
        assert counts == 0
    elif abs(value) / quantum > most + 1:
        assert counts == math.copysign(most, value)


@given(st.floats(0.0, 1e4), st.floats(1e-6, 1e3))
def test_a_limit_in_counts_never_exceeds_the_limit(limit: float, quantum: float) -> None:
    counts = limit_counts(limit, quantum)
    assert 0 <= counts <= INT16
    assert counts * quantum <= limit
    assert counts == INT16 or (counts + 1) * quantum > limit


@given(st.integers(1, INT16 - 1), st.floats(1e-6, 1e3))
def test_a_limit_beside_a_count_is_on_the_right_side(count: int, quantum: float) -> None:
    at = count * quantum
    assert limit_counts(at, quantum) == count
    assert limit_counts(math.nextafter(at, 0.0), quantum) == count - 1


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_no_number_is_no_effort(value: float) -> None:
    assert to_counts(value, 1e-3, INT16) == 0


def test_no_limit_is_no_effort() -> None:
    assert limit_counts(math.nan, 0.1) == 0
    assert limit_counts(-1.0, 0.1) == 0
    assert limit_counts(math.inf, 0.1) == INT16


@given(st.one_of(GEARS, SCREWS), st.floats(1e-3, 100.0), st.floats(-100.0, 100.0))
def test_power_is_the_same_at_motor_and_axis(
    transmission: Transmission, rated: float, rate: float
) -> None:
    # 1000 per mille at `rate` motor turns a second: torque times 2 pi rate on both sides.
    scale = axis_scale(transmission, 4096, rated)
    motor = rated * math.tau * rate
    axis = 1000 * scale.effort_quantum * transmission.travel * rate
    assert axis == pytest.approx(motor, rel=1e-12)


def test_wrong_numbers_are_reported_all_at_once() -> None:
    with pytest.raises(ConfigError) as caught:
        axis_scale(Transmission(0, 1, -1.0), 0, math.nan)
    assert len(caught.value.problems) == 4
    assert "6091:01" in caught.value.problems[1]


def test_cia_402_rated_torque_in_mnm() -> None:
    # CiA 402-2 6076h, and Elmo, CANopen DSP 402 Implementation Guide (MAN-CAN402IG 1.2), p. 106:
    # multiples of mN m, all torque data relative to it in thousandths.
    scale = axis_scale(Transmission(), 8192, 1270 * MILLI)
    assert 1000 * scale.effort_quantum == pytest.approx(1.27)
    assert to_counts(-0.127, scale.effort_quantum, INT16) == -100


def test_a_drive_with_rated_torque_in_micro_nm_and_a_planetary_gear() -> None:
    # The unit that maxon gives 6076h of an EPOS4; gear 4554:130, encoder of 1024 lines (x4).
    scale = axis_scale(Transmission(4554, 130), 4096, 533_000 * MICRO)
    ratio = Fraction(4554, 130)
    assert 1000 * scale.effort_quantum == pytest.approx(float(Fraction(533, 1000) * ratio))
    assert 4096 * 4554 * scale.encoder_quantum == pytest.approx(130 * math.tau)


def test_elmo_counts_per_second() -> None:
    # Elmo, MAN-CAN402IG 1.2: 608Fh increments per motor turns (p. 44), 6090h (p. 45), and 6094h
    # velocity units to increments per second (p. 47); 1 for all of them by default.
    scale = axis_scale(Transmission(), 8192, 1.0)
    assert 8192 * scale.velocity_quantum == pytest.approx(math.tau)


def test_kinco_velocity_golden_message() -> None:
    # Kinco FD5P manual, p. 137: DEC = rpm * 512 * resolution / 1875; its example for a motor of
    # 65536 counts writes 60FFh as 7E B1 E4 FF and 6081h as 03 9D 36 00: -100 and 200 rpm.
    encoder_quantum = math.tau / 65536
    quantum = encoder_quantum * 1000 / 16384  # velocity * 1000 / 16384 is in increments a second
    assert quantum == pytest.approx(math.tau / 60.0 * 1875 / (512 * 65536))
    scale = AxisScale(encoder_quantum, quantum, 1.0)
    sent = to_counts(-100.0 * math.tau / 60.0, scale.velocity_quantum, INT32)
    assert sent.to_bytes(4, "little", signed=True) == bytes.fromhex("7e b1 e4 ff")
    profile = int.from_bytes(bytes.fromhex("03 9d 36 00"), "little")
    assert profile * scale.velocity_quantum == pytest.approx(200.0 * math.tau / 60.0, rel=1e-6)


def test_beckhoff_linear_axis() -> None:
    # Beckhoff TF5200, "Settings of position scaling", example 1: 2**20 increments a turn, gear
    # 2:1, spindle of 20 mm.
    scale = axis_scale(Transmission(2, 1, 0.020), 2**20, 1.0)
    assert 2 * 2**20 * scale.encoder_quantum == pytest.approx(0.020)
    # Work of one driving shaft turn: 2 * 2 pi * 1 N m over 20 mm.
    assert 1000 * scale.effort_quantum == pytest.approx(2 * math.tau / 0.020)


@pytest.mark.parametrize(
    ("word", "rpm"),
    [(0x00B44700, 1.0), (0xFFB44700, 0.1), (0xFEB44700, 0.01), (0xFDB44700, 0.001)],
)
def test_synapticon_velocity_unit_words(word: int, rpm: float) -> None:
    # Synapticon, object 60A9h, "SI unit velocity": the four words it lists.
    assert velocity_unit(word) == pytest.approx(rpm * math.tau / 60.0)


def test_nanotec_unit_words() -> None:
    # Nanotec PD4-C manual, "User-defined units": codes of 60A8h and 60A9h.
    assert position_unit(0xFF410000) == pytest.approx(math.radians(0.1))
    assert position_unit(0xFD010000) == pytest.approx(0.001)
    assert position_unit(0x00B40000) == math.tau
    assert position_unit(0x00B50000) is None  # encoder increments: by 608Fh
    assert velocity_unit(0x00B40300) == math.tau
    assert velocity_unit(0x00B49900) is None
    assert [is_length(word) for word in (0xFD010300, 0x00B44700)] == [True, False]
    assert unit_text(0xFDB44700) == "10**-3 rev/min"
    assert unit_text(0x00B50000) == "increments"


@pytest.mark.parametrize(
    ("word", "value", "text"),
    [
        (0x00B40300, math.tau, "rev/s"),
        (0x00B44700, math.tau / 60.0, "rev/min"),
        (0x00B44800, math.tau / 3600.0, "rev/h"),
        (0xFD410300, 1e-3 * math.tau / 360.0, "10**-3 deg/s"),
        (0xFD010300, 1e-3, "10**-3 m/s"),
        (0x00C14700, 0.0254 / 60.0, "in/min"),
        (0x00C24800, 0.3048 / 3600.0, "ft/h"),
    ],
)
def test_units_of_velocity_are_lengths_or_angles_by_second_minute_and_hour(
    word: int, value: float, text: str
) -> None:
    assert velocity_unit(word) == pytest.approx(value)
    assert unit_text(word) == text
