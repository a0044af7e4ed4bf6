"""The control plane between two real sockets: who gets in, and what is said to who does not."""

from __future__ import annotations

import datetime
import queue
import socket
import ssl
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.errors import LinkError
from tautwave.sites import certificates
from tautwave.sites.certificates import identity_files, make_authority
from tautwave.sites.control import (
    Meeting,
    client_context,
    dial,
    differences,
    meeting,
    server_context,
)  # fmt: skip
from tautwave.sites.reception import Outcome, Reception

SHARED = {"rate_hz": 1000.0, "pairs": {"lever": {"wave_impedance": 0.05}}}


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("keys")
    make_authority(directory / "ours", ["master", "slave", "clinic"])
    make_authority(directory / "theirs", ["master", "slave"])
    return directory


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server


def caught(call: Callable[[], Any]) -> Outcome:
    try:
        return call()  # type: ignore[no-any-return]
    except LinkError as err:
        return err


def meet(
    listener: socket.socket,
    serving: Callable[[socket.socket], Meeting],
    dialling: Callable[[tuple[str, int]], Any],
) -> tuple[Outcome, Outcome]:
    """Run both ends; return what each made of it: (serving, dialling)."""
    found: queue.SimpleQueue[Outcome] = queue.SimpleQueue()
    with Reception(listener, serving, found.put):
        dialled = caught(lambda: dialling(listener.getsockname()))
        return found.get(timeout=60.0), dialled


def serving(
    directory: Path, peer: str = "master", shared: Mapping[str, Any] = SHARED
) -> Callable[[socket.socket], Meeting]:
    context = server_context(identity_files(directory, "slave"))
    return lambda connection: meeting(connection, context, peer, shared, {"port": 1})


def dialling(
    directory: Path, site: str = "master", peer: str = "slave", shared: Mapping[str, Any] = SHARED
) -> Callable[[tuple[str, int]], Any]:
    context = client_context(identity_files(directory, site))
    return lambda address: dial(address, context, peer, shared, {"port": 2})


def test_two_sites_agree_and_talk(listener: socket.socket, keys: Path) -> None:
    one, two = meet(listener, serving(keys / "ours"), dialling(keys / "ours"))
    assert isinstance(one, tuple), one
    assert isinstance(two, tuple), two
    (there, served), (here, dialled) = one, two
    assert (served.id, served.secret) == (dialled.id, dialled.secret)
    assert (served.peer, served.facts) == ("master", {"port": 2})
    assert (dialled.peer, dialled.facts) == ("slave", {"port": 1})
    here.send({"event": "engage"})
    here.send({"event": "stop", "why": "Ctrl-C"})
    assert there.receive() == {"event": "engage"}
    assert there.receive() == {"event": "stop", "why": "Ctrl-C"}
    with pytest.raises(LinkError, match=r"no message within 0\.01 s"):
        there.receive(0.01)
    here.close()
    with pytest.raises(LinkError, match="closed the connection"):
        there.receive()
    there.close()


@pytest.mark.slow
def test_each_session_is_drawn_anew(listener: socket.socket, keys: Path) -> None:
    found = set()
    for _ in range(3):
        one, two = meet(listener, serving(keys / "ours"), dialling(keys / "ours"))
        assert isinstance(one, tuple)
        assert isinstance(two, tuple)
        found.add((one[1].id, one[1].secret))
        one[0].close()
        two[0].close()
    assert len(found) == 3


def sentences(one: Outcome, two: Outcome) -> tuple[str, str]:
    assert isinstance(one, LinkError), one
    assert isinstance(two, LinkError), two
    return str(one), str(two)


def test_another_authority_is_refused_on_both_sides(listener: socket.socket, keys: Path) -> None:
    one, two = sentences(*meet(listener, serving(keys / "ours"), dialling(keys / "theirs")))
    assert "it does not trust the authority of our certificate" in one
    assert "its certificate was not issued by our authority" in two


def test_the_certificate_of_another_site_is_refused_on_both_sides(
    listener: socket.socket, keys: Path
) -> None:
    clinic = dialling(keys / "ours", "clinic")
    one, two = sentences(*meet(listener, serving(keys / "ours"), clinic))
    assert "its certificate belongs to clinic, not to master" in one
    assert "refused: your certificate belongs to clinic, but master is expected here" in two
    wrong = dialling(keys / "ours", peer="clinic")
    one, two = sentences(*meet(listener, serving(keys / "ours"), wrong))
    assert "it refused our certificate: another name than it expects" in one
    assert "clinic at 127.0.0.1" in two
    assert "its certificate belongs to another site" in two


