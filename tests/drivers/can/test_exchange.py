"""The exchange of a cycle: answers until the time is up, full queues, lost buses, error frames."""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.clock import FakeClock
from tautwave.errors import DriverError
from tautwave_drivers.can.batches import Frame
from tautwave_drivers.can.exchange import Exchange
from tautwave_drivers.can.framing import ERROR_FRAME
from tautwave_drivers.can.full_queue import DEAD_CYCLES


class Bus:
    """A port in memory whose answers come when they are said to."""

    def __init__(self) -> None:
        self.now_ns = 0
        self.coming: list[tuple[int, int, bytes]] = []
        self.sent: list[tuple[int, bytes]] = []
        self.full = self.gone = False
        self.waiting = 0
        self.purged = 0

    def send(self, can_id: int, data: bytes) -> bool:
        if self.gone:
            raise DriverError("CAN interface can0 is down or gone")
        if not self.full:
            self.sent.append((can_id, data))
        return not self.full

    def receive(self) -> tuple[int, bytes, int] | None:
        if self.gone:
            raise DriverError("CAN interface can0 is down or gone")
        if not self.readable():
            return None
        at_ns, can_id, data = self.coming.pop(0)
        return can_id, data, at_ns

    def readable(self) -> bool:
        return bool(self.coming) and self.coming[0][0] <= self.now_ns

    def next_event_ns(self) -> int | None:
        return self.coming[0][0] if self.coming else None

    def advance(self, to_ns: int) -> None:
        self.now_ns = max(self.now_ns, to_ns)

    def purge(self) -> None:
        self.purged += 1

    def pending(self) -> int:
        return self.waiting

    def close(self) -> None:
        pass


def made() -> tuple[Exchange, Bus, FakeClock, list[int]]:
    bus, clock, heard = Bus(), FakeClock(), []

    def take(frames: Sequence[Frame]) -> int:
        answers = 0
        for can_id, data, _ in frames:
            exchange.strange(can_id, data)
            if not can_id & ERROR_FRAME:
                heard.append(can_id)
                answers += can_id < 0x100
        return answers

    exchange = Exchange(bus, clock, take)
    return exchange, bus, clock, heard


def test_it_waits_for_the_answers_that_are_missing_and_no_longer() -> None:
    exchange, bus, clock, heard = made()
    bus.coming = [(100, 1, b""), (200, 0x200, b""), (300, 2, b""), (900, 3, b"")]
    exchange.begin()
    exchange.missing = 2
    exchange.collect(1000)
    assert (heard, clock.now_ns()) == ([1, 0x200, 2], 300)


def test_time_is_up_at_the_deadline() -> None:
    exchange, bus, clock, heard = made()
    bus.coming = [(100, 1, b""), (5000, 2, b"")]
    exchange.missing = 2
    exchange.collect(1000)
    assert (heard, clock.now_ns(), exchange.missing) == ([1], 1000, 1)


def test_what_is_left_of_a_cycle_answers_nothing_of_the_next() -> None:
    exchange, bus, clock, heard = made()
    exchange.missing = 1
    exchange.collect(1000)
    bus.coming = [(1100, 1, b""), (2500, 2, b""), (2600, 3, b"")]
    clock.sleep_until(2000)
    assert exchange.begin()
    exchange.missing = 2
    exchange.collect(3000)
    assert (heard, clock.now_ns()) == ([1, 2, 3], 2600)


def test_nothing_is_added_to_a_full_queue_before_it_has_drained() -> None:
    exchange, bus, _, _ = made()
    bus.full = True
    assert not exchange.send(1, b"")
    bus.full, bus.waiting = False, 576
    bus.coming = [(0, 0x200, b"")]
    assert not exchange.begin()
    assert bus.purged == 1
    bus.waiting = 0
    assert exchange.begin()
    assert exchange.send(1, b"")
    (report,) = exchange.reports()
    assert "congested: the transmit queue was full for 3 cycles" in report
    assert exchange.begin()


def test_a_full_queue_and_nothing_received_is_a_dead_bus() -> None:
    exchange, bus, _, _ = made()
    bus.full = True
    exchange.send(1, b"")
    for _ in range(DEAD_CYCLES + 1):
        exchange.begin()
        exchange.send(1, b"")
    assert "dead bus" in exchange.lost
    assert not exchange.begin()
    assert not exchange.send(1, b"")


def test_a_lost_port_is_said_and_never_raised() -> None:
    exchange, bus, _, _ = made()
    bus.gone = True
    exchange.missing = 1
    exchange.collect(1000)
    assert "down or gone" in exchange.lost
    exchange.drain()
    assert not exchange.send(1, b"")


def test_error_frames_are_reported_at_1_10_100_times_and_bus_off_loses_the_bus() -> None:
    exchange, bus, _, heard = made()
    bus.coming = [(0, ERROR_FRAME | 0x20, bytes(8))] * 12
    exchange.drain()
    first, tenth = exchange.reports()
    assert "no acknowledge" in first
    assert tenth.endswith("(10 times)")
    assert not heard
    bus.coming = [(0, ERROR_FRAME | 0x40, bytes(8))]
    exchange.drain()
    assert "bus-off" in exchange.lost
