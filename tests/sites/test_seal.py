"""Sealed datagrams: what was sealed is opened once, and nothing else ever is."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.sites.seal import (
    FOREIGN,
    FORGED,
    HEAD,
    LATE,
    OLD_SESSION,
    OVERHEAD,
    REPEATED,
    WINDOW,
    Opener,
    Sealer,
    Window,
    direction_key,
)  # fmt: skip

SECRET, SESSION = bytes(range(32)), b"session1"


def ends(secret: bytes = SECRET, session: bytes = SESSION) -> tuple[Sealer, Opener]:
    return Sealer(secret, session, "master"), Opener(secret, session, "master")


def test_a_golden_datagram() -> None:
    # Keys and tag by an independent call of HKDF (hmac) and RFC 8439's construction.
    import hashlib
    import hmac

    prk = hmac.new(SESSION, SECRET, hashlib.sha256).digest()
    info = b"tautwave data plane 1 master"
    assert (
        direction_key(SECRET, SESSION, "master")
        == hmac.new(prk, info + b"\x01", hashlib.sha256).digest()
    )
    sealed = ends()[0].seal(b"wave")
    assert sealed[:17].hex() == "54" + SESSION.hex() + "0000000000000001"
    assert len(sealed) == OVERHEAD + 4
    assert b"wave" not in sealed


@given(st.lists(st.binary(max_size=80), min_size=1, max_size=30), st.randoms(use_true_random=False))
def test_each_datagram_is_opened_once_in_any_order(
    payloads: list[bytes], order: random.Random
) -> None:
    sealer, opener = ends()
    sent = [(sealer.seal(payload), payload) for payload in payloads]
    arriving = sent * 2
    order.shuffle(arriving)
    opened = [opener.open(datagram) for datagram, _ in arriving]
    assert sorted(p for p in opened if p is not None) == sorted(payloads)
    assert opener.accepted == len(payloads) == opener.refused[REPEATED]


@given(st.data())
def test_whatever_is_changed_is_refused(data: st.DataObject) -> None:
    sealer, opener = ends()
    sealed = bytearray(sealer.seal(data.draw(st.binary(max_size=40))))
    at = data.draw(st.integers(0, len(sealed) - 1))
    sealed[at] ^= data.draw(st.integers(1, 255))
    assert opener.open(bytes(sealed)) is None
    assert sum(opener.refused.values()) == 1


@given(st.binary(max_size=200))
def test_any_bytes_are_refused_without_an_exception(noise: bytes) -> None:
    opener = ends()[1]
    assert opener.open(noise) is None
    assert opener.accepted == 0


def test_each_refusal_has_its_reason() -> None:
    sealer, opener = ends()
    first = sealer.seal(b"a")
    assert opener.open(b"short") is None
    assert opener.open(b"\x55" + first[1:]) is None
    assert opener.open(ends(session=b"session0")[0].seal(b"a")) is None
    assert opener.open(ends(secret=bytes(32))[0].seal(b"a")) is None  # another authority's secret
    assert opener.open(Sealer(SECRET, SESSION, "slave").seal(b"a")) is None  # our own, reflected
    assert opener.open(first) == b"a"
    assert opener.open(first) is None
    for _ in range(WINDOW):
        last = sealer.seal(b"b")
    assert opener.open(last) == b"b"
    assert opener.open(first) is None
    assert opener.refused == {FOREIGN: 2, OLD_SESSION: 1, LATE: 1, REPEATED: 1, FORGED: 2}


def test_a_forged_sequence_does_not_move_the_window() -> None:
    sealer, opener = ends()
    sealed = [sealer.seal(b"%d" % k) for k in range(3)]
    ahead = HEAD.pack(0x54, SESSION, 2**63) + sealed[0][HEAD.size :]
    assert opener.open(ahead) is None
    assert [opener.open(one) for one in sealed] == [b"0", b"1", b"2"]


@given(st.lists(st.integers(0, 3 * WINDOW), max_size=60))
def test_the_window_is_a_set_of_the_last_numbers(numbers: list[int]) -> None:
    window, taken = Window(), set[int]()
    for number in numbers:
        top = max(taken, default=0)
        fresh = number > top or (number > 0 and top - number < WINDOW and number not in taken)
        assert (window.refusal(number) is None) == fresh
        if fresh:
            window.accept(number)
            taken.add(number)


def test_the_window_keeps_no_more_bits_however_long_it_runs() -> None:
    window = Window()
    for number in range(1, 3 * WINDOW):
        window.accept(number)
        assert window.seen == (1 << min(number, WINDOW)) - 1
    window.accept(window.top + WINDOW - 1)
    assert window.seen == 1 << WINDOW - 1 | 1
    window.accept(window.top + WINDOW)
    assert window.seen == 1


@given(st.lists(st.integers(1, 50), min_size=2, max_size=6))
def test_no_nonce_is_used_twice_with_a_key_over_restarts(runs: list[int]) -> None:
    used = set[tuple[bytes, bytes]]()
    source = random.Random(1)
    for count in runs:  # each start draws session and secret anew
        secret, session = source.randbytes(32), source.randbytes(8)
        for sender in ("master", "slave"):
            sealer = Sealer(secret, session, sender)
            for _ in range(count):
                pair = direction_key(secret, session, sender), sealer.seal(b"")[9:17]
                assert pair not in used
                used.add(pair)


def test_a_session_without_numbers_left_ends() -> None:
    sealer, _ = ends()
    sealer._sequence = 2**64 - 1
    with pytest.raises(OverflowError, match="no sequence number left"):
        sealer.seal(b"")
