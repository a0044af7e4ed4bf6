"""Whatever bytes come, a link neither raises nor is lost, and believes only what was asked."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.clock import FakeClock
from tautwave.contracts import BusSpec
from tautwave_drivers.modbus.line.links import POLL_NS, Links
from tautwave_drivers.modbus.line.rtu import RtuLink
from tautwave_drivers.modbus.line.tcp import TcpLink
from tautwave_drivers.modbus.options import ModbusOptions
from tautwave_drivers.modbus.protocol.frames import read, read_write, rtu_frame, tcp_frame
from tautwave_drivers.modbus.protocol.transaction import Transaction
from tests.drivers.modbus.parts import device

LINE = ModbusOptions.model_validate(
    {"link": "rtu", "endpoint": "/dev/x", "late_s": 0.005, "devices": [device(1)]}
)
RESPONSE = b"\x03\x04\x00\x01\x00\x02"
CHUNK = st.one_of(
    st.binary(max_size=40),
    st.builds(tcp_frame, st.integers(0, 6), st.integers(0, 3), st.binary(max_size=9)),
    st.builds(rtu_frame, st.integers(0, 3), st.binary(max_size=9)),
    st.just(tcp_frame(2, 2, RESPONSE)),
    st.just(rtu_frame(2, RESPONSE)),
)


class Stub:
    """A port that gives what a test says."""

    def __init__(self) -> None:
        self.inbox = b""
        self.sent: list[bytes] = []

    def write(self, data: bytes) -> None:
        self.sent.append(data)

    def read(self) -> bytes:
        data, self.inbox = self.inbox, b""
        return data

    def close(self) -> None:
        pass


@given(st.booleans(), st.lists(CHUNK, max_size=12))
def test_no_bytes_disturb_a_link(rtu: bool, chunks: list[bytes]) -> None:
    clock, port = FakeClock(1_000_000_000), Stub()
    link: Any = RtuLink(lambda: port, clock, LINE) if rtu else TcpLink(lambda: port, clock, 1.0)
    link.connect()
    clock.sleep_until(clock.now_ns() + 10_000_000)
    transactions = [Transaction(1), Transaction(2)]
    for chunk in [*chunks, b""]:
        link.abandon()
        for transaction in transactions:
            transaction.begin((read_write(2, 2, 18, (7,)), read(3, 2, 2)))
        link.start(transactions)
        for part in (chunk[: len(chunk) // 2], chunk[len(chunk) // 2 :]):
            port.inbox = part
            clock.sleep_until(clock.now_ns() + 3_000_000)
            link.pump()
        assert link.lost == ""
        for transaction in transactions:
            for request, pdu in zip(transaction.requests, transaction.responses, strict=False):
                assert request.fits(pdu)
    assert port.sent
    link.close()
    assert link.lost


def test_what_came_before_a_line_was_lost_is_no_beginning_of_what_comes_after() -> None:
    clock, port = FakeClock(1_000_000_000), Stub()
    link = RtuLink(lambda: port, clock, LINE)
    link.connect()
    link.start([transaction := Transaction(2)])
    transaction.begin((read(3, 2, 2),))
    port.inbox = rtu_frame(2, RESPONSE)[:4]
    clock.sleep_until(clock.now_ns() + 3_000_000)
    link.pump()
    link._buffer += b"\x02\x03"
    link.lost = "unplugged"
    assert link.connect()
    assert not link._buffer


def test_after_a_babble_the_next_answer_is_heard() -> None:
    clock, port = FakeClock(1_000_000_000), Stub()
    link = RtuLink(lambda: port, clock, LINE)
    link.connect()
    transaction = Transaction(2)
    for _ in range(50):
        port.inbox = b"\x02\x03" * 200
        clock.sleep_until(clock.now_ns() + 1_000_000)
        link.pump()
    clock.sleep_until(clock.now_ns() + 5_000_000)
    transaction.begin((read(3, 0, 2),))
    link.start((transaction,))
    clock.sleep_until(clock.now_ns() + 5_000_000)
    link.pump()
    assert len(port.sent) == 1
    port.inbox = rtu_frame(2, RESPONSE)
    link.pump()
    assert transaction.responses == [RESPONSE]


@pytest.mark.parametrize("babble", [b"", b"\x00\xff"], ids=["opened", "noise"])
def test_the_first_request_follows_three_and_a_half_characters_of_silence(babble: bytes) -> None:
    """Else the drives take it for the end of what was on the line before."""
    keys = {"endpoint": "/dev/x", "baud": 19200, "parity": "E", "devices": [device(1)]}
    options = ModbusOptions.model_validate({"link": "rtu", **keys})
    silence = math.ceil(3.5 * 11 / 19200 * 1e9)
    clock, port = FakeClock(1_000_000_000), Stub()
    link = RtuLink(lambda: port, clock, options)
    link.connect()
    if babble:  # long after it was opened
        clock.sleep_until(clock.now_ns() + 10 * silence)
        port.inbox = babble
    transaction = Transaction(2)
    transaction.begin((read(3, 0, 2),))
    link.start((transaction,))
    since = clock.now_ns()
    assert port.sent == []
    assert link.wake_ns == pytest.approx(since + silence, abs=1)
    clock.sleep_until(since + silence - 2)
    link.pump()
    assert port.sent == []
    clock.sleep_until(since + silence)
    link.pump()
    assert port.sent == [rtu_frame(2, bytes(transaction.requests[0].pdu))]
    assert link.unexpected == len(babble)


def test_a_line_that_was_silent_long_enough_is_asked_at_once() -> None:
    clock, port = FakeClock(1_000_000_000), Stub()
    link = RtuLink(lambda: port, clock, LINE)
    link.connect()
    clock.sleep_until(clock.now_ns() + 10_000_000)
    transaction = Transaction(2)
    transaction.begin((read(3, 0, 2),))
    link.start((transaction,))
    assert len(port.sent) == 1


def test_a_link_that_is_gone_is_reached_for_as_long_as_is_said() -> None:
    """Not a period more: a stop waits for it."""

    class Gone:
        tried = 0

        def connect(self) -> bool:
            self.tried += 1
            return False

    clock = FakeClock()
    link: Any = Gone()
    Links(LINE, BusSpec("arm", (), 100.0), clock, None, ()).reach(link, 0.05)
    assert clock.now_ns() == 50_000_000
    assert link.tried == 50_000_000 // POLL_NS + 1
