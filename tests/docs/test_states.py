"""The drawing of an operated rig's states is that of its table."""

from __future__ import annotations

from pathlib import Path

import pytest

from tautwave.runtime.operate import states as st

PICTURE = Path(__file__).parents[2] / "docs" / "_static" / "states.svg"


@pytest.fixture(autouse=True)
def _tools(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(PICTURE.parents[1])


def test_the_states_are_drawn_as_their_table_has_them() -> None:
    from _tools.states import drawing

    assert PICTURE.read_text(encoding="utf-8") == drawing()
    drawn = drawing()
    for word in (*st.COMMANDS, *st.EVENTS):
        assert word in drawn


def test_a_transition_that_is_new_in_the_table_cannot_be_left_out() -> None:
    from _tools.states import BESIDE

    words = (st.STOP, st.FAULT, st.SCALE, st.PARTED)
    left_to_words = {(state, after) for (state, word), after in st.TRANSITIONS.items()
                     if word in words} | {(st.CLUTCHED, st.IDLE)}  # fmt: skip
    everything = {(state, after) for (state, _), after in st.TRANSITIONS.items()}
    assert everything - left_to_words <= set(BESIDE)
