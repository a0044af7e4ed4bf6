"""The fault plan: every kind, seeded and scripted, and the same bytes for the same seed."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from typing import Any

import pytest

from tautwave.errors import DriverError
from tautwave_sim.dynamixel import packets as p2
from tautwave_sim.wire.serial_faults import ANSWER_KINDS, PACKET_KINDS
from tests.sim.dynamixel.line import MS, Host, split, words

GOOD = [p2.status(one, 0, b"\x00\x08\x00\x00") for one in (1, 2, 3)]


def faulty(*events: dict[str, Any], **chances: Any) -> Host:
    faults = {"events": list(events), **chances}
    return Host((1, 2, 3), simulator={"factory": False, "faults": faults})


def conversation(host: Host, cycles: int = 200) -> Iterator[bytes]:
    for _ in range(cycles):
        yield host.sync_read((1, 2, 3))


def intact(response: bytes) -> list[bytes]:
    """Return which of the good packets are in an answer."""
    return [packet for packet in GOOD if packet in response]


@pytest.mark.parametrize("kind", PACKET_KINDS)
def test_a_scripted_fault_hits_the_nth_packet_of_its_servo(kind: str) -> None:
    host = faulty({"kind": kind, "nth": 3, "id": 2})
    responses = list(conversation(host, 5))
    assert [response == b"".join(GOOD) for response in responses[:2]] == [True, True]
    hit = responses[2]
    stale = GOOD[1] + GOOD[2] if kind == "late" else b""
    assert responses[3] == stale + b"".join(GOOD)
    assert responses[4] == b"".join(GOOD)
    if kind in ("lost", "deaf"):
        assert hit == GOOD[0] + GOOD[2]
    elif kind == "late":
        assert hit == GOOD[0]  # what follows the late one is late with it
    elif kind == "truncated":
        assert hit.startswith(GOOD[0])
        assert hit.endswith(GOOD[2])
        assert 0 < len(hit) - 30 < 15
    elif kind == "corrupted":
        wrong = [a ^ b for a, b in zip(hit, b"".join(GOOD), strict=True)]
        assert sum(map(bool, wrong)) == 1
        assert any(wrong[15:30])
    elif kind == "wrong_id":
        assert [packet[4] for packet in split(hit)] == [1, 3, 3]
        assert split(hit)[1] == p2.status(3, 0, b"\x00\x08\x00\x00")  # its checksum is right
    else:
        assert intact(hit) == GOOD
        assert 1 <= len(hit) - 45 <= 8


def test_a_late_answer_comes_late() -> None:
    host = faulty({"kind": "late", "nth": 1, "id": 1}, late_s=0.003)
    begin = host.clock.now_ns()
    packet = p2.frame(p2.BROADCAST, bytes((p2.SYNC_READ, *words(132), *words(4), 1, 2, 3)))
    heard = host.talk(packet, 10 * MS)
    assert heard == b"".join(GOOD)
    host = faulty({"kind": "late", "nth": 1, "id": 1}, late_s=0.003)
    host.send(packet)
    assert host.clock.wait(host.port, begin + 10 * MS)
    assert host.clock.now_ns() - begin == (len(packet) + 15) * 10_000 + 3 * MS


@pytest.mark.parametrize("kind", ANSWER_KINDS)
def test_a_fast_sync_read_suffers_too(kind: str) -> None:
    host = faulty({"kind": kind, "nth": 2, "id": 2})
    good = host.sync_read((1, 2, 3), code=p2.FAST_SYNC_READ)
    hit = host.sync_read((1, 2, 3), code=p2.FAST_SYNC_READ)
    assert hit != good
    if kind in ("lost", "truncated"):  # nobody goes on behind it
        assert good.startswith(hit)
        assert len(hit) < 24
    assert host.hear(10 * MS) == (good if kind == "late" else b"")
    assert host.sync_read((1, 2, 3), code=p2.FAST_SYNC_READ) == good


@pytest.mark.parametrize("kind", [kind for kind in PACKET_KINDS if kind != "late"])
def test_a_chance_is_kept_in_the_mean(kind: str) -> None:
    host = faulty(**{kind: 0.1})
    spoilt = 0
    for response in conversation(host, 300):
        spoilt += 3 - len(intact(response))
        if kind == "extra_bytes":
            spoilt += len(response) > 45
    share = spoilt / (900 if kind != "extra_bytes" else 300)
    expected = 0.1 if kind != "extra_bytes" else 1 - 0.9**3
    assert share == pytest.approx(expected, abs=0.05)


def test_always_late_is_a_shift() -> None:
    host = faulty(late=1.0, late_s=0.005)
    responses = list(conversation(host, 5))
    assert responses[0] == b""
    assert responses[1:] == [b"".join(GOOD)] * 4


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bytes() -> None:
    chances = dict.fromkeys(PACKET_KINDS, 0.02)

    def digest(seed: int) -> str:
        host = faulty(**chances, seed=seed, late_s=0.002)
        return hashlib.sha256(b"|".join(conversation(host, 300))).hexdigest()

    assert digest(1) == digest(1)
    assert digest(1) != digest(2)


def test_leaving_out_one_kind_shifts_no_other() -> None:
    def lost_at(**chances: float) -> list[int]:
        host = faulty(lost=0.05, **chances)
        return [k for k, response in enumerate(conversation(host, 200)) if len(response) % 15 == 0
                and len(response) < 45]  # fmt: skip

    assert lost_at() == lost_at(corrupted=0.3)


def test_a_deaf_servo_keeps_its_goal() -> None:
    host = faulty({"kind": "deaf", "nth": 5, "id": 1})
    for one in (1, 2, 3):
        host.write(one, "Goal Current", 0)
        host.write(one, "Torque Enable", 1)
    for counts in (10, 20, 30, 40):
        host.sync_write("Goal Current", {1: counts, 2: counts})
        host.hear()
    assert host.servos[1].memory.peek("Goal Current") == 40
    seen = [host.servos[0].memory.peek("Goal Current")]
    assert seen == [40]
    host = faulty({"kind": "deaf", "nth": 2, "id": 1})
    for counts in (10, 20):
        host.sync_write("Goal Current", {1: counts, 2: counts})
        host.hear()
    assert [one.memory.peek("Goal Current") for one in host.servos[:2]] == [10, 20]


def test_a_servo_leaves_the_line_and_comes_back() -> None:
    host = faulty(
        {"kind": "remove", "at_s": 0.05, "id": 2}, {"kind": "restore", "at_s": 0.1, "id": 2}
    )
    responses = [split(host.sync_read((1, 2, 3))) for _ in range(35)]
    seen = [tuple(packet[4] for packet in response) for response in responses]
    assert set(seen) == {(1, 2, 3), (1, 3)}
    assert seen[0] == seen[-1] == (1, 2, 3)
    assert seen.count((1, 3)) in (12, 13)


def test_unplugged_the_port_says_so_and_plugged_in_it_works_again() -> None:
    host = faulty({"kind": "unplug", "at_s": 0.05}, {"kind": "replug", "at_s": 0.2})
    host.send(p2.frame(1, b"\x01"))
    host.clock.sleep_until(50 * MS)
    assert host.clock.wait(host.port, 60 * MS)  # readable: the reader has to learn of it
    with pytest.raises(DriverError, match="unplugged; plug it in"):
        host.port.read()
    with pytest.raises(DriverError, match="bus test"):
        host.port.write(b"x")
    host.port.close()
    host.clock.sleep_until(250 * MS)
    assert host.ask(1, p2.PING)[:5] == p2.HEADER + b"\x01"


def test_what_was_on_the_wire_is_lost_with_the_adapter() -> None:
    host = faulty({"kind": "unplug", "at_s": 0.0001}, {"kind": "replug", "at_s": 0.0002})
    host.send(p2.frame(1, b"\x01"))
    host.clock.sleep_until(MS)
    assert host.hear() == b""


def test_a_packet_fault_at_a_moment_hits_the_next_packet_once() -> None:
    host = faulty({"kind": "lost", "at_s": 0.02})
    lengths = [len(response) for response in conversation(host, 12)]
    assert lengths.count(30) == 1
    assert lengths.count(45) == 11
    assert lengths.index(30) == 5
