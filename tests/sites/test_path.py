"""The test of a path: closed forms of its figures, and both ends over real sockets."""

from __future__ import annotations

import json
import random
import socket
import struct
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from tautwave.cli import main as cli
from tautwave.errors import ConfigError, LinkError
from tautwave.link.clocks import exchange, keep_best
from tautwave.sites import path, probe
from tautwave.sites.certificates import make_authority
from tautwave.sites.datagrams import open_socket
from tautwave.sites.path import Asked, Found, parse_address, run_test, serve_tests, trace
from tautwave.sites.probe import Arrival, Heard, quantile, way_of

OFFSET_NS, RATE = 7_000_000_000_000, 40e-6


def heard(delays_ms: dict[int, float], back_ms: float = 5.0, rate_hz: float = 1000.0) -> Heard:
    """Return what an end hears whose peer's clock is `OFFSET_NS` ahead and `RATE` faster."""
    arrivals, best = [], ()
    for number, delay in delays_ms.items():
        sent = number / rate_hz
        came = round((sent + 1e-3 * delay) * 1e9)
        clock = round(sent * (1.0 + RATE) * 1e9) + OFFSET_NS
        arrivals.append(Arrival(number, clock, came))
        echo = round((sent - 1e-3 * back_ms) * 1e9)  # answered at once
        best = keep_best(best, exchange(came, clock, echo, 0))
    arrivals.sort(key=lambda one: one.came_ns)
    return Heard(tuple(arrivals), best, len(delays_ms))


def test_a_constant_delay_is_found_whatever_the_clocks_show() -> None:
    way = way_of(heard(dict.fromkeys(range(4000), 5.0)), 4000)
    assert (way.sent, way.lost, way.reordered, way.longest) == (4000, 0, 0, 0)
    assert way.rate == pytest.approx(RATE, rel=1e-3)
    for delay in (way.least, way.median, way.p99, way.greatest):
        assert delay == pytest.approx(5e-3, abs=2e-6)
    assert way.unknown == pytest.approx(5e-3, abs=1e-6)
    assert way.depth == pytest.approx(0.0, abs=2e-6)


def test_unlike_ways_enter_by_half_and_the_bound_says_so() -> None:
    way = way_of(heard(dict.fromkeys(range(4000), 15.0), back_ms=5.0), 4000)
    assert way.least == pytest.approx(10e-3, abs=2e-6)
    assert abs(15e-3 - way.least) <= way.unknown + 2e-6


def test_loss_and_order_are_counted() -> None:
    delays = {k: 5.0 for k in range(1000) if not (k == 3 or 100 <= k < 120 or k >= 990)}
    delays[500] = 7.5  # comes after 501 and 502
    way = way_of(heard(delays), 1000)
    assert (way.lost, way.longest, way.reordered) == (31, 20, 1)


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=300), st.floats(0.001, 0.999))
def test_a_quantile_is_exceeded_by_no_more_than_the_rest(values: list[float], share: float) -> None:
    found = quantile(sorted(values), share)
    assert sum(value > found for value in values) <= (1.0 - share) * len(values) + 1e-9
    assert sum(value < found for value in values) < share * len(values) + 1e-9


def test_a_trace_has_a_line_for_each_datagram() -> None:
    source = random.Random(3)
    kept = {k: 5.0 + source.random() for k in range(200) if source.random() < 0.8}
    there = back = way_of(heard(kept), 200)
    lines = trace(Found(there, back, heard(kept)), 1000.0).splitlines()
    assert lines[0] == "time_s,delay_s,lost"
    assert len(lines) == 201
    for number, line in enumerate(lines[1:]):
        at, delay, lost = line.split(",")
        assert (float(at), lost) == (number / 1000.0, str(int(number not in kept)))
        if number in kept:
            assert float(delay) == pytest.approx(1e-3 * kept[number], abs=3e-4)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("10.0.0.2", ("10.0.0.2", 7447)),
        ("lab:7000", ("lab", 7000)),
        ("lab:65535", ("lab", 65535)),
        ("[::1]:7000", ("::1", 7000)),
        ("::1", ("::1", 7447)),
    ],
)
def test_addresses(text: str, found: tuple[str, int]) -> None:
    assert parse_address(text) == found


@pytest.mark.parametrize("text", ["", ":7000", "lab:seven", "lab:65536", "lab:0"])
def test_what_is_no_address_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match="is not an address; write HOST, HOST:PORT"):
        parse_address(text)


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("keys") / "keys"
    make_authority(directory, ["master", "slave"])
    return directory


