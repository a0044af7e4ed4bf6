"""Whatever the text: a rig or a ConfigError, nothing else, and no message of two lines."""

from __future__ import annotations

from hypothesis import example, given
from hypothesis import strategies as st

from tautwave.config import Rig, parse_rig
from tautwave.errors import ConfigError
from tests.config.bench import BENCH

LINES = BENCH.splitlines()
SCALARS = st.sampled_from(
    [
        "", "null", "0", "-1", "1e999", ".nan", "1e-320", "9" * 400, "no", "'x'", "[]", "{}",
        "[[]]", "{a: [1, {b: 2}]}", "*x", "&x 1", "!!int 3", "0x1F", "[1, 2, 3]", '"\\ud800"',
        '"\\0"', "at_engage", "{type: hold, position: 0}", "{type: []}", "{type: {}}",
        "{value: 1}", '{type: recording, file: "~x/\\0", column: a}',
    ]
)  # fmt: skip
FRAGMENTS = st.sampled_from(
    [
        *LINES, "  ", "- ", ": ", "? ", "| ", "> ", "{", "}", "[", "]", "---", "\t", "#", "'",
        '"', "&a ", "*a", "!!x ", "%YAML 1.2", "\n",
    ]
)  # fmt: skip


def _load(text: str, *overrides: str) -> None:
    said: tuple[str, ...] = ("",)
    try:
        rig = parse_rig(text, "rig.yaml", overrides)
    except ConfigError as err:
        said = err.problems
    else:
        assert isinstance(rig, Rig)
        return
    assert said
    assert all(problem and "\n" not in problem for problem in said if "\n" not in text)


@given(st.text())
@example("\ufeff")
@example("a: \x85b")
def test_any_text(text: str) -> None:
    _load(text)


@given(st.lists(FRAGMENTS, max_size=30), st.sampled_from(["", "\n", " "]))
def test_scraps_of_yaml(scraps: list[str], glue: str) -> None:
    _load(glue.join(scraps))


@given(st.integers(0, len(LINES) - 1), SCALARS)
def test_one_value_replaced(line: int, value: str) -> None:
    key = LINES[line].split(":")[0]
    _load("\n".join([*LINES[:line], f"{key}: {value}", *LINES[line + 1 :]]))


@given(st.integers(0, len(BENCH)), st.integers(0, 40), st.text(max_size=5))
def test_a_cut_anywhere(start: int, length: int, text: str) -> None:
    _load(BENCH[:start] + text + BENCH[start + length :])


KEYS = st.lists(
    st.sampled_from(
        ["rate_hz", "simulation", "axes", "master", "slave", "wrist", "hand", "reference",
         "waypoints", "0", "1", "2", "coupling", "pairs", "damping", "value", "buses", "options",
         "inertia", '"master.wrist"', "type", "id", "loop", "seed"]
    ), max_size=6,
).map(".".join)  # fmt: skip


@given(KEYS, SCALARS)
def test_any_override(key: str, value: str) -> None:
    _load(BENCH, f"{key}={value}")


@given(st.text(st.characters(exclude_categories=["Cs"])))
def test_any_argument(argument: str) -> None:
    _load(BENCH, argument)
