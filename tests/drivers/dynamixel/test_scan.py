"""What a scan reports of each servo, in both protocols, on simulated lines and the fake clock."""

from __future__ import annotations

from typing import Any

import pytest

from tautwave_drivers.dynamixel.scan import ScanOptions, find_at_baud
from tautwave_sim.dynamixel import packets as p2
from tests.sim.dynamixel.line import Host, words

BAUD = 57_600  # of a servo as it is delivered


def scanned(host: Host, **options: Any) -> list[dict[str, Any]]:
    asked = ScanOptions(port="sim", **options)
    return list(find_at_baud(host.port, host.clock, BAUD, asked, 1e-3))


@pytest.mark.parametrize("ids", [[], [3, 7, 9]])
def test_a_row_has_the_servos_own_limits_and_supply(ids: list[int]) -> None:
    quirks = {7: {"firmware": 41, "voltage": 11.1, "registers": {"Velocity Limit": 100}}}
    host = Host((3, 7), "XM430-W350", simulator={"servos": quirks})
    host.servos[1].memory.poke("Operating Mode", 0)
    first, second = scanned(host, ids=ids, protocol=2.0)
    assert first == {
        "id": 3, "model": "XM430-W350", "model_number": 1020, "firmware": 48, "protocol": 2.0,
        "baud": BAUD, "mode": "position", "return_delay_us": 500,
        "current_limit": pytest.approx(1193 * 2.69e-3, abs=1e-3), "velocity_limit": 4.8,
        "voltage": 12.0, "temperature_degc": 25, "errors": "",
    }  # fmt: skip
    assert (second["id"], second["firmware"], second["voltage"]) == (7, 41, 11.1)
    assert (second["mode"], second["velocity_limit"]) == ("current", 2.4)


def test_a_servo_with_a_hardware_error_is_found_with_it() -> None:
    host = Host((1, 2))
    host.servos[1].fail(2)
    assert [row["errors"] for row in scanned(host, protocol=2.0)] == ["", "overheated"]


def test_a_servo_without_current_control_has_no_current_limit() -> None:
    [row] = scanned(Host((1,), "XL430-W250"), protocol=2.0)
    assert row["model"] == "XL430-W250"
    assert "current_limit" not in row


def test_a_servo_of_the_first_protocol_reports_its_position_and_load() -> None:
    loads = {}
    for goal in (1000, 20):
        host = Host((1,), "AX-12A", truths={"mass": 0.05})
        host.ask1(1, p2.WRITE, 24, 1)
        host.ask1(1, p2.WRITE, 30, *words(goal))
        host.pass_time(0.01)
        [row] = scanned(host, ids=[1])
        assert (row["model"], row["protocol"], row["errors"]) == ("AX-12A", 1.0, "")
        assert (row["position_counts"] > 512) == (goal > 512)
        loads[goal] = row["load_percent"]
    assert loads[1000] > 0.0 > loads[20]


def test_nobody_on_the_line_is_no_row() -> None:
    host = Host((1,))
    host.world.bus.servos.clear()
    assert scanned(host, ids=[1]) == []