@pytest.fixture
def served(keys: Path) -> Iterator[tuple[str, list[str]]]:
    """Serve one test in a thread; give the address and, afterwards, what was said."""
    lines = serve_tests(keys, "slave", "master", ("127.0.0.1", 0), once=True)
    said = [next(lines)]
    thread = threading.Thread(target=lambda: said.extend(lines))
    thread.start()
    yield said[0].split(" at ")[1].split(",")[0], said
    thread.join(60.0)
    assert not thread.is_alive()


def test_both_ends_over_loopback(served: tuple[str, list[str]], keys: Path, tmp_path: Path) -> None:
    address, said = served
    record = tmp_path / "trace.csv"
    done = CliRunner().invoke(
        cli,
        ["link", "test", address, "--keys", str(keys), "--rate", "100", "--duration", "1",
         "--record", str(record), "--json"],
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    found = json.loads(done.output)
    for way in ("there", "back"):
        assert found[way]["sent"] == 100
        assert found[way]["lost"] == 0
        assert 0.0 <= found[way]["unknown"] < 0.5
        assert -found[way]["unknown"] <= found[way]["least"] <= found[way]["p99"]
    assert found["play_out_s"] >= 0.0
    assert len(record.read_text().splitlines()) == 101
    while len(said) < 2:
        time.sleep(0.01)
    assert said[1].startswith("master tested: 100 datagrams, 0.000% lost")


@pytest.mark.slow
def test_no_datagrams_are_a_sentence(
    served: tuple[str, list[str]], keys: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(probe, "SILENCE_S", 0.2)
    monkeypatch.setattr(path, "DataPort", Mute)
    with pytest.raises(LinkError, match="no datagram from the other site arrived for"):
        run_test(served[0], keys, "master", "slave", Asked(100.0, 1.0))
    # so that the fixture's one test takes place
    monkeypatch.undo()
    run_test(served[0], keys, "master", "slave", Asked(100.0, 1.0))


@pytest.mark.slow
def test_who_dials_and_is_gone_at_once_ends_nothing(
    served: tuple[str, list[str]], keys: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(probe, "SILENCE_S", 60.0)  # a loaded machine
    for _ in range(3):
        with socket.create_connection(parse_address(served[0])) as gone:
            gone.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    run_test(served[0], keys, "master", "slave", Asked(100.0, 1.0))


class Mute(path.DataPort):
    """A firewall that lets no datagram out."""

    def send(self, payload: bytes) -> None:
        """Drop it."""


def test_a_report_without_numbers_is_a_sentence() -> None:
    ours = heard(dict.fromkeys(range(1000), 5.0))
    good = way_of(ours, 1000)._asdict()
    for said in ({}, {"way": 5}, {"way": good | {"least": None}}, {"way": good | {"more": 1}}):
        channel: Any = SimpleNamespace(send=lambda _: None, receive=lambda _, said=said: said)
        with pytest.raises(LinkError, match="did not report what it received"):
            path._swap(channel, ours, Asked(1000.0, 1.0))


def test_a_taken_port_is_a_sentence(keys: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        address = taken.getsockname()[:2]
        with pytest.raises(
            LinkError, match=f"TCP port {address[1]} at 127.0.0.1: Address already in use"
        ):
            next(serve_tests(keys, "slave", "master", address))


def test_datagrams_ask_routers_to_be_forwarded_first():
    with open_socket("127.0.0.1", 0) as sock:
        assert sock.getsockopt(socket.IPPROTO_IP, socket.IP_TOS) == 0xB8  # RFC 3246: 46 << 2


def test_the_table_of_a_path_is_in_milliseconds_and_shares() -> None:
    way = probe.Way(1000, 5, 20, 3, 0.010, 0.012, 0.015, 0.025, 0.040, 1e-6, 1e-5, 1e-6)
    lines = [line.split() for line in path.table(Found(way, way, heard({})), "left", "right")]
    shown = {
        " ".join(words[:-4]) if words[-1] == "ms" else " ".join(words[:-2]): words
        for words in lines
    }
    assert shown["lost"][-1] == "0.500%"
    assert shown["reordered"][-1] == "2.000%"
    assert [shown[name][-2] for name in ("delay least", "median", "p99", "p99.9", "greatest")] == [
        "10.000",
        "12.000",
        "15.000",
        "25.000",
        "40.000",
    ]
