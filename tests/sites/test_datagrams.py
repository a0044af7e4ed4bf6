"""The data port among strangers: forged, mutated, replayed and old datagrams between good ones."""

from __future__ import annotations

import random
import secrets
import socket
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.errors import LinkError
from tautwave.session.sites.endpoint import MAX_AT_ONCE, Endpoint
from tautwave.sites.control import Session
from tautwave.sites.datagrams import DataPort, open_socket
from tautwave.sites.seal import HEAD, KIND, LATE, WINDOW, Sealer

HOST = "127.0.0.1"


def session(peer: str, source: random.Random) -> Session:
    return Session(source.randbytes(8), source.randbytes(32), peer, {})


@pytest.fixture
def ends() -> Iterator[tuple[socket.socket, socket.socket]]:
    with open_socket(HOST, 0) as own, open_socket(HOST, 0) as stranger:
        yield own, stranger


def hostile(source: random.Random, good: list[bytes], old: Sealer, other: Sealer) -> bytes:
    """Return a datagram that must not be accepted; `good` ones have come already."""
    kind = source.randrange(7)
    if kind == 0:
        return source.randbytes(source.randrange(0, 300))
    if kind == 1:  # one bit of an accepted one, in head, text or tag
        changed = bytearray(source.choice(good))
        changed[source.randrange(len(changed))] ^= 1 << source.randrange(8)
        return bytes(changed)
    if kind == 2:
        return source.choice(good)
    if kind == 3:
        return old.seal(source.randbytes(96))
    if kind == 4:
        return other.seal(source.randbytes(96))
    if kind == 5:
        return source.choice(good)[: source.randrange(0, 100)]
    # A number that nobody has used yet, far ahead, on an accepted text.
    ahead = HEAD.pack(KIND, good[0][1:9], source.randrange(2**32, 2**64))
    return ahead + source.choice(good)[HEAD.size :]


def attack(own: socket.socket, stranger: socket.socket, count: int) -> None:
    """Send so many hostile datagrams, a good one after each thirty; only those may be accepted."""
    source = random.Random(5)
    agreed = session("master", source)
    port = DataPort(own, agreed, "slave", None)
    sealer = Sealer(agreed.secret, agreed.id, "master")
    old = Sealer(source.randbytes(32), source.randbytes(8), "master")
    other = Sealer(source.randbytes(32), agreed.id, "master")
    to = own.getsockname()
    good = [sealer.seal(b"first")]
    stranger.sendto(good[0], to)
    got = [payload for payload, _ in port.receive(MAX_AT_ONCE)]
    sent = 0
    while sent < count:
        for _ in range(MAX_AT_ONCE - 2):
            stranger.sendto(hostile(source, good, old, other), to)
            sent += 1
        good.append(sealer.seal(b"%d" % sent))
        stranger.sendto(good[-1], to)
        good = [good[0], *good[-50:]]
        got += [payload for payload, _ in port.receive(MAX_AT_ONCE)]
    assert got == [b"first", *(b"%d" % n for n in range(30, sent + 1, 30))]
    assert sum(port.opener.refused.values()) == sent
    late = sent > 30 * 2 * WINDOW  # the first good one is older than the window by then
    assert all(number for why, number in port.opener.refused.items() if late or why != LATE)


def test_ten_thousand_hostile_datagrams(ends: tuple[socket.socket, socket.socket]) -> None:
    attack(*ends, 10_000)


@pytest.mark.slow
@pytest.mark.nightly
def test_a_million_hostile_datagrams(ends: tuple[socket.socket, socket.socket]) -> None:
    attack(*ends, 1_000_000)


def test_a_flood_costs_no_more_than_is_looked_at(
    ends: tuple[socket.socket, socket.socket],
) -> None:
    own, stranger = ends
    port = DataPort(own, session("master", random.Random(1)), "slave", None)
    for _ in range(100):
        stranger.sendto(b"x", own.getsockname())
    assert list(port.receive(MAX_AT_ONCE)) == []
    assert sum(port.opener.refused.values()) == MAX_AT_ONCE


def test_answers_go_to_where_the_newest_datagram_came_from(
    ends: tuple[socket.socket, socket.socket],
) -> None:
    own, before = ends
    agreed = session("master", random.Random(1))
    port, sealer = DataPort(own, agreed, "slave", None), Sealer(agreed.secret, agreed.id, "master")
    late, newest = sealer.seal(b"late"), sealer.seal(b"newest")
    with open_socket(HOST, 0) as now:
        now.sendto(newest, own.getsockname())
        before.sendto(late, own.getsockname())
        assert [payload for payload, _ in port.receive(MAX_AT_ONCE)] == [b"newest", b"late"]
        port.send(b"answer")
        assert now.recv(2048)


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 5)), max_size=12))
def test_no_nonce_twice_with_a_key_over_any_order_of_sessions(
    plan: list[tuple[int, int]],
) -> None:
    # A session that comes again, by whatever mistake, is not used: its numbers were.
    drawn = [Session(secrets.token_bytes(8), secrets.token_bytes(32), "slave", {}) for _ in "abcd"]
    used = set[tuple[bytes, bytes]]()
    with open_socket(HOST, 0) as own, open_socket(HOST, 0) as other:
        for start in range(2):  # of a program: only its own memory is new, and all sessions are
            endpoint = Endpoint(own, 0, 1, lambda: 0)
            for which, count in plan:
                found = drawn[which]._replace(id=bytes([start]) + drawn[which].id[1:])
                found = found._replace(secret=bytes([start]) + found.secret[1:])
                try:
                    endpoint.join(found, other.getsockname())
                except LinkError:
                    continue
                for _ in range(count):
                    endpoint.greet()
                    sealed = other.recv(2048)
                    assert (found.secret, sealed[9:17]) not in used
                    used.add((found.secret, sealed[9:17]))
