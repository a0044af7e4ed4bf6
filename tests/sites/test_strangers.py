"""Strangers at a serving site: they hold up nobody, whatever they say and wherever they are."""

from __future__ import annotations

import itertools
import queue
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import pytest

from tautwave.errors import LinkError
from tautwave.sites import reception
from tautwave.sites.certificates import identity_files, make_authority
from tautwave.sites.control import (
    DroppedError,
    Meeting,
    client_context,
    dial,
    meeting,
    server_context,
)
from tautwave.sites.path import Asked, run_test, serve_tests
from tautwave.sites.reception import Outcome, Reasons, Reception
from tests.lab.strangers import shares
from tests.lab.strangers.crowd import HOST, KINDS, client_hello

SHARED = {"rate_hz": 1000.0}
HELD = {"silent": b"", "garbage": b"x" * 30, "half a handshake": client_hello()}
"""What strangers said who then stay."""


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("keys")
    for whose in ("ours", "theirs"):
        make_authority(directory / whose, ["master", "slave"])
    return directory / "ours"


class Serving:
    """A site that serves: its port, and what came of each connection."""

    def __init__(self, keys: Path) -> None:
        self.found: queue.SimpleQueue[Outcome] = queue.SimpleQueue()
        self._context = server_context(identity_files(keys, "slave"))
        self._dialling = client_context(identity_files(keys, "master"))
        self.listener = reception.serve_at(HOST, 0)
        self.address: tuple[str, int] = self.listener.getsockname()
        self.reception = Reception(self.listener, self._meet, self.found.put)

    def _meet(self, connection: socket.socket) -> Meeting:
        return meeting(connection, self._context, "master", SHARED, {})

    def gets_in(self) -> None:
        """Dial as the right peer; raises a LinkError where it does not get in."""
        channel, session = dial(self.address, self._dialling, "slave", SHARED, {})
        while True:
            found = self.found.get(timeout=60.0)
            if not isinstance(found, LinkError):
                assert found[1].id == session.id
                found[0].close()
                channel.close()
                return

    def why(self, text: str) -> None:
        """Wait until a connection ended for that reason."""
        while text not in str(self.found.get(timeout=60.0)):
            pass


@pytest.fixture
def serving(keys: Path) -> Iterator[Serving]:
    site = Serving(keys)
    with site.listener, site.reception:
        yield site


@pytest.fixture
def come(serving: Serving) -> Iterator[Callable[..., socket.socket]]:
    with ExitStack() as stack:

        def connect(said: bytes, source: str = HOST) -> socket.socket:
            address = serving.address
            stranger = socket.create_connection(address, source_address=(source, 0))
            stranger.sendall(said)
            return stack.enter_context(stranger)

        yield connect


@pytest.mark.parametrize("source", [HOST, pytest.param("127.0.0.9", marks=pytest.mark.slow)])
@pytest.mark.parametrize("said", HELD.values(), ids=HELD)
def test_who_stays_without_a_certificate_keeps_nobody_out(
    serving: Serving, come: Callable[..., socket.socket], said: bytes, source: str
) -> None:
    for _ in range(40):
        come(said, source)
    serving.gets_in()


