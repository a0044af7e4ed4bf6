"""Every way in which a line or a drive fails: at its request, at its time, and by its seed."""

from __future__ import annotations

from typing import Any

import pytest

from tautwave.errors import ConfigError, DriverError
from tautwave_sim.modbus.options import LINK_FAULTS, REQUEST_FAULTS
from tautwave_sim.modbus.wire.framing import open_rtu, rtu_frame, tcp_frame
from tests.sim.modbus.masters import ENDPOINT, Bench, read, read_write, write_one

LINKS = pytest.mark.parametrize("link", ["tcp", "rtu"])
IDENTITY = bytes.fromhex("03 02 5457")


def raw(bench: Bench, pdu: bytes, transaction: int = 7) -> bytes:
    frame = tcp_frame(transaction, 1, pdu) if bench.link == "tcp" else rtu_frame(1, pdu)
    return bench.bytes_back(frame)


def framed(link: str, pdu: bytes, unit: int = 1, transaction: int = 7) -> bytes:
    return tcp_frame(transaction, unit, pdu) if link == "tcp" else rtu_frame(unit, pdu)


def scripted(link: str, kind: str, **more: Any) -> Bench:
    """Return a bench whose second request meets with a fault."""
    return Bench(link, faults={"events": [{"kind": kind, "nth": 2, **more}]})


@LINKS
@pytest.mark.parametrize("kind", REQUEST_FAULTS)
def test_only_the_request_that_is_meant(link: str, kind: str) -> None:
    bench = scripted(link, kind)
    right = framed(link, IDENTITY)
    got = [raw(bench, read(0)) for _ in range(4)]
    assert [response == right for response in got] == [
        True,
        False,
        True,
        True,
    ] or kind == "answer_late"


@LINKS
def test_a_lost_request_does_nothing_a_lost_answer_hides_what_was_done(link: str) -> None:
    for kind, mode in (("request_lost", 0), ("answer_lost", 2)):
        bench = scripted(link, kind)
        raw(bench, read(0))
        assert raw(bench, write_one(17, 2)) == b""
        assert bench.number("mode") == mode


@LINKS
def test_a_late_answer_comes_while_the_next_is_awaited(link: str) -> None:
    bench = Bench(link, faults={"late_s": 0.02, "events": [{"kind": "answer_late"}]})
    bench.patience_ns = 5_000_000
    assert raw(bench, read(0), 1) == b""
    late, next_one = framed(link, IDENTITY, transaction=1), framed(link, b"\3\2\0\1", transaction=2)
    # Two answers to one question, and RTU has no number to tell them apart.
    got = raw(bench, read(1), 2)
    bench.until(bench.clock.now_ns() + 30_000_000)
    assert got + bench.port.read() in (late + next_one, next_one + late)


@LINKS
def test_noise_stands_in_front_of_the_answer(link: str) -> None:
    bench = scripted(link, "noise")
    raw(bench, read(0))
    got = raw(bench, read(0))
    right = framed(link, IDENTITY)
    assert got.endswith(right)
    assert 1 <= len(got) - len(right) <= 8


@LINKS
def test_another_unit_answers(link: str) -> None:
    bench = scripted(link, "wrong_unit")
    raw(bench, read(0))
    assert raw(bench, read(0)) == framed(link, IDENTITY, unit=2)


@LINKS
def test_the_end_of_an_answer_is_missing(link: str) -> None:
    bench = scripted(link, "truncated", times=20)
    raw(bench, read(0, 9))
    right = framed(link, bytes.fromhex("03 12 5457 0001 0001") + bytes(12))
    got = [raw(bench, read(0, 9)) for _ in range(20)]
    assert all(right.startswith(response) and len(response) < len(right) for response in got)
    assert len({len(response) for response in got}) > 5


