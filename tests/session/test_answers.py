"""What a person may answer, and what the gentle stages of an acceptance leave to an axis."""

from __future__ import annotations

import math
import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.config import load_rig
from tautwave.config.shipped import shipped_folder
from tautwave.errors import ConfigError
from tautwave.rig.arms import load_reserves
from tautwave.session.acceptance.accepting import coupled_rig
from tautwave.session.acceptance.day import Acceptance
from tautwave.session.guided.answers import Declined, Misread, Typed, confirmed, number, one_of


@given(st.text(max_size=8))
def test_every_answer_is_read_asked_again_or_a_no(answer: str) -> None:
    newtons = number("N")
    for read in (confirmed, newtons, one_of("+", "-", "0"), one_of("", "r", "q")):
        try:
            value = read(answer)
        except (Declined, Misread):
            continue
        assert read is not confirmed or answer.lower() in ("", "y", "yes")
        assert read is not newtons or math.isfinite(value)


@pytest.mark.parametrize(
    ("answer", "value"),
    [
        ("1.5", 1.5), ("1,5", 1.5), ("-0,125", -0.125), ("1.234", 1.234), ("1000", 1000.0),
        ("2 N m", 2.0), ("2 Nm", 2.0), ("1e3", 1000.0), ("1234,567", 1234.567),
        ("1,000", None), ("-12,345", None), ("1,000,000", None), ("1,000.5", None),
        ("1.000,5", None), ("1 000", None), ("1 2", None), ("2 kg", None), ("2 N", None),
        ("", None), ("nan", None), ("1e999", None),
    ],
)  # fmt: skip
def test_a_number_is_never_guessed(answer: str, value: float | None) -> None:
    if value is not None:
        assert number("N m")(answer) == value
        return
    with pytest.raises(Misread, match=r"type (one number in N m|a decimal point, or no comma)"):
        number("N m")(answer)


def test_what_a_person_typed_before_a_question_starts_nothing() -> None:
    ours, theirs = os.openpty()
    try:
        typed = Typed(theirs)
        typed.ask(0)
        os.write(ours, b"\n\n\n")  # three times Enter, for one question
        assert typed.take(0) == ""
        typed.ask(0)
        assert typed.take(0) is None
        os.write(ours, b"30\n")
        assert typed.take(0) == "30"
    finally:
        os.close(ours)
        os.close(theirs)


def test_a_terminal_that_hung_up_is_the_end_of_the_input() -> None:
    ours, theirs = os.openpty()
    typed = Typed(theirs)
    os.close(ours)
    try:
        typed.ask(0)
        with pytest.raises(ConfigError, match="end of input"):
            typed.take(0)
        typed.ask(0)  # another question of the same walk
        assert not typed.more()
    finally:
        os.close(theirs)


def test_lines_of_a_program_are_kept_for_their_questions() -> None:
    ours, theirs = os.pipe()
    os.write(theirs, b"\n+\n")
    os.close(theirs)
    typed = Typed(ours)
    for answer in ("", "+"):
        typed.ask(0)
        assert typed.take(0) == answer
    os.close(ours)


@pytest.mark.parametrize(
    "name",
    [
        "bench-1dof-loopback",
        "arms-loopback",
        pytest.param("arms/koch", marks=pytest.mark.slow),
        pytest.param("arms/openarm", marks=pytest.mark.slow),
        pytest.param("arms/openarm-bimanual", marks=pytest.mark.slow),
        pytest.param("so101-hls-sim", marks=pytest.mark.slow),
    ],
)
@pytest.mark.parametrize("stage", ["gentle", "walls"])
def test_gentle_axes_still_carry_their_loads(name: str, stage: str) -> None:
    path = shipped_folder() / f"{name}.yaml"
    whole = load_rig(path, choose=False)
    reserves = load_reserves(whole)
    rig = coupled_rig(stage, Acceptance(path, (), (stage,), 1.0, "me"))
    if rig is None:
        assert stage == "walls"
        return
    assert load_reserves(rig) == reserves  # and refuses none
    for axis, keys in rig.axes.items():
        load, limit = reserves.get(axis, 0.0), whole.axes[axis].effort_limit
        assert keys.effort_limit - load <= max(0.1 * (limit - load), 0.14 * load) * (1 + 1e-9)
        assert keys.effort_limit >= load
