import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.report.units import (
    MISSING,
    THIN,
    count,
    microseconds,
    quantity,
    scale_for,
    share,
    within,
)


@pytest.mark.parametrize(
    ("value", "unit", "shown"),
    [
        (0.012345678, "rad", "12.35 mrad"),
        (0.9999999, "m", "1 m"),
        (1500.0, "rad", "1500 rad"),
        (2e-15, "J", "2 × 10⁻¹⁵ J"),
        (-3.2e-6, "N m", "−3.2 µN m"),
        (0.0, "J", "0 J"),
        (1000.0, "Hz", "1 kHz"),
        (6.0, "", "6"),
        (math.nan, "m", "undefined"),
        (None, "m", "not recorded"),
        ("broken", "m", "not recorded"),
    ],
)
def test_reads_as_a_person_writes(value, unit, shown):
    assert quantity(value, unit).replace(THIN, " ") == shown.replace(THIN, " ")


def test_two_digits_of_hundreds_need_no_power_of_ten():
    """520 µrad of sampling's error, in the report: not 5.2 × 10² µrad."""
    assert quantity(5.2e-4, "rad", 2).replace(THIN, " ") == "520 µrad"
    assert quantity(-1236.0, "rad", 3).replace(THIN, " ") == "−1240 rad"
    assert quantity(12345.0, "rad", 3).replace(THIN, " ") == "1.23 × 10⁴ rad"


@pytest.mark.parametrize(
    ("value", "half", "shown"),
    [
        (5.00283, 0.00148, "5.0028 ± 0.0015"),  # not 5 ± 0.0015, which leaves it out
        (1234.6, 12.0, "1235 ± 12"),
        (0.0421, 0.0212, "0.0421 ± 0.021"),
        (3.0, 40.0, "3 ± 40"),
        (3.0, 0.0, "3 ± 0"),
        (3.0, math.inf, "3 ± infinite"),
        (math.nan, 1.0, "undefined ± 1"),
    ],
)
def test_a_value_lies_in_the_interval_it_is_shown_with(value, half, shown):
    assert within(value, half) == shown


def test_microseconds_and_counts():
    assert microseconds(1500.0).replace(THIN, " ") == "1.5 ms"
    assert count(9999) == "9999"
    assert count(1234567).replace(THIN, " ") == "1 234 567"


def test_large_energies_have_their_own_prefix_and_lengths_none_beyond_kilometres():
    assert quantity(1.09e8, "J", 3) == "109\u202fMJ"
    assert quantity(2.5e9, "J", 3) == "2.5\u202fGJ"
    assert quantity(3e6, "m", 3) == "3000\u202fkm"
    assert quantity(2e3, "rad", 3) == "2000\u202frad"


@given(st.floats(1e-12, 1e6))
def test_the_prefix_keeps_the_value(value):
    factor, unit = scale_for(value, "m")
    weight = {"km": 1e3, "m": 1.0, "mm": 1e-3, "µm": 1e-6, "nm": 1e-9, "pm": 1e-12}[unit]
    assert math.isclose(value * factor * weight, value, rel_tol=1e-12)
    assert 0.9 <= value * factor < 1001.0 or value > 1e5


def test_a_share_of_nothing_is_no_gap_in_the_recording():
    assert share(0.0, 0.0) == "both zero"
    assert share(1e-3, 0.0) == "of zero"
    assert share(None, 1.0) == share(1.0, None) == MISSING
