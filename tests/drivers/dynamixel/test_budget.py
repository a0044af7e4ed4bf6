"""Bus time: the numbers of reference/buses.md section 4, and remedies that do what they say."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from tautwave.cli import main
from tautwave.contracts import BusSpec
from tautwave_drivers.dynamixel.budget import READ_SHARE, Traffic, budget, traffic_of
from tautwave_drivers.dynamixel.exchange import Goals
from tautwave_drivers.dynamixel.protocol.packet import build, sync_read_packet
from tautwave_drivers.dynamixel.protocol.registers import GOAL_CURRENT, GOAL_VELOCITY
from tests.drivers.dynamixel.parts import options_of, servo, spec

# Baud, return delay, latency timer [s], fast read: greatest rate by the wire with 1, 2, 6 servos.
WIRE = [
    (57_600, 500e-6, 0.0, False, (103, 69, 29)),
    (57_600, 0.0, 0.0, False, (109, 74, 32)),
    (1_000_000, 500e-6, 0.0, False, (971, 562, 209)),
    (1_000_000, 0.0, 0.0, False, (1887, 1282, 562)),
    (1_000_000, 0.0, 0.0, True, (1852, 1389, 694)),
    (4_000_000, 500e-6, 0.0, False, (1581, 837, 290)),
    (4_000_000, 0.0, 0.0, False, (7547, 5128, 2247)),
    (1_000_000, 0.0, 1e-3, False, (654, 562, 360)),
    (4_000_000, 0.0, 1e-3, False, (883, 837, 692)),
    (1_000_000, 0.0, 16e-3, False, (60, 60, 56)),
]


@pytest.mark.parametrize("row", WIRE, ids=str)
def test_the_wire_allows_what_the_reference_says(row: tuple[Any, ...]) -> None:
    baud, delay, latency, fast, rates = row
    for count, rate in zip((1, 2, 6), rates, strict=True):
        time_s = Traffic(count, 0, fast=fast).time_s(baud, delay, latency)
        assert int(1.0 / time_s) in (rate, rate - 1) or round(1.0 / time_s) == rate


@pytest.mark.parametrize("status_block", [False, True])
@pytest.mark.parametrize("fast", [False, True])
def test_the_bytes_are_those_that_are_sent(fast: bool, status_block: bool) -> None:
    axes = (spec(1), spec(2), spec(3, "admittance"))
    options = options_of(
        servo(1), servo(2), servo(3), status_block=status_block,
        read="fast_sync" if fast else "sync",
    )  # fmt: skip
    traffic = traffic_of(options, BusSpec("hand", axes, 500.0))
    sent = Goals(GOAL_CURRENT, (1, 2)).packet() + Goals(GOAL_VELOCITY, (3,)).packet()
    sent += sync_read_packet((1, 2, 3), 126, traffic.size, fast=fast)
    assert traffic.sent == len(sent)
    if not fast:
        assert traffic.received == 3 * len(build(1, 0x55, bytes(traffic.size + 1)))


def test_the_budget_leaves_the_loop_its_share() -> None:
    options = options_of(servo(1), servo(2), baud=1_000_000)
    cost = budget(options, BusSpec("hand", (spec(1), spec(2)), 500.0))
    assert cost.time_s == pytest.approx(780e-6 / READ_SHARE)
    assert cost.greatest_rate_hz == pytest.approx(READ_SHARE / 780e-6)
    assert "36 bytes out, 42 back, 78 x 10 bits at 1000000 baud = 0.780 ms" in cost.arithmetic
    assert "divisor: " not in cost.remedy  # it fits


def test_every_remedy_is_reported_in_hz() -> None:
    options = options_of(
        servo(1), servo(2), servo(3), baud=1_000_000, return_delay_s=500e-6, usb_latency_s=0.016,
        status_block=True,
    )  # fmt: skip
    axes = (spec(1), spec(2), spec(3))
    cost = budget(options, BusSpec("hand", axes, 1000.0))
    assert cost.time_s > 1e-3
    for remedy in (
        "baud: 4000000", "return_delay_s: 0", "latency timer of 1 ms", "real UART",
        "read: fast_sync", "status_block: false", "one axis fewer", "divisor: ",
    ):  # fmt: skip
        assert remedy in cost.remedy
        assert remedy not in cost.arithmetic


def test_a_remedy_keeps_its_promise() -> None:
    axes = (spec(1), spec(2))
    slow = options_of(servo(1), servo(2), baud=1_000_000)
    reported = budget(slow, BusSpec("hand", axes, 2000.0)).remedy
    promised = float(reported.split("baud: 4000000 gives ")[1].split(" Hz")[0])
    fast = options_of(servo(1), servo(2), baud=4_000_000)
    cost = budget(fast, BusSpec("hand", axes, 2000.0))
    assert cost.greatest_rate_hz == pytest.approx(promised, abs=0.51)
    assert "baud: " not in cost.remedy
    nth = int(reported.split("divisor: ")[1].split(" ")[0])
    assert budget(slow, BusSpec("hand", axes, 2000.0 / nth)).time_s <= nth / 2000.0
    assert budget(slow, BusSpec("hand", axes, 2000.0 / (nth - 1))).time_s > (nth - 1) / 2000.0


def test_usb_is_assumed_where_the_port_says_so() -> None:
    for port, latency in (
        ("/dev/ttyUSB0", 1e-3), ("/dev/ttyACM1", 1e-3), ("/dev/ttyAMA0", 0.0), ("sim", 0.0),
    ):  # fmt: skip
        assert options_of(servo(1)).model_copy(update={"port": port}).latency_s == latency
    assert options_of(servo(1), usb_latency_s=0.016).latency_s == 0.016


def test_a_bus_with_a_divisor_gets_the_whole_one_as_remedy() -> None:
    bus = BusSpec("hand", (spec(1), spec(2)), 2000.0, divisor=3)
    reported = budget(options_of(servo(1), servo(2), baud=1_000_000), bus).remedy
    assert "divisor: 6 on this bus (1000 Hz) fits" in reported


@pytest.mark.parametrize("command", ["check", "run"])
def test_over_budget_ends_in_4_with_remedies(command: str, tmp_path: Path) -> None:
    path = Path(__file__).parents[3] / "configs" / "bench-dynamixel-sim.yaml"
    words = [command, str(path), "--set", "rate_hz=2000", "--set", "coupling.delay_s=0.01"]
    if command == "run":
        words += ["--out", str(tmp_path / "run")]
    done = CliRunner().invoke(main, words)
    assert done.exit_code == 4, done.output
    assert "baud: 4000000 gives " in done.output
