"""YAML 1.2 core scalars, and what a rig file does not allow."""

from __future__ import annotations

import math
from typing import Any

import pytest

from tautwave.config.text.yaml12 import SyntaxProblem, parse_yaml, read_scalar


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e3", 1000.0), ("1E-3", 0.001), ("-.5", -0.5), ("+1.", 1.0), ("12", 12), ("-3", -3),
        ("012", 12), ("0x10", 16), ("0o17", 15), (".inf", math.inf), ("-.Inf", -math.inf),
        ("true", True), ("False", False), ("", None), ("~", None), ("null", None),
        ("no", "no"), ("on", "on"), ("yes", "yes"), ("12:30", "12:30"), ("1_000", "1_000"),
        ("0b11", "0b11"), ("nan", "nan"), ("inf", "inf"), ("tRue", "tRue"), ("2024-01-01",) * 2,
        ("1.2.3", "1.2.3"), ("e3", "e3"), (".", "."), ("-", "-"), ("=", "="), ("1 2", "1 2"),
    ],
)  # fmt: skip
def test_plain_scalars(text: str, value: Any) -> None:
    read = read_scalar(text)
    assert read == value
    assert type(read) is type(value)


def test_nan() -> None:
    assert math.isnan(read_scalar(".nan"))


def test_quoted_scalars_are_text() -> None:
    assert parse_yaml("[\"1\", '2', \"true\", '']").value == ["1", "2", "true", ""]


def test_keys_are_text_as_written() -> None:
    assert parse_yaml("{1: a, on: b, null: c, 1.50: d}").value == {
        "1": "a",
        "on": "b",
        "null": "c",
        "1.50": "d",
    }


def test_lines() -> None:
    marks = parse_yaml("a: 1\nb:\n  c:\n    - 1\n    - {d: 2,\n       e: 3}\n").marks
    lines = {path: mark.line for path, mark in marks.items()}
    assert lines == {
        (): 1, ("a",): 1, ("b",): 2, ("b", "c"): 3, ("b", "c", 0): 4, ("b", "c", 1): 5,
        ("b", "c", 1, "d"): 5, ("b", "c", 1, "e"): 6,
    }  # fmt: skip


@pytest.mark.parametrize("text", ["? [a]\n: 1\n", "? {a: b}\n: 1\n", "!!str a: 1\n", "&x a: 1\n"])
def test_keys_that_are_no_plain_text(text: str) -> None:
    parsed = parse_yaml(text)
    assert parsed.value == {}
    assert [problem.text for problem in parsed.problems] == [
        "a key must be plain text, without anchor, alias or tag"
    ]


def test_an_alias_bomb_does_not_go_off() -> None:
    rows = ["a0: &a0 [x, x]"]
    rows += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 30)]
    parsed = parse_yaml("\n".join(rows))
    assert len(parsed.problems) == 30 + 29 * 9
    assert parsed.value["a29"] == [None] * 9


def test_half_a_surrogate_pair() -> None:
    parsed = parse_yaml(r'name: "\ud800"')
    assert parsed.problems[0].text == "the text contains an unpaired surrogate"


@pytest.mark.parametrize("text", ["[" * 5000, "- " * 5000, "{a: " * 5000, "[" * 30 + "]" * 30])
def test_depth_is_bounded(text: str) -> None:
    with pytest.raises(SyntaxProblem, match="nested deeper than 24 levels"):
        parse_yaml(text)


@pytest.mark.parametrize(
    "text", [r'"\UFFFFFFFF"', "%YAML 3.0\n---\na", "%TAG ! !\n%TAG ! !\n--- a"]
)
def test_odd_documents(text: str) -> None:
    with pytest.raises(SyntaxProblem):
        parse_yaml(text)


def test_long_numbers() -> None:
    assert parse_yaml("9" * 5000).value == math.inf
    assert isinstance(parse_yaml("0x" + "f" * 5000).value, str)
