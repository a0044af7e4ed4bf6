"""Two desks, each a process: who gets in, what the other loop hears, new sessions."""

from __future__ import annotations

import json
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tautwave.bench.sites.order import free_port
from tautwave.session.sites.desk_line import DeskLine, session_of
from tautwave.sites import desk
from tautwave.sites.certificates import make_authority
from tautwave.sites.desk import Order, SessionProcess

SHARED = {"rate_hz": 1000.0}
Start = Callable[..., DeskLine]


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("keys")
    make_authority(directory / "ours", ["master", "slave"])
    make_authority(directory / "theirs", ["master", "slave"])
    return directory


@pytest.fixture
def start(keys: Path) -> Iterator[Start]:
    port = free_port()
    with ExitStack() as stack:

        def begin(site: str, shared: Any = SHARED, whose: str = "ours") -> DeskLine:
            peer = "master" if site == "slave" else "slave"
            order = Order(
                site, peer, site == "slave", "127.0.0.1", port, str(keys / whose), shared, {}
            )
            line = DeskLine(order)
            stack.callback(line.close)
            return line

        yield begin


def heard(line: DeskLine, kind: str) -> Any:
    """Return what a desk says next of a kind."""
    for _ in range(6000):  # a loaded machine
        message = line.poll()
        if message is not None and kind in message:
            return message[kind]
        time.sleep(0.01)
    raise AssertionError(f"no word of {kind!r}")


def test_two_sites_join_and_talk(start: Start) -> None:
    slave, master = start("slave"), start("master")
    one, two = session_of(heard(slave, "joined")), session_of(heard(master, "joined"))
    assert (one.id, one.secret) == (two.id, two.secret)
    master.send(send={"ready": {"lever": 0.25}})
    assert heard(slave, "peer") == {"ready": {"lever": 0.25}}


@pytest.mark.slow
def test_who_is_killed_is_missed_at_once_and_may_come_again(start: Start) -> None:
    slave, master = start("slave"), start("master")
    first = session_of(heard(slave, "joined"))
    master._desk.kill()
    assert "closed the connection" in heard(slave, "lost")
    start("master")
    again = session_of(heard(slave, "joined"))
    assert first.id != again.id
    assert first.secret != again.secret


@pytest.mark.slow
def test_a_program_that_ends_without_a_word_is_said_to_have_ended(start: Start) -> None:
    slave, master = start("slave"), start("master")
    heard(slave, "joined")
    heard(master, "joined")
    master._line.close()
    assert heard(slave, "peer") == {"left": "its program ended"}


@pytest.mark.sparse(2)
def test_a_session_that_is_given_up_is_followed_by_another(start: Start) -> None:
    slave, master = start("slave"), start("master")
    first = session_of(heard(slave, "joined"))
    heard(master, "joined")
    slave.send(renew="too much was missed")
    assert heard(slave, "lost") == "too much was missed"
    assert session_of(heard(slave, "joined")).id != first.id
    assert session_of(heard(master, "joined")).id != first.id


@pytest.mark.slow
def test_a_late_word_of_the_session_before_does_not_end_the_next_one(start: Start) -> None:
    slave, master = start("slave"), start("master")
    first = session_of(heard(slave, "joined")).id.hex()
    heard(master, "joined")
    slave.send(renew="clutched", of=first)
    heard(slave, "joined")
    heard(master, "joined")
    master.send(renew="clutched", of=first)
    master.send(send={"still": "here"})
    assert heard(slave, "peer") == {"still": "here"}


@pytest.mark.slow
def test_a_third_with_the_peers_certificate_waits_while_the_peer_is_there(start: Start) -> None:
    slave, master = start("slave"), start("master")
    heard(slave, "joined")
    heard(master, "joined")
    third = start("master")
    assert "master is already in a session here" in heard(third, "note")
    master.send(send={"still": "here"})
    assert heard(slave, "peer") == {"still": "here"}


def test_a_desk_that_stood_still_takes_nobody_for_gone(keys: Path) -> None:
    order = Order("slave", "master", True, "127.0.0.1", 1, str(keys / "ours"), SHARED, {})
    one, other = socket.socketpair()
    with one, other:
        desk = SessionProcess(order, one)
        some: Any = object()
        desk._channel, desk._heard, desk._looked = some, 100.0, 100.0
        desk.look(100.1)
        desk.look(100.3)
        assert "already in a session" in desk._taken()
        desk.look(109.0)  # stopped by its host, as was whatever the master said meanwhile
        assert "already in a session" in desk._taken()
        for now in range(10):
            desk.look(109.0 + 0.2 * now)
        assert desk._taken() == ""
        desk._wake.close()
        desk._woken.close()


@pytest.mark.slow
def test_a_site_that_says_nothing_is_dropped_and_not_before(
    keys: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(desk, "GONE_S", 0.6)
    order = Order("slave", "master", True, "127.0.0.1", 1, str(keys / "ours"), SHARED, {})
    one, other = socket.socketpair()
    end, far = socket.socketpair()
    said: list[Any] = []
    with one, other, end, far:
        kept = SessionProcess(order, one)
        silent: Any = SimpleNamespace(
            fileno=end.fileno, send=said.append, poll=lambda: None, close=lambda: None
        )
        kept._channel, kept._heard = silent, time.monotonic()
        kept._looked = kept._heard
        work = threading.Thread(target=kept._work, args=(None,))
        work.start()
        other.settimeout(30.0)
        assert json.loads(other.recv(1000)) == {"lost": "master was silent for 0.6 s"}
        assert time.monotonic() - kept._heard > 0.6
        assert said[0] == {"beat": True}
        other.close()
        work.join(30.0)
        kept._wake.close()
        kept._woken.close()


def test_a_word_too_long_for_the_loop_is_not_cut_in_two(keys: Path) -> None:
    order = Order("slave", "master", True, "127.0.0.1", 1, str(keys / "ours"), SHARED, {})
    one, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with one, other:
        desk = SessionProcess(order, one)
        desk._tell("peer", "\u00e9" * 20_000)  # of which JSON makes six times as many
        assert json.loads(other.recv(65536)) == {"note": "master sent an oversized message"}
        desk._wake.close()
        desk._woken.close()


@pytest.mark.slow
def test_whoever_closes_without_a_word_is_tried_again(keys: Path) -> None:
    # A relay that has nobody behind it yet takes a connection and ends it.
    with socket.create_server(("127.0.0.1", 0)) as relay:
        port = relay.getsockname()[1]
        order = Order("master", "slave", False, "127.0.0.1", port, str(keys / "ours"), SHARED, {})
        line = DeskLine(order)
        try:
            for _ in range(2):
                connection, _ = relay.accept()
                connection.recv(1)
                connection.close()
            said = line.poll() or {}
            assert "refused" not in said
        finally:
            line.close()


@pytest.mark.slow
def test_strangers_and_other_rigs_are_refused_with_a_sentence_on_both_sides(start: Start) -> None:
    slave = start("slave")
    stranger = start("master", whose="theirs")
    assert "authority" in heard(stranger, "refused")
    assert "authority" in heard(slave, "note")
    other = start("master", shared={"rate_hz": 500.0})
    assert "the rigs differ: rate_hz: 500.0 here, 1000.0 there" in heard(other, "refused")
    while "rate_hz: 1000.0 here, 500.0 there" not in heard(slave, "note"):
        pass
    other.close()
    stranger.close()
    start("master")
    heard(slave, "joined")
