"""The translator to C: what it takes means the same, what it does not take is named."""

from __future__ import annotations

import ctypes
import math
import subprocess
from collections.abc import Callable, MutableSequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.simulation.kernel.cbuild import RECORDS, compile_text, kernel_text
from tautwave.simulation.kernel.ctext import translate
from tautwave.simulation.kernel.ctypes_of import TranslationError

WARNINGS = ("-Wall", "-Wextra", "-Wno-unused-parameter", "-Wno-unused-variable")
SHARE = 0.1
FIRST, SECOND = 3, 4


class Spring(NamedTuple):
    """A record."""

    stiffness: float
    steps: int
    both: bool


def split(x: float, n: int) -> tuple[float, int]:
    if n % 3 == 1 and not x < 0.0:
        return x / n, n // 2
    return -x * SHARE, FIRST + SECOND


def mix(springs: MutableSequence[float], x: float, count: int) -> float:
    total = 0.0
    low, high = x, -x
    if low > high:
        low, high = high, low
    for i in range(1, count):
        if i == 4:
            continue
        part, whole = split(x + i, i)
        total += part * whole if i % 2 == 0 else part - whole
        springs[i] = total
        if not (-1e6 <= total <= 1e6):
            break
    while low < -1.0:
        low = 0.5 * low
    turns = math.floor(x / 0.7 + 0.5)
    return total + low + turns * 0.7 + math.sqrt(math.fabs(high)) + math.pow(math.fabs(x), 1.5)


@pytest.fixture(scope="module")
def mixed(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., float]:
    library = ctypes.CDLL(str(compile_text(translate(mix), tmp_path_factory.mktemp("c"))))
    library.mix.restype = ctypes.c_double

    def run(table: np.ndarray[Any, Any], x: float, count: int) -> float:
        pointer = ctypes.c_void_p(table.ctypes.data)
        return float(library.mix(pointer, ctypes.c_double(x), ctypes.c_int64(count)))

    return run


@given(st.floats(-1e5, 1e5), st.integers(0, 12))
def test_c_computes_what_python_computes(mixed: Callable[..., float], x: float, count: int) -> None:
    one, other = np.zeros(12), np.zeros(12)
    assert mixed(one, x, count) == mix(other, x, count)
    assert one.tobytes() == other.tobytes()


def test_the_kernel_compiles_without_a_warning(tmp_path: Path) -> None:
    text = kernel_text()
    assert text.count("_Static_assert") == len(RECORDS)
    compile_text(text, tmp_path)
    said = subprocess.run(
        ["gcc", "-std=c11", "-fsyntax-only", *WARNINGS, str(tmp_path / "kernel.c")],
        capture_output=True,
        text=True,
        check=True,
    )
    assert said.stderr == ""


def with_list(x: float) -> float:
    return sum([x, x])


def with_keyword(x: float) -> float:
    return abs(x=x)  # type: ignore[call-arg]


def with_another_type(x: float) -> float:
    y = 0
    y = x  # type: ignore[assignment]
    return y


def with_number_as_condition(x: float) -> float:
    if x:
        return 1.0
    return 0.0


def with_power(x: float) -> float:
    return x**2


def with_try(x: float) -> float:
    try:
        return 1.0 / x
    except ZeroDivisionError:
        return 0.0


def with_text(x: float) -> float:
    name = "x"
    return x if name else 0.0


def with_unknown_field(spring: Spring) -> float:
    return spring.length  # type: ignore[attr-defined, no-any-return]


def with_step(n: int) -> int:
    total = 0
    for i in range(0, n, 2):
        total += i
    return total


def without_annotation(x) -> float:  # type: ignore[no-untyped-def]
    return 2.0 * x


def with_whole_result(x: float) -> float:
    return math.floor(x)


@pytest.mark.parametrize(
    ("function", "sentence"),
    [
        (with_list, "an expression List"),
        (with_keyword, "an expression Call"),
        (with_another_type, "where a int64_t was"),
        (with_number_as_condition, "a number or record as a condition"),
        (with_power, "the operator Pow here"),
        (with_try, "a statement Try"),
        (with_text, "the value 'x'"),
        (with_unknown_field, "Spring without a field length"),
        (with_step, "a range with a step"),
        (without_annotation, "parameter x has no annotation"),
        (with_whole_result, "where a double was"),
    ],
)
def test_what_is_not_in_the_subset_is_named(function: Callable[..., Any], sentence: str) -> None:
    with pytest.raises(TranslationError) as caught:
        translate(function)
    assert sentence in str(caught.value)
    first = function.__code__.co_firstlineno
    if function is not without_annotation:
        line = int(str(caught.value).partition("test_ctext.py:")[2].partition(":")[0])
        assert first < line <= first + 6