def test_one_wrong_bit_is_seen_by_the_checksum_or_in_the_number() -> None:
    rtu = scripted("rtu", "corrupted", times=20)
    raw(rtu, read(0))
    for _ in range(20):
        got = raw(rtu, read(0))
        assert len(got) == 7
        assert open_rtu(got) is None
    tcp = scripted("tcp", "corrupted", times=20)
    raw(tcp, read(0))
    for _ in range(20):
        got = raw(tcp, read(0))
        assert got[2:] == tcp_frame(7, 1, IDENTITY)[2:]
        assert (int.from_bytes(got[:2], "big") ^ 7).bit_count() == 1


@LINKS
@pytest.mark.parametrize("code", [1, 2, 3, 4, 5, 6, 8, 10, 11])
def test_any_exception_instead_of_the_answer(link: str, code: int) -> None:
    bench = scripted(link, "exception", code=code)
    raw(bench, read(0))
    assert raw(bench, write_one(17, 2)) == framed(link, bytes([0x86, code]))
    assert bench.number("mode") == 0


def test_a_fault_for_one_unit() -> None:
    event = {"kind": "answer_lost", "unit": 2, "nth": 2, "times": 2}
    bench = Bench("rtu", units=(1, 2), faults={"events": [event]})
    got = [[bench.ask(read(0), unit) is not None for unit in (1, 2)] for _ in range(4)]
    assert got == [[True, True], [True, False], [True, False], [True, True]]


def moving(link: str, **event: Any) -> Bench:
    """Return a bench whose drive has just begun to move."""
    bench = Bench(link, faults={"events": [event]})
    bench.patience_ns = 5_000_000
    bench.set("mode", 2)
    bench.set("control", 1)
    bench.ask(read_write(2, 7, 18, 100))
    return bench


@LINKS
def test_at_a_time_and_for_a_time(link: str) -> None:
    bench = moving(link, kind="answer_lost", at_s=0.1, duration_s=0.05)
    began = bench.drive().origin_ns
    came = {}
    for ms in (20, 60, 95, 105, 125, 145, 165, 200):
        bench.until(began + ms * 1_000_000)
        came[ms] = bench.ask(read(0)) is not None
    assert [ms for ms, there in came.items() if not there] == [105, 125, 145]


def test_a_drive_fails_at_its_time_and_lets_go() -> None:
    bench = moving("tcp", kind="drive_fault", at_s=0.1, code=4)
    bench.until(bench.drive().origin_ns + 90_000_000)
    assert bench.number("status") == 3
    bench.until(bench.drive().origin_ns + 120_000_000)
    assert [bench.number("status"), bench.number("fault_code")] == [4, 4]
    assert bench.drive().motor.setpoint == 0


def ask_for(bench: Bench, seconds: float) -> None:
    end = bench.clock.now_ns() + round(seconds * 1e9)
    while bench.clock.now_ns() < end:
        bench.ask(read(0))
        bench.wait(0.01)


@pytest.mark.parametrize("by_time", [True, False])
def test_a_connection_is_reset(by_time: bool) -> None:
    when = {"at_s": 0.05} if by_time else {"nth": 5}
    bench = moving("tcp", kind="reset", **when)
    with pytest.raises(DriverError, match="reset by the drive; connect again"):
        ask_for(bench, 0.2)
    assert bench.port.readable()  # nobody waits for what cannot come
    bench.port = bench.simulator.port(ENDPOINT)
    assert bench.ask(read(0)) == IDENTITY


def test_a_server_is_gone_and_back() -> None:
    bench = moving("tcp", kind="gone", at_s=0.05, duration_s=0.1)
    began = bench.drive().origin_ns
    bench.until(began + 60_000_000)
    with pytest.raises(DriverError, match="reset"):
        bench.ask(read(0))
    with pytest.raises(DriverError, match="connection refused; see that the drive is on"):
        bench.simulator.port(ENDPOINT)
    bench.until(began + 170_000_000)
    bench.port = bench.simulator.port(ENDPOINT)
    assert bench.ask(read(0)) == IDENTITY


def test_refused_leaves_what_is_connected() -> None:
    bench = moving("tcp", kind="refused", at_s=0.05)
    bench.wait(0.1)
    assert bench.ask(read(0)) == IDENTITY
    with pytest.raises(DriverError, match="refused"):
        bench.simulator.port(ENDPOINT)
    with pytest.raises(DriverError, match="refused"):
        bench.simulator.port("tcp://elsewhere:502")


