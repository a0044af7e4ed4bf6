"""Time on the wire, and frames by their silences."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tautwave_sim.modbus.wire.framing import open_rtu, rtu_frame, tcp_frame
from tests.examples import tried
from tests.sim.modbus.masters import Bench, read, read_write, words, write_many, write_one

GOOD = rtu_frame(1, read(0))
ANSWER = rtu_frame(1, bytes.fromhex("03 02 5457"))
EXCHANGE = read_write(0, 6, 16, 0, 0, 0, 0)  # 21 characters, answered by 17


def taken_ns(bench: Bench, pdu: bytes) -> int:
    """Return the time from the first byte of a request to the last of its answer."""
    begin = bench.clock.now_ns()
    frame = tcp_frame(1, 1, pdu) if bench.link == "tcp" else rtu_frame(1, pdu)
    bench.port.write(frame)
    assert bench.clock.wait(bench.port, begin + 10**9)
    taken = bench.clock.now_ns() - begin
    bench.port.read()
    bench.wait(0.01)
    return taken


# An exchange of FC 23, and FC 16 followed by FC 3, at 11 bits a character, a silence after each
# request and each answer: milliseconds and rates of a hand calculation, by baud rate.
TABLE = [(9600, 51.6, 19, 14), (19200, 25.8, 39, 27), (57600, 10.8, 93, 60), (115200, 7.1, 140, 85)]


@pytest.mark.parametrize(("baud", "ms", "at_once", "apart"), TABLE)
@pytest.mark.parametrize("shape", [{"parity": "E"}, {"stop_bits": 2}])
def test_an_rtu_exchange_takes_its_characters_and_its_silences(
    baud: int, ms: float, at_once: int, apart: int, shape: dict[str, object]
) -> None:
    bench = Bench("rtu", baud=baud, **shape)
    silent = 1_750_000 if baud > 19200 else round(3.5 * 11e9 / baud)
    first = taken_ns(bench, EXCHANGE) + silent
    assert first == pytest.approx(38 * 11e9 / baud + 2 * silent, abs=10)
    assert round(1e-6 * first, 1) == ms
    assert round(1e9 / first) == at_once
    both = taken_ns(bench, write_many(16, 0, 0, 0, 0)) + taken_ns(bench, read(0, 6)) + 2 * silent
    assert both == pytest.approx(50 * 11e9 / baud + 4 * silent, abs=10)
    assert round(1e9 / both) == apart


def test_ten_bits_without_parity_and_with_one_stop_bit() -> None:
    taken = taken_ns(Bench("rtu", baud=9600), EXCHANGE)
    assert taken == pytest.approx(38 * 10e9 / 9600 + 35e9 / 9600, abs=10)


def test_a_silence_that_scales_with_the_baud_rate() -> None:
    silent = 3.5 * 11 / 115200
    bench = Bench("rtu", parity="E", simulator={"silent_s": silent})
    cycle = taken_ns(bench, EXCHANGE) * 1e-9 + silent
    assert 1.0 / cycle == pytest.approx(233, abs=0.5)


@pytest.mark.parametrize("link", ["tcp", "rtu"])
def test_turnaround_comes_on_top_and_a_drive_may_have_its_own(link: str) -> None:
    plain = taken_ns(Bench(link), EXCHANGE)
    assert taken_ns(Bench(link, turnaround_s=0.004), EXCHANGE) == plain + 4_000_000
    own = Bench(link, turnaround_s=0.004, quirks={"answer_s": 0.001})
    assert taken_ns(own, EXCHANGE) == plain + 1_000_000


def test_a_tcp_exchange_takes_two_segments() -> None:
    # 25 and 21 bytes of ADU and 78 around each, at 100 Mbit/s: 8.2 and 7.9 us.
    assert taken_ns(Bench(), EXCHANGE) == (25 + 78 + 21 + 78) * 80


def test_one_drive_serves_one_request_after_the_other() -> None:
    bench = Bench(units=(1, 2), turnaround_s=0.01)
    begin = bench.clock.now_ns()
    for transaction, unit in ((1, 1), (2, 1), (3, 2)):
        bench.port.write(tcp_frame(transaction, unit, read(0)))
    arrivals = []
    while bench.clock.wait(bench.port, begin + 100_000_000):
        ms = (bench.clock.now_ns() - begin) // 1_000_000
        arrivals += [ms] * (len(bench.port.read()) // len(tcp_frame(1, 1, ANSWER[1:-2])))
    assert arrivals == [10, 10, 20]


def test_an_adapter_with_a_latency_timer() -> None:
    bench = Bench("rtu", simulator={"latency_s": 0.016})
    assert taken_ns(bench, read(0)) > 10_000_000


def send(bench: Bench, *pieces: tuple[bytes, float]) -> bytes:
    """Write pieces, each followed by a silence [s] after its last byte; return what comes."""
    got = b""
    for data, silence in pieces:
        bench.port.write(data)
        spoken = len(data) * bench.options.bits / bench.options.baud
        bench.until(bench.clock.now_ns() + round(1e9 * (spoken + silence)))
        got += bench.port.read()
    return got


QUIET = 0.05


def test_a_frame_that_breaks_off_is_dropped_at_its_silence() -> None:
    bench = Bench("rtu")
    assert send(bench, (GOOD[:5], 0.00174), (GOOD[5:], QUIET)) == ANSWER
    assert send(bench, (GOOD[:5], 0.00176), (GOOD[5:], QUIET)) == b""
    assert send(bench, (GOOD, QUIET)) == ANSWER


def test_two_frames_without_a_silence_are_none() -> None:
    bench = Bench("rtu")
    assert send(bench, (GOOD + GOOD, QUIET)) == b""
    assert send(bench, (GOOD, 0.001), (GOOD, QUIET)) == b""


@pytest.mark.parametrize(
    ("strict", "unit", "silence", "answered"),
    [
        (False, 1, 0.0, True),
        (True, 1, 0.0017, False),
        (True, 1, 0.0018, True),
        (False, 2, 0.0017, False),
        (False, 2, 0.0018, True),
    ],
)
def test_a_request_on_the_heels_of_an_answer(
    strict: bool, unit: int, silence: float, answered: bool
) -> None:
    bench = Bench("rtu", units=(1, 2), simulator={"strict": strict})
    bench.port.write(GOOD)
    assert bench.clock.wait(bench.port, 10**9)
    assert bench.port.read() == ANSWER
    bench.until(bench.clock.now_ns() + round(silence * 1e9))
    got = send(bench, (rtu_frame(unit, read(0)), QUIET))
    assert got == (rtu_frame(unit, ANSWER[1:-2]) if answered else b"")


def test_a_drive_does_not_understand_another_baud_rate() -> None:
    bench = Bench("rtu")
    bench.port.baud = 9600  # type: ignore[union-attr]
    assert send(bench, (GOOD, QUIET), (rtu_frame(1, write_one(17, 2)), QUIET)) == b""
    bench.port.baud = 115200  # type: ignore[union-attr]
    assert send(bench, (GOOD, QUIET)) == ANSWER
    assert bench.number("mode") == 0


def test_who_speaks_into_an_answer_garbles_it() -> None:
    bench = Bench("rtu")
    bench.port.write(GOOD)
    bench.until(bench.clock.now_ns() + round(1e9 * (8 * 10 / 115200 + 0.00175 + 0.0002)))
    got = send(bench, (GOOD, QUIET))
    assert len(got) == len(ANSWER)
    assert open_rtu(got) is None


@settings(max_examples=tried(60))
@given(
    st.lists(
        st.tuples(st.binary(min_size=1, max_size=40), st.floats(0.0, 0.004)),
        max_size=6,
    )
)
def test_an_rtu_line_finds_its_feet_after_anything(pieces: list[tuple[bytes, float]]) -> None:
    bench = Bench("rtu", units=(1, 7))
    send(bench, *pieces)
    bench.wait(0.1)
    bench.port.read()
    assert send(bench, (GOOD, QUIET)) == ANSWER


@settings(max_examples=tried(60))
@given(st.lists(st.binary(min_size=1, max_size=40), max_size=6))
def test_a_connection_of_anything_never_raises(pieces: list[bytes]) -> None:
    bench = Bench()
    for piece in pieces:
        bench.port.write(piece)
        bench.wait(0.001)
    bench.port.read()
    bench.port.close()
    from tests.sim.modbus.masters import ENDPOINT

    bench.port = bench.simulator.port(ENDPOINT)
    assert words(bench.ask(read(0))) == [0x5457]
