"""The ring alone, both ends in this process."""

from __future__ import annotations

import os
import resource
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.runtime.ring import CLOSED, DROPPED, HEAD, PAGE_BYTES, TAIL, Ring

Pair = tuple[Ring, Ring]


@pytest.fixture
def pair() -> Iterator[Pair]:
    near = Ring(8, 3)
    far = Ring(8, 3, os.dup(near.descriptor))
    yield near, far
    near.close()
    far.close()


def take(ring: Ring) -> list[tuple[float, ...]]:
    """Rows published and not yet taken, with their marks."""
    rows = []
    for count in range(ring.words[TAIL], ring.words[HEAD]):
        at = count % ring.rows * ring.width
        rows.append(tuple(ring.slots[at : at + ring.width]))
    ring.words[TAIL] = ring.words[HEAD]
    return rows


def put(ring: Ring, value: float) -> bool:
    ring.row[0], ring.row[1], ring.row[2] = value, -value, 0.5
    return ring.push()


def test_rows_arrive_in_order_over_many_laps(pair: Pair) -> None:
    near, far = pair
    for lap in range(50):
        for k in range(5):
            assert put(near, lap * 5 + k)
        assert take(far) == [(v, -v, 0.5, v) for v in map(float, range(lap * 5, lap * 5 + 5))]


def test_a_full_ring_drops_and_counts_and_the_marks_show_where(pair: Pair) -> None:
    near, far = pair
    assert [put(near, k) for k in range(11)] == [True] * 8 + [False] * 3
    assert near.dropped == far.words[DROPPED] == 3
    assert [row[0] for row in take(far)] == [0, 1, 2, 3, 4, 5, 6, 7]
    assert put(near, 11)
    assert take(far) == [(11.0, -11.0, 0.5, 11.0)]
    assert near.offered == 12


def test_a_row_is_counted_only_after_it_was_copied() -> None:
    seen: list[tuple[int, float]] = []

    class Spy(Ring):
        pass

    ring = Spy(4, 3)

    class Words:
        """Stands in for the shared words and looks at the slot when HEAD is stored."""

        def __init__(self, words: memoryview[int]) -> None:
            self.words = words

        def __getitem__(self, at: int) -> int:
            return self.words[at]

        def __setitem__(self, at: int, value: int) -> None:
            if at == HEAD:
                seen.append((value, ring.slots[(value - 1) % 4 * 4]))
            self.words[at] = value

        def release(self) -> None:
            self.words.release()

    ring.words = Words(ring.words)  # type: ignore[assignment]
    for k in range(4):
        put(ring, k)
    assert seen == [(1, 0.0), (2, 1.0), (3, 2.0), (4, 3.0)]
    ring.close()


def test_a_lossless_ring_asks_for_room_and_loses_nothing(pair: Pair) -> None:
    near, far = pair
    taken: list[tuple[float, ...]] = []

    def make_room() -> bool:
        taken.extend(take(far))
        return True

    near.wait_for_room = make_room
    assert all(put(near, k) for k in range(1000))
    taken += take(far)
    assert [row[0] for row in taken] == list(range(1000))
    assert near.dropped == 0


def test_without_anybody_to_make_room_the_row_is_dropped(pair: Pair) -> None:
    near, _ = pair
    near.wait_for_room = lambda: False
    assert [put(near, k) for k in range(9)] == [True] * 8 + [False]


@given(st.lists(st.integers(-6, 6), max_size=60))
def test_what_arrives_is_what_was_accepted(moves: list[int]) -> None:
    """Positive: push so many; negative or 0: drain."""
    near = Ring(5, 3)
    far = Ring(5, 3, os.dup(near.descriptor))
    accepted, arrived, offered = [], [], 0
    for move in moves:
        for _ in range(move):
            if put(near, offered):
                accepted.append(float(offered))
            offered += 1
        if move <= 0:
            arrived += take(far)
    arrived += take(far)
    near.close()
    far.close()
    assert [row[0] for row in arrived] == accepted
    assert [row[-1] for row in arrived] == accepted
    assert len(accepted) + near.dropped == offered == near.offered


def test_pushing_touches_no_page_for_the_first_time() -> None:
    ring = Ring(4096, 60)  # 500 pages
    put(ring, 1.0)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(4000):
        ring.push()
    assert resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before < 20
    ring.close()


def test_the_memory_has_no_name_and_goes_with_the_ring() -> None:
    shared = Path("/dev/shm")
    names = set(shared.iterdir()) if shared.exists() else set()
    opened = len(os.listdir("/proc/self/fd"))
    ring = Ring(64, 3)
    assert (set(shared.iterdir()) if shared.exists() else set()) <= names
    ring.close()
    ring.close()
    assert len(os.listdir("/proc/self/fd")) == opened


def test_a_closed_ring_refuses_rows(pair: Pair) -> None:
    near, _ = pair
    put(near, 1.0)
    near.close()
    assert not near.push()
    assert not near.push()
    assert near.offered == 3


def test_words_of_the_two_sides_lie_on_lines_of_their_own() -> None:
    assert (TAIL - CLOSED) * 8 >= 64
    assert PAGE_BYTES >= 2048


def test_the_last_words_survive_any_length(pair: Pair) -> None:
    near, far = pair
    assert near.error == ""
    far.error = "the disk is full: ä"
    assert near.error == "the disk is full: ä"
    far.error = "x" * 5000
    assert near.error == "x" * 1024
