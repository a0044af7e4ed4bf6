"""Each sequence number passes once, in any order."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from tautwave.link.window import WIDTH, admit


@given(st.lists(st.integers(0, 300), max_size=400))
def test_it_admits_what_a_set_of_the_last_numbers_admits(numbers: list[int]) -> None:
    newest, seen = -1, 0
    known: set[int] = set()
    for number in numbers:
        new = number not in known and number > max(known, default=-1) - WIDTH
        newest, seen, admitted = admit(newest, seen, number)
        assert admitted is new
        if admitted:
            known.add(number)
        assert newest == max(known, default=-1)
        assert seen < 1 << WIDTH