@pytest.mark.parametrize("said", HELD.values(), ids=HELD)
def test_of_too_many_the_oldest_make_way(
    serving: Serving, come: Callable[..., socket.socket], said: bytes,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr(reception, "MAX_AT_ONCE", 4)
    first = come(said)
    for _ in range(4):
        come(said)
    serving.why("showed no certificate; the oldest of them are closed")
    first.settimeout(60.0)
    with suppress(ConnectionResetError):
        while first.recv(4096):
            pass


def test_a_byte_now_and_then_buys_no_time(
    serving: Serving, come: Callable[..., socket.socket], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reception, "PATIENCE_S", 0.05)
    dripping = come(b"x" * 30)
    with pytest.raises(OSError, match=r"reset|Broken pipe"):  # noqa: PT012
        while True:
            dripping.sendall(b"x")
            threading.Event().wait(0.002)


def guest(address: str, since: float, *, begun: bool, leaving: bool = False) -> Any:
    made = reception._Guest(address, 0, None, since)  # type: ignore[arg-type]
    made.begun, made.wish = begun, reception.Wish(leaving=leaving)
    return made


def test_who_makes_way_is_who_failed_then_who_is_quiet_then_who_comes_from_the_crowd() -> None:
    now = 10.0
    best_first = [
        (guest("a", 9.9, begun=True), 1),  # the right peer, from an address of its own
        (guest("b", 9.9, begun=False), 9),  # not yet heard, from an address of many
        (guest("b", 9.0, begun=True), 9),  # the same, older
        (guest("a", 9.4, begun=False), 1),  # nothing for half a second
        (guest("a", 9.9, begun=True, leaving=True), 1),
    ]
    ranks = [one.rank(now, many) for one, many in best_first]
    assert all(one < two for one, two in itertools.pairwise(ranks))


@pytest.mark.slow
def test_without_descriptors_strangers_make_way(keys: Path) -> None:
    """A server that may open few files is not stopped by as many strangers."""
    code = (
        "import resource, sys; "
        "resource.setrlimit(resource.RLIMIT_NOFILE, (24, 24)); "
        "from pathlib import Path; from tautwave.sites.path import serve_tests; "
        "[print(line, flush=True) for line in "
        "serve_tests(Path(sys.argv[1]), 'slave', 'master', ('127.0.0.1', 0), once=True)]"
    )
    server = subprocess.Popen([sys.executable, "-c", code, str(keys)], stdout=subprocess.PIPE)
    try:
        assert server.stdout is not None
        address = server.stdout.readline().decode().split(" at ")[1].split(",")[0]
        host, port = address.split(":")
        with ExitStack() as stack:
            for _ in range(40):
                stack.enter_context(socket.create_connection((host, int(port))))
            run_test(address, keys, "master", "slave", Asked(100.0, 1.0))
    finally:
        server.kill()
        server.communicate()


def test_reasons_are_told_once_and_only_so_many() -> None:
    reasons = Reasons()
    assert reasons.is_news(LinkError("10.0.0.1:5: it does not speak TLS"))
    assert not reasons.is_news(LinkError("10.0.0.2:6: it does not speak TLS"))
    told = sum(reasons.is_news(LinkError(f"10.0.0.1:5: TLS failed ({k})")) for k in range(100))
    assert told == reception.MAX_REASONS - 1


def test_the_dialling_side_says_that_the_port_is_crowded(keys: Path) -> None:
    context = client_context(identity_files(keys, "master"))
    with socket.create_server((HOST, 0)) as full:

        def refuse() -> None:
            connection, _ = full.accept()
            connection.recv(1)
            connection.close()

        thread = threading.Thread(target=refuse)
        thread.start()
        with pytest.raises(DroppedError, match="too many connections at its port, or another"):
            dial(full.getsockname(), context, "slave", SHARED, {})
        thread.join()


@pytest.mark.slow
def test_one_stranger_does_not_keep_a_test_of_the_path_out(keys: Path) -> None:
    lines = serve_tests(keys, "slave", "master", (HOST, 0), once=True)
    address = next(lines).split(" at ")[1].split(",")[0]
    with ExitStack() as stack:
        thread = threading.Thread(target=lambda: list(lines))
        thread.start()
        host, port = address.split(":")
        for said in HELD.values():
            stranger = stack.enter_context(socket.create_connection((host, int(port))))
            stranger.sendall(said)
        found = run_test(address, keys, "master", "slave", Asked(100.0, 1.0))
        assert found.there.sent == 100
        thread.join(60.0)
    assert not thread.is_alive()


@pytest.mark.slow
@pytest.mark.realtime
@pytest.mark.parametrize("kind", KINDS)
def test_the_right_site_gets_in_among_a_hundred_strangers(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shares, "SOURCES", ("own",))
    monkeypatch.setattr(shares, "WITHIN_S", 60.0)  # how soon is for `tests.lab`
    (table,) = shares.measure(["site"], [kind], [100], 2).tables
    assert [row[4] for row in table.rows] == [1.0]
