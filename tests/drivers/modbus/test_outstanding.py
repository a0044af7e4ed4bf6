"""Requests under way on one TCP connection: never more than its server takes."""

from __future__ import annotations

from pathlib import Path
from random import Random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.clock import FakeClock, MonotonicClock
from tautwave.errors import BusTimeout
from tautwave.types import AxisCommand
from tautwave_drivers.modbus import plugin
from tautwave_drivers.modbus.driver import ModbusDriver
from tautwave_drivers.modbus.line.tcp import TcpLink
from tautwave_drivers.modbus.protocol.frames import read, tcp_frame
from tautwave_drivers.modbus.protocol.transaction import Transaction
from tests.drivers.modbus.parts import bench, bus_of, device, queued, spec
from tests.drivers.modbus.test_links import RESPONSE, Stub
from tests.sim.modbus.served import served

pytestmark = pytest.mark.realtime

UNITS = (1, 2, 3)
MBAP = 12  # bytes of a request that reads


class Server(Stub):
    """Keeps its requests, and responds on command."""

    def __init__(self) -> None:
        super().__init__()
        self.asked: list[tuple[bytes, int]] = []

    def write(self, data: bytes) -> None:
        super().write(data)
        for at in range(0, len(data), MBAP):
            self.asked.append((data[at : at + 2], data[at + 6]))

    def response(self, number: int = 0) -> None:
        transaction, unit = self.asked.pop(number)
        self.inbox += tcp_frame(int.from_bytes(transaction, "big"), unit, RESPONSE)


def made(outstanding: int) -> tuple[TcpLink, Server, FakeClock]:
    clock, server = FakeClock(1_000_000_000), Server()
    link = TcpLink(lambda: server, clock, 1.0, outstanding)
    link.connect()
    return link, server, clock


def transactions(requests: int = 2) -> list[Transaction]:
    found = [Transaction(unit) for unit in UNITS]
    for transaction in found:
        transaction.begin((read(3, 2, 2),) * requests)
    return found


def test_a_connection_has_one_request_outstanding_unless_the_profile_says_more() -> None:
    link, server, _ = made(1)
    asked = transactions()
    link.start(asked)
    order = []
    while link.busy:
        assert len(server.asked) == 1
        order.append(server.asked[0][1])
        server.response()
        link.pump()
    assert order == [1, 1, 2, 2, 3, 3]
    assert all(transaction.complete for transaction in asked)


def test_as_many_as_the_server_takes_leave_in_one_segment() -> None:
    link, server, _ = made(2)
    link.start(transactions())
    assert [len(segment) for segment in server.sent] == [2 * MBAP]


@given(st.integers(1, 4), st.integers(0, 2**32 - 1))
def test_never_more_are_outstanding_and_everybody_is_asked(outstanding: int, seed: int) -> None:
    """Answers come in any order, late, or not at all; five exchanges on one connection."""
    dice = Random(seed)
    link, server, clock = made(outstanding)
    for _ in range(5):
        link.abandon()
        server.asked.clear()
        asked = transactions(dice.randrange(1, 4))
        link.start(asked)
        silent = dice.choice((*UNITS, 0, 0, 0))
        for _ in range(60):
            link.pump()
            live = [n for n, (_, unit) in enumerate(server.asked) if unit != silent]
            if live and dice.random() < 0.7:
                server.response(dice.choice(live))
            clock.sleep_until(clock.now_ns() + 1_000_000)
            server.asked = [  # what nobody waits for any more is under way no longer
                one for one in server.asked
                if int.from_bytes(one[0], "big") in link._pending
            ]  # fmt: skip
            assert len(link._pending) <= outstanding
        assert all(transaction.complete for transaction in asked if transaction.unit != silent)
        assert link.lost == ""


def test_a_silent_drive_is_asked_last_the_next_time() -> None:
    link, server, clock = made(1)
    for expected in ([1, 2, 3], [2, 3, 1], [2, 3, 1]):
        asked = transactions(1)
        link.start(asked)
        order = []
        while link.busy and len(order) < 3:
            unit = server.asked[-1][1]
            order.append(unit)
            if unit != 1:
                server.response(-1)
            elif link.wake_ns is not None:
                clock.sleep_until(link.wake_ns)
            link.pump()
        link.abandon()
        assert order == expected


def driver_of(endpoint: str, devices: list[dict[str, Any]]) -> ModbusDriver:
    axes = [spec(unit, velocity=1e3)._replace(position_range=(-1e3, 1e3)) for unit in UNITS]
    # On a busy machine an answer may take its time.
    block = {"endpoint": endpoint, "devices": devices, "comm_timeout_s": 20.0, "silence_s": 20.0}
    made = plugin.make(
        plugin.options.model_validate(block), bus_of(axes, 1.0), MonotonicClock(), None
    )
    assert isinstance(made, ModbusDriver)
    return made


@pytest.mark.slow
def test_several_units_behind_a_pymodbus_server(tmp_path: Path) -> None:
    """It answers the first request of a segment only, as simple gateways do."""
    clock = MonotonicClock()
    with served("--units", "1,2,3", "--server", "pymodbus") as reported:
        hasty = driver_of(reported["endpoint"], queued(tmp_path, 4, 3))
        with pytest.raises(BusTimeout, match=r"responded on its own.*outstanding: 1$"):
            hasty.open()
        driver = driver_of(reported["endpoint"], [device(unit) for unit in UNITS])
        try:
            driver.open()
            while not driver.enable_step():
                clock.sleep_until(clock.now_ns() + 1_000_000)
            for _ in range(20):
                driver.request()
                states = driver.read(clock.now_ns() + 5_000_000_000)
                assert [state.valid for state in states] == [True] * 3
                driver.write([AxisCommand(0.2, 0.0)] * 3)
            assert not driver.faults()
        finally:
            driver.close()


@pytest.mark.parametrize("outstanding", [1, 2, 3])
def test_simulated_drives_are_driven_alike_however_many(tmp_path: Path, outstanding: int) -> None:
    devices = queued(tmp_path, outstanding, 3)
    run = bench(*(spec(unit) for unit in UNITS), devices=devices, rate_hz=100.0)
    run.enable()
    rows = run.run(20, 0.2)
    assert all(state.valid for row in rows for state in row)
    link = run.driver._links.groups[0][0]  # type: ignore[union-attr]
    assert isinstance(link, TcpLink)
    assert link.outstanding == outstanding
    plain = bench(*(spec(unit) for unit in UNITS), rate_hz=100.0)
    plain.enable()
    assert [[s.position for s in row] for row in rows] == [
        [s.position for s in row] for row in plain.run(20, 0.2)
    ]
    for one in (run, plain):
        one.driver.close()