def test_half_open_is_silence_without_an_end() -> None:
    bench = moving("tcp", kind="half_open", at_s=0.05, duration_s=0.1)
    bench.wait(0.06)
    reported = bench.drive().bank.values["target_torque"]
    for _ in range(5):
        assert bench.ask(write_one(18, 7)) is None
    assert bench.drive().bank.values["target_torque"] == reported
    assert not bench.port.readable()
    bench.wait(0.2)
    assert bench.ask(read(0)) is None  # the connection never comes back
    bench.port = bench.simulator.port(ENDPOINT)
    assert bench.ask(read(0)) == IDENTITY


def test_an_adapter_is_unplugged_and_plugged_in_again() -> None:
    bench = moving("rtu", kind="unplugged", at_s=0.05, duration_s=0.1)
    bench.wait(0.06)
    for _ in range(2):
        with pytest.raises(DriverError, match="unplugged"):
            bench.ask(read(0))
    with pytest.raises(DriverError, match="adapter was disconnected"):
        bench.simulator.port("")
    bench.until(bench.clock.now_ns() + 200_000_000)
    bench.port = bench.simulator.port("")
    assert bench.ask(read(0)) == IDENTITY


@pytest.mark.parametrize("kind", LINK_FAULTS)
def test_a_fault_of_the_other_link_is_a_mistake(kind: str) -> None:
    link = "tcp" if kind == "unplugged" else "rtu"
    with pytest.raises(ConfigError, match=f"{kind} does not apply to {link}"):
        Bench(link, faults={"events": [{"kind": kind}]})


ALL = dict.fromkeys(REQUEST_FAULTS, 0.1)


def transcript(link: str, seed: int) -> list[tuple[int, bytes]]:
    """Return all that came, with its time, of a run in which anything may fail."""
    bench = Bench(link, units=(1, 2), faults={**ALL, "seed": seed, "late_s": 0.004})
    bench.patience_ns = 8_000_000
    bench.set("mode", 2)
    bench.set("control", 1)
    heard = []
    for k in range(120):
        pdu = read_write(2, 7, 18, 10 * k)
        unit = 1 + k % 2
        got = bench.bytes_back(tcp_frame(k, unit, pdu) if link == "tcp" else rtu_frame(unit, pdu))
        heard.append((bench.clock.now_ns(), got))
        bench.wait(0.002)
    return heard


@LINKS
def test_the_same_seed_gives_the_same_bytes_at_the_same_times(link: str) -> None:
    assert transcript(link, 5) == transcript(link, 5)
    assert transcript(link, 5) != transcript(link, 6)


@LINKS
@pytest.mark.parametrize("kind", REQUEST_FAULTS)
def test_a_probability_is_met_and_shifts_no_other(link: str, kind: str) -> None:
    bench = Bench(link, faults={kind: 0.25, "seed": 3})
    plan = bench.simulator.bus.plan
    alone = [plan.request(1, None) for _ in range(400)]
    struck = [number for number, outcome in enumerate(alone) if outcome != type(outcome)()]
    assert 70 <= len(struck) <= 130
    again = Bench(link, faults={kind: 0.25, "seed": 4}).simulator.bus.plan
    assert [again.request(1, None) != type(outcome)() for outcome in alone] != [
        outcome != type(outcome)() for outcome in alone
    ]
    other = Bench(link, faults={kind: 0.25, "request_lost": 1.0, "seed": 3}).simulator.bus.plan
    if kind != "request_lost":
        both = [other.request(1, None) for _ in range(400)]
        assert struck == [
            number
            for number, outcome in enumerate(both)
            if outcome._replace(lost=False) != type(outcome)()
        ]


def test_no_fault_no_difference() -> None:
    bench = Bench()
    outcome = bench.simulator.bus.plan.request(1, None)
    assert outcome == type(outcome)()
