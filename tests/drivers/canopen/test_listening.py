"""Another master on the bus is noticed before anything is sent."""

from __future__ import annotations

import socket
import struct
from typing import Any

import pytest

from tautwave.clock import FakeClock
from tautwave.contracts import Clock
from tautwave.errors import DriverError
from tautwave_drivers.canopen import plugin
from tautwave_drivers.canopen.driver import CanopenDriver
from tautwave_drivers.canopen.setup.listening import LISTEN_NS, refuse_another_master
from tests.drivers.canopen.benches import block, bus_of, driver_options, node

FRAME = struct.Struct("=IB3x8s")


class Heard:
    """A port on which a frame comes at a time, in memory."""

    def __init__(self, clock: Clock, can_id: int, at_ns: int) -> None:
        self._clock = clock
        self._frame = can_id, bytes(8), at_ns
        self._waiting = True
        self.sent: list[int] = []

    def next_event_ns(self) -> int | None:
        return self._frame[2] if self._waiting and not self.readable() else None

    def advance(self, to_ns: int) -> None:
        """Nothing happens by itself."""

    def readable(self) -> bool:
        return self._waiting and self._clock.now_ns() >= self._frame[2]

    def receive(self) -> tuple[int, bytes, int] | None:
        if not self.readable():
            return None
        self._waiting = False
        return self._frame

    def send(self, can_id: int, data: bytes) -> bool:
        self.sent.append(can_id)
        return True

    def close(self) -> None:
        """Nothing to close."""


def made(clock: Clock, transport: Any = None) -> CanopenDriver:
    options = block(node(1), node(5))
    bus = bus_of(options, ("impedance", "impedance"), 100.0)
    driver = plugin.make(driver_options(options), bus, clock, transport)
    assert isinstance(driver, CanopenDriver)
    return driver


@pytest.mark.parametrize(
    ("can_id", "what"),
    [
        (0x80, r"SYNC \(80h\)"),
        (0x201, r"commands to node 1 \(RPDO, 201h\)"),
        (0x205, r"commands to node 5 \(RPDO, 205h\)"),
        (0x605, r"requests to node 5 \(SDO, 605h\)"),
        (0x202, ""),  # to another's drive
        (0x602, ""),
        (0x181, ""),  # what drives send by themselves
        (0x581, ""),
        (0x705, ""),
        (0x81, ""),
    ],
)
def test_what_only_a_master_sends_refuses_the_bus(can_id: int, what: str) -> None:
    clock = FakeClock()
    driver = made(clock)
    for late, sync in ((0, True), (LISTEN_NS // 2, True), (LISTEN_NS // 2, False)):
        port = Heard(clock, can_id, clock.now_ns() + 1 + late)
        if what and (sync or can_id != 0x80):
            with pytest.raises(DriverError, match=f"bus can: another master sends {what}"):
                refuse_another_master(port, clock, "can", driver._axes, master_id=127, sync=sync)
        else:
            refuse_another_master(port, clock, "can", driver._axes, master_id=127, sync=sync)
        assert not port.sent


@pytest.mark.parametrize("master_id", [1, 100, 127])
def test_a_device_with_the_id_of_this_master_refuses_the_bus(master_id: int) -> None:
    clock = FakeClock()
    driver = made(clock)
    for number in (1, 100, 127):
        port = Heard(clock, 0x700 + number, clock.now_ns() + 1)
        if number == master_id:
            with pytest.raises(DriverError, match=f"has the node id {number} of this master"):
                refuse_another_master(
                    port, clock, "can", driver._axes, master_id=master_id, sync=True
                )
        else:
            refuse_another_master(port, clock, "can", driver._axes, master_id=master_id, sync=True)
        assert not port.sent


def test_a_bus_that_another_master_drives_is_left_alone() -> None:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    clock = Master(theirs)
    with ours, theirs:
        driver = made(clock, ours)
        with pytest.raises(DriverError, match="another master sends SYNC"):
            driver.open()
        driver.close()
        theirs.setblocking(False)
        with pytest.raises(BlockingIOError):
            theirs.recv(100)


class Master(FakeClock):
    """A clock that lets the other end send SYNC whenever somebody waits for it."""

    def __init__(self, other: socket.socket) -> None:
        super().__init__()
        self._other = other

    def wait(self, port: Any, deadline_ns: int) -> bool:
        self._other.send(FRAME.pack(0x80, 0, bytes(8)))
        return True
