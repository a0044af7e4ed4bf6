"""What a scan reports of each servo, in both protocols, on simulated lines and the fake clock."""

from __future__ import annotations

from typing import Any, NamedTuple

import pytest

from tautwave.clock import FakeClock
from tautwave_drivers.dynamixel.scan import ScanOptions, find_at_baud
from tautwave_sim.dynamixel import packets as p2
from tests.foreign.servo_line import Servo, ServoLine
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


class Table(NamedTuple):
    """A servo of protocol 2.0 that is nothing but its registers: it answers pings and reads."""

    number: int
    values: dict[int, tuple[int, int]]  # size, value by address

    def line(self) -> ServoLine:
        clock = FakeClock()
        made = Servo(5)
        made.memory[:] = bytes(byte % 251 for byte in range(1024))  # whatever is not known
        for address, (size, value) in {0: (2, self.number), 6: (1, 44), **self.values}.items():
            made.put(address, size, value)
        made.read = lambda at, size: bytes(made.memory[at : at + size])  # type: ignore[method-assign]
        return ServoLine(clock, made)


P_SERIES = {
    9: (1, 25), 11: (1, 0), 12: (1, 255), 38: (2, 15_000), 44: (4, 2900), 518: (1, 32),
    592: (2, 239), 594: (1, 41),
}  # fmt: skip
X_SERIES = {
    9: (1, 25), 11: (1, 0), 12: (1, 3), 38: (2, 1000), 44: (4, 100), 70: (1, 0),
    144: (2, 121), 146: (1, 33),
}  # fmt: skip
KEYS = {"id", "model", "model_number", "firmware", "protocol", "baud", "errors"}
SUPPLY = {"voltage", "temperature_degc"}


@pytest.mark.parametrize(
    ("number", "values", "model", "rest"),
    [
        (
            2010, P_SERIES, "PH54-100-S500",
            {"mode": "current", "return_delay_us": 50, "current_limit": 15.0, "errors":
             "overloaded for too long", "velocity_limit": 3.04, "voltage": 23.9,
             "temperature_degc": 41},
        ),
        (
            311, X_SERIES, "MX-64(2.0)",
            {"mode": "current", "return_delay_us": 50, "current_limit": 3.36, "obeys_too": 3,
             "velocity_limit": 2.4, "voltage": 12.1, "temperature_degc": 33, "errors": ""},
        ),
        (
            30, X_SERIES, "MX-28(2.0)",
            {"mode": "current", "return_delay_us": 50, "obeys_too": 3,
             "velocity_limit": 2.4, "voltage": 12.1, "temperature_degc": 33, "errors": ""},
        ),
        (
            350, {5: (1, 250), 45: (1, 74), 46: (1, 30), 50: (1, 0)}, "XL-320",
            {"return_delay_us": 500, "voltage": 7.4, "temperature_degc": 30, "errors": ""},
        ),
        (53_768, {}, "model 53768", {"errors": "unknown"}),
    ],
)  # fmt: skip
def test_each_family_is_read_where_it_has_what_is_reported_and_nothing_else(
    number: int, values: dict[int, tuple[int, int]], model: str, rest: dict[str, Any]
) -> None:
    line = Table(number, values).line()
    options = ScanOptions(port="x", protocol=2.0)
    [row] = find_at_baud(line, line.clock, 4_000_000, options, 1e-3)
    assert row["model"] == model
    assert {key: row[key] for key in row.keys() - KEYS | {"errors"}} == rest


class FirstLine:
    """A servo of protocol 1.0 packets that is nothing but its table."""

    def __init__(self, table: dict[int, int]) -> None:
        self.clock = FakeClock()
        self._table = table
        self._out = b""

    def write(self, data: bytes) -> None:
        if data[:2] != b"\xff\xff" or data[2] != 1 or sum(data[2:]) & 0xFF != 0xFF:
            return
        size = data[6] if data[4] == 2 else 0
        body = bytes((1, size + 2, 0)) + bytes(self._table.get(data[5] + n, 0) for n in range(size))
        self._out += b"\xff\xff" + body + bytes((~sum(body) & 0xFF,))

    def read(self) -> bytes:
        out, self._out = self._out, b""
        return out

    def close(self) -> None: ...

    def readable(self) -> bool:
        return bool(self._out)

    def next_event_ns(self) -> int | None:
        return None

    def advance(self, to_ns: int) -> None: ...


@pytest.mark.parametrize(
    ("table", "model", "known"),
    [
        ({0: 12, 2: 24, 3: 1, 4: 1, 36: 7, 42: 121, 43: 30}, "AX-12A", SUPPLY),
        ({0: 29, 2: 38, 3: 1, 4: 34, 36: 7, 42: 119, 43: 31}, "MX-28", SUPPLY),
        ({0: 99, 1: 7, 2: 1, 3: 1, 42: 119, 43: 31}, "model 1891", set()),
        ({0: 3, 1: 9, 3: 9, 4: 3, 5: 1, 6: 0, 62: 120}, "no Dynamixel (a Feetech servo)", set()),
        ({0: 12, 2: 24, 3: 9, 4: 3, 5: 1, 6: 0, 62: 74}, "no Dynamixel (a Feetech servo)", set()),
    ],
)
def test_what_answers_in_the_first_protocol_is_told_by_its_table(
    table: dict[int, int], model: str, known: set[str]
) -> None:
    line = FirstLine(table)
    options = ScanOptions(port="x", protocol=1.0, ids=[1])
    [row] = find_at_baud(line, line.clock, 1_000_000, options, 1e-3)
    assert row["model"] == model
    assert row.keys() & SUPPLY == known
