"""The relay between two programs: what it loses, repeats and delays is what it says."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from tautwave.errors import ConfigError, DriverError
from tautwave.models.network import LOST, network_params, seeded, transit
from tautwave_sim.network import NetworkOptions, Relay, Way, bench, read_trace, simulator


@contextmanager
def relayed(to: tuple[str, int], **options: Any) -> Iterator[Relay]:
    relay = Relay(
        NetworkOptions(to=f"{to[0]}:{to[1]}", listen="127.0.0.1:0", **options)  # type: ignore[arg-type]
    )
    ended = threading.Event()
    thread = threading.Thread(target=relay.run, args=(ended.is_set,))
    thread.start()
    try:
        yield relay
    finally:
        ended.set()
        thread.join()
        relay.close()


def udp() -> socket.socket:
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.bind(("127.0.0.1", 0))
    sock.settimeout(0.3)
    return sock


def heard(sock: socket.socket, count: int) -> list[int]:
    """Return the datagrams that come: `count` however late, and any that follow at once."""
    sock.settimeout(30.0)
    found = [int(sock.recv(100)) for _ in range(count)]
    sock.settimeout(0.05)
    with suppress(TimeoutError):
        while True:
            found.append(int(sock.recv(100)))
    return found


def take(way: Way, sent: int) -> None:
    """Wait until a relay has taken so many datagrams: a busy machine's buffers are soon full."""
    while way.sent < sent:
        time.sleep(1e-3)


@pytest.mark.slow
def test_datagrams_pass_both_ways_and_losses_are_those_drawn() -> None:
    with (
        udp() as server,
        udp() as client,
        relayed(server.getsockname(), loss=0.3, burst=4.0, duplicate=0.1, seed=5) as relay,
    ):
        there, back = relay.ways
        for number in range(300):
            client.sendto(b"%d" % number, relay.address)
            take(there, number - 20)
        take(there, 300)
        count = 300 - there.lost + there.repeated
        came = heard(server, count)
        assert there.sent == 300
        assert len(came) == count
        assert sorted(set(came)) == kept(300, loss=0.3, burst=4.0, duplicates=0.1, seed=5)
        server.settimeout(0.1)
        while True:
            client.sendto(b"1000", relay.address)
            with suppress(TimeoutError):
                _, address = server.recvfrom(100)
                break
        for number in range(50):
            server.sendto(b"%d" % number, address)
        take(back, 50)
        count = 50 - back.lost + back.repeated
        assert len(heard(client, count)) == count


def kept(count: int, seed: int, **network: Any) -> list[int]:
    """Return the numbers that the model itself lets through."""
    params = network_params(0.0, **network)
    one, two = seeded(seed, 0)
    losing, last, found = False, 0, []
    for number in range(count):
        one, two, losing, last, arrival, _ = transit(params, one, two, losing, last, number)
        if arrival != LOST:
            found.append(number)
    return found


def test_a_datagram_is_late_by_delay_and_jitter() -> None:
    way = Way(network_params(0.02, jitter=0.01), 1, 0)
    late = [at - k for k in range(0, 10**9, 10**6) for at in way.arrivals(k)]
    assert 20e6 <= min(late) < 20.1e6
    assert 29.9e6 < max(late) <= 30e6


def test_the_delay_is_real_time() -> None:
    with udp() as server, udp() as client, relayed(server.getsockname(), delay_s=0.05) as relay:
        start = time.monotonic()
        client.sendto(b"1", relay.address)
        assert heard(server, 1) == [1]
        assert time.monotonic() - start >= 0.05


def test_a_connection_passes_whole_and_its_end_too() -> None:
    content = bytes(range(256)) * 2000
    with (
        socket.create_server(("127.0.0.1", 0)) as server,
        relayed(server.getsockname(), delay_s=0.01, loss=0.3) as relay,
        socket.create_connection(relay.address) as client,
    ):
        connection, _ = server.accept()
        sending = threading.Thread(target=client.sendall, args=(content,))
        sending.start()
        with connection:
            connection.settimeout(60.0)
            got = b""
            while len(got) < len(content):
                got += connection.recv(65536)
            sending.join()
            assert got == content
            connection.sendall(b"answer")
            client.settimeout(60.0)
            assert client.recv(100) == b"answer"
            client.shutdown(socket.SHUT_WR)
            assert connection.recv(100) == b""


