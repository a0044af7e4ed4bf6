"""Mutations of a source text: each single change that a run could see, and no other."""

from __future__ import annotations

from tests.mutations import mutants_of

SOURCE = '''
"""A docstring, 1 + 1."""
LIMIT: float = 2.0


def grow(x: int = 3) -> "list[1]":
    if x < LIMIT and not x:
        raise ValueError("above 7")
    x += 1
    show(x - 1)
    return x is None
'''


def changed() -> list[tuple[str, str]]:
    """Return each mutated line beside what was done to it."""
    found = []
    for one in mutants_of("a.py", SOURCE):
        data = SOURCE.encode()
        text = (data[: one.start] + one.new.encode() + data[one.end :]).decode()
        compile(text, "a.py", "exec")
        found.append((text.splitlines()[one.line - 1].strip(), one.what))
    return found


def test_every_place_is_changed_once_and_the_text_stays_python() -> None:
    assert sorted(changed()) == sorted(
        [
            ("LIMIT: float = 2.21", "constant is a tenth more"),
            ('def grow(x: int = 4) -> "list[1]":', "constant is one more"),
            ("if (not (x < LIMIT and not x)):", "condition is negated"),
            ("if ((x < LIMIT) or (not x)):", "becomes or"),
            ("if (x) <= (LIMIT) and not x:", "comparison becomes <="),
            ("if x < LIMIT and (x):", "sign or not is left out"),
            ("pass", "statement is left out"),
            ("pass", "statement is left out"),
            ("x += 2", "constant is one more"),
            ("show(((x) + (1)))", "becomes +"),
            ("show(x - 2)", "constant is one more"),
            ("return (x) is not (None)", "comparison becomes is not"),
        ]
    )