def test_an_expired_certificate_is_refused_on_both_sides(
    listener: socket.socket, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    past = datetime.datetime.now(datetime.UTC) - datetime.timedelta(days=400)
    clock = SimpleNamespace(now=lambda zone: past)
    shifted = SimpleNamespace(datetime=clock, timedelta=datetime.timedelta, UTC=datetime.UTC)
    monkeypatch.setattr(certificates, "datetime", shifted)
    make_authority(tmp_path / "old", ["master", "slave"], days=365)
    one, two = sentences(*meet(listener, serving(tmp_path / "old"), dialling(tmp_path / "old")))
    assert "it reports that our certificate has expired; create new keys" in one
    assert "its certificate has expired; create new keys" in two


def test_a_certificate_of_the_future_names_the_clock_on_both_sides(
    listener: socket.socket, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    later = datetime.datetime.now(datetime.UTC) + datetime.timedelta(days=4)
    clock = SimpleNamespace(now=lambda zone: later)
    shifted = SimpleNamespace(datetime=clock, timedelta=datetime.timedelta, UTC=datetime.UTC)
    monkeypatch.setattr(certificates, "datetime", shifted)
    make_authority(tmp_path / "new", ["master", "slave"])
    one, two = sentences(*meet(listener, serving(tmp_path / "new"), dialling(tmp_path / "new")))
    assert "or by its clock not valid yet" in one
    assert "its certificate is not valid yet; compare the clocks" in two
    assert f"here it is {datetime.datetime.now(datetime.UTC):%Y}" in two


def test_no_ticket_lets_a_site_in_again(listener: socket.socket, keys: Path) -> None:
    context = client_context(identity_files(keys / "ours", "master"))
    sessions: list[ssl.SSLSession | None] = []
    with Reception(listener, serving(keys / "ours"), lambda _: None):
        for _ in range(2):
            plain = socket.create_connection(listener.getsockname())
            known = sessions[-1] if sessions else None
            with context.wrap_socket(plain, server_hostname="slave", session=known) as secured:
                secured.sendall(b"{}\n")
                secured.recv(1000)  # with it tickets would have come
                sessions.append(secured.session)
                assert not secured.session_reused
    assert sessions[0] is None or not sessions[0].has_ticket


def test_a_site_without_a_certificate_is_refused_on_both_sides(
    listener: socket.socket, keys: Path
) -> None:
    context = client_context(identity_files(keys / "ours", "master"))
    bare = type(context)(context.protocol)
    bare.load_verify_locations(keys / "ours" / "authority.pem")
    one, two = sentences(
        *meet(listener, serving(keys / "ours"), lambda at: dial(at, bare, "slave", SHARED, {}))
    )
    assert "it has no certificate" in one
    assert "it requires a certificate and received none" in two


def test_what_is_no_tls_is_refused(listener: socket.socket, keys: Path) -> None:
    def shout(address: tuple[str, int]) -> None:
        with socket.create_connection(address) as plain:
            plain.sendall(b"GET / HTTP/1.1\r\n\r\n" * 4)
            with suppress(OSError):
                plain.recv(100)

    one, _ = meet(listener, serving(keys / "ours"), shout)
    assert "it speaks HTTP instead of TLS 1.3" in str(one)


def test_rigs_that_differ_are_refused_key_by_key(listener: socket.socket, keys: Path) -> None:
    other = {"rate_hz": 2000.0, "pairs": {"lever": {"wave_impedance": 0.05}}, "name": "x"}
    one, two = sentences(
        *meet(listener, serving(keys / "ours"), dialling(keys / "ours", shared=other))
    )
    assert 'the rigs differ: name: nothing here, "x" there; rate_hz: 1000.0 here, 2000.0' in one
    assert 'refused: the rigs differ: name: "x" here, nothing there' in two


@pytest.mark.parametrize(
    ("sent", "sentence"),
    [
        (b"\xff\xfe\n", "sent an invalid message"),
        (b"[1, 2]\n", "sent an invalid message"),
        (b"[" * 30000 + b"\n", "sent an invalid message"),
        (b'{"protocol": NaN}\n', "sent an invalid message"),
        (b'{"protocol": 1e999}\n', "sent an invalid message"),
        (b'{"protocol": 1' + b"0" * 400 + b"}\n", "sent an invalid message"),
        (b"{}\n", "protocol None there, 1 here"),
        (b"x" * 70000, "sent a message of over 65536 bytes"),
    ],
)
def test_bad_messages_are_a_sentence(
    listener: socket.socket, keys: Path, sent: bytes, sentence: str
) -> None:
    context = client_context(identity_files(keys / "ours", "master"))

    def speak(address: tuple[str, int]) -> None:
        plain = socket.create_connection(address)
        with context.wrap_socket(plain, server_hostname="slave") as secured:
            secured.sendall(sent)
            secured.recv(100)

    def quietly(address: tuple[str, int]) -> None:
        with suppress(OSError):
            speak(address)

    one, _ = meet(listener, serving(keys / "ours"), quietly)
    assert sentence in str(one)


def test_nobody_there_is_a_sentence(keys: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = server.getsockname()
    with pytest.raises(LinkError, match="connection refused; start the other site first"):
        dialling(keys / "ours")(address)


def test_files_that_do_not_go_together_are_refused(keys: Path, tmp_path: Path) -> None:
    files = identity_files(keys / "ours", "master")
    other = identity_files(keys / "theirs", "master")
    with pytest.raises(LinkError, match="do not match"):
        server_context(files._replace(key=other.key))


TABLES = st.recursive(
    st.none() | st.integers() | st.text(max_size=3),
    lambda inner: st.dictionaries(st.text(max_size=2), inner, max_size=3),
)


@given(st.dictionaries(st.text(max_size=2), TABLES, max_size=4))
def test_a_table_does_not_differ_from_itself(table: dict[str, Any]) -> None:
    assert list(differences(table, dict(table))) == []
    changed = table | {"new key": 1}
    assert list(differences(table, changed)) == ["new key: nothing here, 1 there"]
