"""Bus time against the table of worst-case cycles (Davis and Burns bit counts, ISO 11898-1)."""

from __future__ import annotations

import re
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.contracts import AxisSpec, BusSpec
from tautwave_drivers.can.lengths import classic_bits, fd_bits, frame_s
from tautwave_drivers.canopen import CanopenOptions
from tautwave_drivers.canopen.budget import budget, cycle_sizes, exchange_s
from tautwave_drivers.canopen.options import Node


def bench(
    axes: int, causality: str, mapping: str, **more: object
) -> tuple[CanopenOptions, BusSpec]:
    nodes = tuple(
        Node(id=at + 1, rated_torque=0.5, counts_per_revolution=4096, mapping=mapping)  # type: ignore[arg-type]
        for at in range(axes)
    )
    specs = tuple(
        AxisSpec(f"master.a{at}", at + 1, "rotary", causality, 1.0, 10.0) for at in range(axes)
    )
    return CanopenOptions(nodes=nodes, **more), BusSpec("can", specs, 500.0)


@pytest.mark.parametrize(
    ("size", "bits"), [(0, 55), (1, 65), (4, 95), (6, 115), (7, 125), (8, 135)]
)
def test_worst_case_bits_of_classic_frames(size: int, bits: int) -> None:
    assert classic_bits(size) == bits


@pytest.mark.parametrize(
    ("size", "us"), [(0, 40.6), (8, 56.6), (16, 72.6), (32, 105.6), (48, 137.6), (64, 169.6)]
)
def test_worst_case_times_of_fd_frames_at_1_and_5_mbit(size: int, us: float) -> None:
    assert frame_s(size, 1_000_000, 5_000_000) * 1e6 == pytest.approx(us)


@given(st.integers(0, 8))
def test_a_classic_frame_is_never_shorter_than_its_bits_without_stuffing(size: int) -> None:
    assert 47 + 8 * size < classic_bits(size) <= (47 + 8 * size) * 5 // 4


@given(st.integers(0, 63))
def test_a_longer_fd_frame_is_never_faster(size: int) -> None:
    assert fd_bits(size) <= fd_bits(size + 1)


# An admittance axis with the full mapping has RPDOs of 7 and TPDOs of 8 bytes; an impedance axis
# with the lean one 4 and 6.
@pytest.mark.parametrize(
    ("axes", "bitrate", "us", "hz"),
    [
        (1, 1_000_000, 315, 3174),
        (2, 1_000_000, 575, 1739),
        (6, 1_000_000, 1615, 619),
        (1, 500_000, 630, 1587),
        (2, 500_000, 1150, 869),
        (6, 500_000, 3230, 309),
        (1, 250_000, 1260, 793),
        (2, 250_000, 2300, 434),
        (6, 250_000, 6460, 154),
    ],
)
def test_cycles_of_7_and_8_bytes(axes: int, bitrate: int, us: float, hz: int) -> None:
    options, bus = bench(axes, "admittance", "full", bitrate=bitrate)
    assert cycle_sizes(options, bus) == ([7] * axes, [8] * axes)
    assert exchange_s(options, bus) * 1e6 == pytest.approx(us)
    assert int(1.0 / exchange_s(options, bus)) == hz


@pytest.mark.parametrize(("axes", "hz"), [(1, 3773), (2, 2105), (6, 760)])
def test_cycles_of_the_lean_torque_mapping(axes: int, hz: int) -> None:
    options, bus = bench(axes, "impedance", "lean")
    assert cycle_sizes(options, bus) == ([4] * axes, [6] * axes)
    assert int(1.0 / exchange_s(options, bus)) == hz


@pytest.mark.parametrize(("axes", "us"), [(1, 153.8), (2, 267.0), (6, 719.8)])
def test_fd_cycles_of_8_and_8_bytes(axes: int, us: float) -> None:
    frames = [0, *[8] * (2 * axes)]
    cycle = sum(frame_s(size, 1_000_000, 5_000_000) for size in frames)
    assert cycle * 1e6 == pytest.approx(us)


def test_the_arithmetic_is_shown_and_adds_up() -> None:
    options, bus = bench(2, "admittance", "full")
    reported = budget(options, bus)
    assert "process data of one cycle: 575 us" in reported.arithmetic
    assert "7 bytes: 47 + 8*7 + floor((33 + 8*7)/4) = 125 bits = 125 us" in reported.arithmetic
    beats = 3 * 65e-6 / 20e-3
    assert reported.time_s == pytest.approx(575e-6 + (beats + 0.05) / 500.0)
    assert reported.greatest_rate_hz == pytest.approx((1 - beats - 0.05) / 575e-6)
    for remedy in ("mapping: lean", "two buses"):
        assert remedy in reported.remedy
        assert remedy not in reported.arithmetic  # `check` shows both


def test_a_faster_bitrate_is_advised_with_the_rate_that_it_leaves() -> None:
    options, bus = bench(2, "impedance", "full", bitrate=500_000)
    reported = budget(options, bus)
    found = re.search(r"bitrate 1000000 \((\d+) Hz\)", reported.remedy)
    assert found, reported.remedy
    assert int(found[1]) == pytest.approx(2.0 * reported.greatest_rate_hz, abs=1.0)
    assert "bitrate" not in budget(*bench(2, "impedance", "full")).remedy


def test_the_arithmetic_of_fd_frames_counts_both_rates() -> None:
    options, bus = bench(2, "admittance", "full", data_bitrate=5_000_000)
    text = budget(options, bus).arithmetic
    found = re.search(r"8 bytes: (\d+) bits nominal \+ (\d+) bits fast = ([\d.]+) us", text)
    assert found, text
    nominal, fast, us = (float(one) for one in found.groups())
    assert us == pytest.approx(nominal + fast / 5.0) == pytest.approx(56.6)
    assert "CAN FD" not in budget(options, bus).remedy  # it is what one has


def test_a_rate_that_60c2h_cannot_hold_is_reported_before_a_drive_refuses_it() -> None:
    options, bus = bench(2, "impedance", "full")
    reported = budget(options, bus._replace(rate_hz=1800.0)).arithmetic
    assert "cannot represent 555.556 us" in reported
    assert "60C2h" not in budget(options, bus._replace(rate_hz=800.0)).arithmetic


@pytest.mark.parametrize("axes", [1, 3, 6])
@pytest.mark.parametrize("sync", [True, False])
def test_at_the_greatest_rate_the_cycle_just_fits(axes: int, sync: bool) -> None:
    more: dict[str, Any] = {} if sync else {"sync": False, "rpdo": "event"}
    options, bus = bench(axes, "impedance", "full", **more)
    greatest = budget(options, bus).greatest_rate_hz
    if sync:
        at = budget(options, bus._replace(rate_hz=greatest))
        assert at.time_s == pytest.approx(1.0 / greatest)
    assert budget(options, bus._replace(rate_hz=100.0)).time_s < 1e-2


def test_three_axes_fit_1_khz_on_one_bus_and_six_do_not() -> None:
    fits = {axes: budget(*bench(axes, "impedance", "full")).greatest_rate_hz for axes in (3, 6)}
    assert fits[3] > 1000.0 > fits[6]