def test_of_a_connection_that_ended_both_ways_nothing_stays_open() -> None:
    with (
        socket.create_server(("127.0.0.1", 0)) as server,
        relayed(server.getsockname()) as relay,
        socket.create_connection(relay.address) as client,
    ):
        connection, _ = server.accept()
        with connection:
            for end in (client, connection):
                end.settimeout(30.0)
            client.shutdown(socket.SHUT_WR)
            assert connection.recv(100) == b""
            ours = relay._open[2:]  # behind the port's own two
            assert [sock.fileno() >= 0 for sock in ours] == [True, True]
            connection.sendall(b"answer")
            assert client.recv(100) == b"answer"
            connection.shutdown(socket.SHUT_WR)
            assert client.recv(100) == b""
        limit = time.monotonic() + 10.0
        while any(sock.fileno() >= 0 for sock in ours) and time.monotonic() < limit:
            time.sleep(1e-3)
        assert [sock.fileno() for sock in ours] == [-1, -1]


def test_a_relay_announces_itself_and_at_its_end_what_it_lost() -> None:
    with udp() as server, udp() as client:
        to = "{}:{}".format(*server.getsockname())
        reported: list[Any] = []
        sent = iter(range(200))

        def stopped() -> bool:
            host, port = reported[0]["endpoint"].split(":")
            if next(sent, None) is None:
                return True
            client.sendto(b"1", (host, int(port)))
            return False

        assert simulator.serve is not None
        options = NetworkOptions(to=to, loss=0.4, seed=3)
        simulator.serve(*bench(options), reported.append, stopped)
    begin, end = reported
    assert (begin["driver"], begin["to"]) == ("network", to)
    assert end["sent"][1] == end["lost"][1] == 0  # nobody answered
    assert 0.2 < end["lost"][0] / end["sent"][0] < 0.6
    assert end["repeated"] == [0, 0]


def test_a_connection_to_nobody_is_closed_and_the_next_one_may_find_somebody() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = server.getsockname()
    with relayed(address) as relay:
        with socket.create_connection(relay.address, timeout=60.0) as client:
            assert client.recv(1) == b""
        with (
            socket.create_server(address) as server,
            socket.create_connection(relay.address, timeout=60.0) as client,
        ):
            client.sendall(b"1")
            connection, _ = server.accept()
            with connection:
                assert connection.recv(1) == b"1"


def test_what_cannot_be_is_a_sentence() -> None:
    with pytest.raises(ConfigError, match=r"--to 'lab' is not HOST:PORT"):
        Relay(NetworkOptions(to="lab"))  # type: ignore[call-arg]
    with pytest.raises(ConfigError, match=r"--to nowhere\.invalid:1: "):
        Relay(NetworkOptions(to="nowhere.invalid:1"))  # type: ignore[call-arg]
    with pytest.raises(ConfigError, match="raise --burst"):
        bench(NetworkOptions(to="a:1", loss=0.5, burst=1.0))  # type: ignore[call-arg]
    with pytest.raises(ConfigError, match="not a bus of a rig"):
        simulator.make(None, None, (), None)  # type: ignore[arg-type]
    with socket.create_server(("127.0.0.1", 0)) as taken:
        listen = f"127.0.0.1:{taken.getsockname()[1]}"
        with pytest.raises(DriverError, match="Address already in use"):
            Relay(NetworkOptions(to="127.0.0.1:9", listen=listen))  # type: ignore[call-arg]


def test_a_recorded_path_comes_back(tmp_path: Path) -> None:
    trace = tmp_path / "trace.csv"
    trace.write_text("time_s,delay_s,lost\n0,0.010,0\n0.001,0,1\n")
    table = read_trace(str(trace))
    way = Way(network_params(0.0), 0, 0, table)
    assert [way.arrivals(at) for at in (0, 1_000_000, 2_000_000)] == [
        [10_000_000], [], [12_000_000],
    ]  # fmt: skip
    assert (way.sent, way.lost, way.repeated) == (3, 1, 0)


def test_a_trace_and_drawn_delays_exclude_each_other_and_a_missing_one_is_named() -> None:
    with pytest.raises(ConfigError, match="leave out --delay-s, --loss"):
        bench(NetworkOptions(to="127.0.0.1:1", trace="t.csv", loss=0.1, delay_s=0.1))
    with pytest.raises(ConfigError, match=r"--trace /nowhere/.*: No such file"):
        read_trace("/nowhere/t.csv")


def test_a_datagram_that_is_due_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """The relay looks at its sockets for no longer than until the next one is due."""
    monkeypatch.setattr("tautwave_sim.network.time.monotonic_ns", lambda: 1_000_000)
    relay = Relay(NetworkOptions(to="127.0.0.1:9", listen="127.0.0.1:0"))
    waited: list[float] = []
    done: list[int] = []
    relay._waiting = [(500_000, 0, lambda: done.append(0)), (4_000_000, 1, lambda: done.append(1))]
    select = relay._ready.select
    monkeypatch.setattr(relay._ready, "select", lambda s: (waited.append(s), select(0.0))[1])
    try:
        relay.run(lambda: len(waited) == 2)
    finally:
        relay.close()
    assert waited == pytest.approx([0.0, 3e-3])
    assert done == [0]
