"""What two sites are to do: every order of commands at both, late and lost, ends in one accord."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import pytest

from tautwave.runtime.operate import states as st
from tautwave.session.sites.accord import CALMEST, Accord, knows, read_accord, settled

WORDS = (*st.COMMANDS, st.FAULT, st.BLOCKED, st.RELEASED, st.LOST)
STANDINGS = [
    st.Standing(state, faulted)
    for state in st.STATES
    for faulted in (False, True)
    if not (faulted and state in (st.ALIGNING, st.ENGAGED))
]


def given(accord: Accord, side: int, word: str) -> Accord:
    """Return what a command or event at a side makes of it; a refused one changes nothing."""
    now = accord.standing(engaged=word in (st.CLUTCH, st.SCALE))
    after = st.follow(now, word)
    if after is None:
        return accord
    return accord.changed(side, after, keep=now.state == st.CLUTCHED)


class World(NamedTuple):
    """Both ideas, and what is under way to each."""

    ideas: tuple[Accord, Accord]
    mail: tuple[tuple[Accord, ...], tuple[Accord, ...]] = ((), ())

    def says(self, side: int, idea: Accord) -> World:
        """Return it with another idea of a side, which tells the other if it is one."""
        if idea == self.ideas[side]:
            return self
        ideas = (idea, self.ideas[1]) if side == 0 else (self.ideas[0], idea)
        one, two = self.mail
        return World(ideas, (one, (*two, idea)) if side == 0 else ((*one, idea), two))

    def hears(self, side: int, *, lost: bool) -> World:
        """Return it after the first word to a side arrived, or is lost."""
        first, *rest = self.mail[side]
        mail = (tuple(rest), self.mail[1]) if side == 0 else (self.mail[0], tuple(rest))
        world = World(self.ideas, mail)
        return world if lost else world.says(side, settled(self.ideas[side], first))


def ends(world: World) -> set[World]:
    """Return everything that can come of it: words arrive in any order of sides, or are lost."""
    found, open_ = set(), [world]
    while open_:
        now = open_.pop()
        sides = [side for side in (0, 1) if now.mail[side]]
        if not sides:
            found.add(now)
        for side in sides:
            open_ += (now.hears(side, lost=lost) for lost in (False, True))
    return found


def repeated(world: World) -> tuple[Accord, Accord]:
    """Return both ideas once both have been repeated until nothing changes."""
    ideas = world.ideas
    for _ in range(4):
        ideas = settled(ideas[0], ideas[1]), settled(ideas[1], ideas[0])
    return ideas


@pytest.mark.parametrize("begin", STANDINGS, ids=str)
def test_whatever_both_command_and_whatever_is_lost_they_agree_on_the_calmest(
    begin: st.Standing,
) -> None:
    """Every state, two commands or events of each side, every order, every loss."""
    start = Accord(st.ALIGNING if begin.state == st.ENGAGED else begin.state, begin.faulted)
    for word, other in itertools.product(WORDS, WORDS):
        one, two = given(start, 0, word), given(start, 1, other)
        world = World((start, start)).says(0, one).says(1, two)
        for end in ends(world):
            first, second = repeated(end)
            assert first == second
            assert first.said == (one.said[0], two.said[1])
            if one != start and two != start:  # neither knew of the other
                calmest = min(one.state, two.state, key=CALMEST.index)
                assert first.state == calmest
                assert first.faulted == (one.faulted or two.faulted)
            assert not (first.faulted and first.state == st.ALIGNING)


@pytest.mark.slow
def test_two_changes_in_a_row_at_one_side_and_one_at_the_other_agree_too() -> None:
    for begin in STANDINGS:
        start = Accord(st.ALIGNING if begin.state == st.ENGAGED else begin.state, begin.faulted)
        worlds = {}
        for word, then, other in itertools.product(WORDS, WORDS, (st.HOLD, st.ENGAGE, st.FAULT)):
            one = given(start, 0, word)
            again, two = given(one, 0, then), given(start, 1, other)
            world = World((start, start)).says(0, one).says(0, again).says(1, two)
            worlds[world] = again, two
        for world, (again, two) in worlds.items():
            for end in ends(world):
                first, second = repeated(end)
                assert first == second
                # Nobody who let go is overruled by who did not know of it.
                if two not in (start, again) and again != start:
                    assert CALMEST.index(first.state) <= CALMEST.index(two.state)


def test_a_program_that_was_started_anew_counts_from_0_and_is_heard() -> None:
    old = Accord(st.ALIGNING, said=(5, 3))
    new = Accord(st.HOLDING, said=(0, 1))
    assert knows(old, new)
    assert settled(old, new).state == st.ALIGNING
    assert settled(old.without(1), new).state == st.HOLDING


@pytest.mark.parametrize(
    "said",
    [None, [], ["idle"], ["engaged", False, False, [0, 0]], ["idle", 0, False, [0, 0]],
     ["idle", False, False, [0, -1]], ["idle", False, False, [0, 0.5]], {"idle": 1}],
)  # fmt: skip
def test_what_is_no_accord_is_none(said: object) -> None:
    assert read_accord(said) is None


def test_an_accord_is_read_as_it_was_said() -> None:
    said = Accord(st.CLUTCHED, True, True, (3, 4))
    assert read_accord(["clutched", True, True, [3, 4]]) == said
