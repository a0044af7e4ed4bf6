"""Time on the wire: baud rate, return delay, order of answers, adapter, collisions."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from tautwave.clock import FakeClock
from tautwave_sim.dynamixel import packets as p2
from tautwave_sim.wire.serial import GARBLE, MemoryPort, SerialLine, Transmission, wire_ns
from tests.sim.dynamixel.line import MS, Host, split, words

US = 1000
PING = p2.frame(1, b"\x01")
READ = p2.frame(1, bytes((p2.READ, *words(132), *words(4))))


def arrival(host: Host, data: bytes) -> int:
    """Return how long after sending the answer is there [ns]."""
    begin = host.clock.now_ns()
    host.send(data)
    assert host.clock.wait(host.port, begin + 100 * MS)
    took = host.clock.now_ns() - begin
    host.hear()
    return took


@pytest.mark.parametrize("baud", [9600, 57_600, 115_200, 1_000_000, 3_000_000])
@pytest.mark.parametrize("delay", [0, 1, 250])
def test_an_answer_takes_both_packets_and_the_return_delay(baud: int, delay: int) -> None:
    quirks = {1: {"registers": {"Return Delay Time": delay}}}
    host = Host((1,), baud=baud, simulator={"servos": quirks})
    expected = wire_ns(len(PING), baud) + delay * 2 * US + wire_ns(14, baud)
    assert arrival(host, PING) == expected
    assert wire_ns(10, 1_000_000) == 100 * US


def test_sync_read_answers_follow_one_another() -> None:
    host = Host((1, 2, 3), simulator={"factory": False})
    body = bytes((p2.SYNC_READ, *words(126), *words(10), 3, 1, 2))
    packet = p2.frame(p2.BROADCAST, body)
    begin = host.clock.now_ns()
    host.send(packet)
    times, order = [], []
    while host.clock.wait(host.port, begin + 10 * MS):
        times.append(host.clock.now_ns() - begin)
        order.append(host.port.read()[4])
    one = wire_ns(21, 1_000_000)
    first = wire_ns(len(packet), 1_000_000) + one
    assert times == [first, first + one, first + 2 * one]
    assert order == [3, 1, 2]


def test_a_fast_sync_read_is_one_packet_and_shorter() -> None:
    host = Host((1, 2, 3), simulator={"factory": False})
    took = {}
    for code in (p2.SYNC_READ, p2.FAST_SYNC_READ):
        begin = host.clock.now_ns()
        host.send(p2.frame(p2.BROADCAST, bytes((code, *words(126), *words(10), 1, 2, 3))))
        while host.clock.wait(host.port, begin + 5 * MS):
            took[code] = host.clock.now_ns() - begin
            host.port.read()
        host.clock.sleep_until(begin + 10 * MS)
    saved = 3 * 21 - (8 + 3 * 14)
    assert took[p2.SYNC_READ] - took[p2.FAST_SYNC_READ] == wire_ns(saved, 1_000_000)


def test_a_missing_servo_costs_its_own_time_only() -> None:
    host = Host((1, 2, 3), simulator={"factory": False})
    host.servos[1].present = False
    begin = host.clock.now_ns()
    packet = p2.frame(p2.BROADCAST, bytes((p2.SYNC_READ, *words(132), *words(4), 1, 2, 3)))
    host.send(packet)
    heard = {}
    while host.clock.wait(host.port, begin + 10 * MS):
        heard[host.port.read()[4]] = host.clock.now_ns() - begin
    sent, one = wire_ns(len(packet), 1_000_000), wire_ns(15, 1_000_000)
    assert heard == {1: sent + one, 3: sent + 3 * one}


def test_a_fast_sync_read_ends_before_a_missing_servo() -> None:
    host = Host((1, 2, 3), simulator={"factory": False})
    whole = host.sync_read((1, 2, 3), code=p2.FAST_SYNC_READ)
    host.servos[1].present = False
    assert host.sync_read((1, 2, 3), code=p2.FAST_SYNC_READ) == whole[:16]
    host.servos[0].present = False
    assert host.sync_read((1, 2, 3), code=p2.FAST_SYNC_READ) == b""


def test_old_firmware_knows_no_fast_sync_read() -> None:
    host = Host((1,), simulator={"servos": {1: {"firmware": 44}}})
    assert host.sync_read((1,), code=p2.FAST_SYNC_READ) == b""
    assert host.sync_read((1,)) != b""


def test_a_host_that_interrupts_garbles_the_answer_and_itself() -> None:
    host = Host((1,), simulator={"factory": False})
    host.send(PING)
    host.clock.sleep_until(host.clock.now_ns() + wire_ns(len(PING) + 5, 1_000_000))
    heard = host.talk(READ)
    assert heard[:5] == p2.HEADER + b"\x01"
    assert heard != p2.status(1, 0, b"\xfc\x03\x30")
    assert len(heard) == 14  # and no answer to the read
    assert split(host.talk(READ))[0][4] == 1


def test_an_answer_into_what_the_host_still_sends_garbles_both() -> None:
    host = Host((1,), simulator={"factory": False})
    heard = host.talk(PING + READ)
    assert len(heard) == 14
    assert p2.HEADER not in heard


def test_a_host_that_speaks_before_the_answer_begins_gets_none() -> None:
    host = Host((1,), simulator={"servos": {1: {"registers": {"Return Delay Time": 250}}}})
    host.send(PING)
    host.clock.sleep_until(host.clock.now_ns() + wire_ns(len(PING), 1_000_000) + 100 * US)
    assert len(host.talk(READ)) == 15


def test_packets_written_at_once_queue_on_the_wire() -> None:
    host = Host((1,), simulator={"factory": False})
    write = p2.frame(p2.BROADCAST, bytes((p2.WRITE, 65, 0, 1)))
    begin = host.clock.now_ns()
    host.send(write)
    host.send(READ)
    assert host.clock.wait(host.port, begin + 10 * MS)
    both = wire_ns(len(write) + len(READ), 1_000_000)
    assert host.clock.now_ns() - begin == both + wire_ns(15, 1_000_000)


def test_half_a_packet_is_given_up_after_silence() -> None:
    host = Host((1,))
    host.send(PING[:6])
    host.pass_time(0.05)
    assert host.talk(PING[6:])[:5] == p2.HEADER + b"\x01"
    host.send(PING[:6])
    host.pass_time(0.15)
    assert host.talk(PING[6:]) == b""
    host.pass_time(0.15)
    assert host.talk(PING)[:5] == p2.HEADER + b"\x01"
    old = Host((1,), "AX-12A")
    old.send(b"\xff\xff\x01\xf0")  # 240 bytes to come, which never do
    old.pass_time(0.15)
    assert old.ask1(1, p2.PING) == b"\xff\xff\x01\x02\x00\xfc"


# ------------------------------------------------------------------------------- adapter


def test_the_latency_timer_hands_over_at_its_ticks() -> None:
    host = Host((1,), simulator={"factory": False}, usb_latency_s=0.004)
    for _ in range(4):
        host.clock.sleep_until(host.clock.now_ns() + 1_300 * US)
        begin = host.clock.now_ns()
        host.send(READ)
        assert host.clock.wait(host.port, begin + 10 * MS)
        assert host.clock.now_ns() % (4 * MS) == 0
        assert 0 < host.clock.now_ns() - begin <= 5 * MS
        assert len(host.port.read()) == 15


def test_sixty_two_bytes_are_handed_over_at_once() -> None:
    host = Host((1,), simulator={"factory": False}, usb_latency_s=0.016)
    host.clock.sleep_until(MS)
    begin = host.clock.now_ns()
    host.send(p2.frame(1, bytes((p2.READ, 0, 0, *words(100)))))
    assert host.clock.wait(host.port, begin + 50 * MS)
    full = host.clock.now_ns()
    assert full - begin < 3 * MS
    assert len(host.port.read()) == 62
    assert host.clock.wait(host.port, begin + 50 * MS)
    assert host.clock.now_ns() - full == 16 * MS  # the timer begins anew with each packet
    assert len(host.port.read()) == 111 - 62


def test_a_tick_cuts_a_packet_in_two() -> None:
    host = Host((1,), simulator={"factory": False}, usb_latency_s=0.001)
    host.clock.sleep_until(MS - wire_ns(len(READ) + 6, 1_000_000))
    host.send(READ)
    chunks = []
    while host.clock.wait(host.port, 5 * MS):
        chunks.append((host.clock.now_ns(), len(host.port.read())))
    assert chunks == [(MS, 6), (2 * MS, 9)]


# ---------------------------------------------------------------------------------- line


def test_a_garbled_byte_is_garbled_once() -> None:
    sent = Transmission(bytes(4), 0, 1_000_000)
    sent.garble_from(25 * US)
    assert bytes(sent.data) == bytes((0, 0, GARBLE, GARBLE))
    sent.garble_from(10 * US)
    sent.garble_from(30 * US)
    assert bytes(sent.data) == bytes((0, GARBLE, GARBLE, GARBLE))


def test_a_late_piece_holds_back_what_follows() -> None:
    clock = FakeClock()
    line = SerialLine(1_000_000)
    port = MemoryPort(line, clock, "test")
    line.respond(b"a", 0, 1_000_000, late_ns=MS)
    line.respond(b"b", 20 * US, 1_000_000)
    assert clock.wait(port, 5 * MS)
    assert clock.now_ns() == MS + 10 * US
    assert port.read() == b"ab"


def test_nothing_is_heard_at_another_baud_rate() -> None:
    host = Host((1,), baud=57_600)
    host.port.baud = 115_200
    assert host.talk(PING) == b""
    host.port.baud = 57_600
    assert len(host.talk(PING, 20 * MS)) == 14


def test_what_a_device_sends_at_another_baud_rate_is_nothing() -> None:
    clock = FakeClock()
    line = SerialLine(1_000_000)
    port = MemoryPort(line, clock, "test")
    line.respond(b"abc", 0, 57_600)
    assert not clock.wait(port, 5 * MS)


def test_an_idle_line_has_no_events() -> None:
    host = Host((1,), free=False)
    host.talk(PING)
    assert host.port.next_event_ns() is None
    assert not host.port.readable()


def test_a_response_that_was_cut_short_in_time_garbles_nothing() -> None:
    """The host spoke before it began: a servo that hears another instruction keeps silent."""
    line = SerialLine(1_000_000)
    heard: list[Transmission] = []
    line.listener = SimpleNamespace(hear=heard.append)
    response = line.respond(bytes(40), 100_000, 1_000_000)
    for time_ns in (50_000, 200_000):
        line.host_write(b"\xff\xff", time_ns)
    assert response.cancelled
    line.advance(1_000_000)
    assert [sent.garbled for sent in heard] == [False, False]
    assert line.take() == b""
