"""Energies and ratios as sentences state them."""

from __future__ import annotations

import pytest

from tautwave.analysis.claim import joules, short


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (2.5e6, "2.5 MJ"), (1e6, "1 MJ"), (999e3, "999 kJ"), (1e3, "1 kJ"), (1.0, "1 J"),
        (0.5, "500 mJ"), (1e-3, "1 mJ"), (1e-6, "1 uJ"), (5e-7, "500 nJ"), (0.0, "0 nJ"),
    ],
)  # fmt: skip
def test_an_energy_has_the_greatest_unit_that_it_fills(value: float, text: str) -> None:
    assert joules(value) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.994, "0.99"), (0.995, "1.0"), (1.0, "1.0"), (9.94, "9.9"), (9.96, "10"), (99.4, "99"),
        (101.0, "101"), (12345.0, "12,345"), (1e6, "1e+06"),
    ],
)  # fmt: skip
def test_a_ratio_has_two_digits_or_is_a_whole_number(value: float, text: str) -> None:
    assert short(value) == text
