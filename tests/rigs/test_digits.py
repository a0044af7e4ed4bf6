"""A number of 400 digits, at every key that takes a number, is one sentence."""

from __future__ import annotations

import functools
import json
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tautwave.config import load_rig
from tautwave.config.guard import parse_json
from tautwave.config.text.document import open_document
from tautwave.config.text.yaml12 import read_scalar
from tautwave.errors import ConfigError
from tests.commands import tautwave

CONFIGS = Path(__file__).parents[2] / "configs"
DIGITS = "9" * 400
TEXTS = (DIGITS, "9" * 40, f"-{DIGITS}", "-1e40")


def numbers(value: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """Give the paths of all numbers of a tree."""
    if isinstance(value, dict | list):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        for key, item in items:
            yield from numbers(item, (*path, key))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path


@functools.cache
def each_key() -> list[tuple[Path, str]]:
    """Return a shipped file and a path for every kind of place of a number; indices are alike."""
    known, found = set(), []
    for path in sorted(CONFIGS.rglob("*.yaml")):
        if path.parent.name == "sweeps":
            continue
        value = open_document(path.read_text(), str(path), path.parent).value
        for way in numbers(value) if "rate_hz" in value else ():
            kind = tuple("" if isinstance(key, int) else key for key in way)
            if kind not in known:
                known.add(kind)
                words = (f"'{key}'" if "." in str(key) else str(key) for key in way)
                found.append((path, ".".join(words)))
    return found


def refused(path: Path, place: str, text: str) -> None:
    """Have a rig with a number at a place refused, in sentences that name the place."""
    with pytest.raises(ConfigError) as caught:
        load_rig(path, [f"{place}={text}"])
    named = re.split(r"\.\d", place.replace("'", ""))[0]  # a list is refused as a whole
    said = [problem.replace("'", "") for problem in caught.value.problems]
    if not any(named in problem for problem in said):
        named = named.rpartition(".")[0]  # so is a mapping of lists
    assert any(named in problem for problem in said), said
    assert all(len(problem) < 2000 and "\n" not in problem for problem in caught.value.problems)


@pytest.mark.parametrize("turn", range(12))
def test_some_keys_take_no_number_beyond_all_measure(turn: int) -> None:
    for path, place in each_key()[turn :: 12 * 12]:
        refused(path, place, TEXTS[turn % len(TEXTS)])


@pytest.mark.nightly
@pytest.mark.slow
@pytest.mark.parametrize("text", TEXTS, ids=range(len(TEXTS)))
def test_no_key_takes_a_number_beyond_all_measure(text: str) -> None:
    for path, place in each_key():
        refused(path, place, text)


def test_a_file_of_such_numbers_is_refused_with_all_of_them(tmp_path: Path) -> None:
    text = (CONFIGS / "bench-1dof-loopback.yaml").read_text()
    value = open_document(text, "rig.yaml", tmp_path).value
    for way in numbers(value):
        node = value
        for key in way[:-1]:
            node = node[key]
        node[way[-1]] = "NUMBER"
    path = tmp_path / "rig.yaml"
    path.write_text(json.dumps(value).replace('"NUMBER"', DIGITS))
    with pytest.raises(ConfigError) as caught:
        load_rig(path)
    assert len(caught.value.problems) > 40


def test_whoever_takes_a_number_of_a_file_for_a_float_may() -> None:
    for digits in (1, 18, 299, 300, 301, 308, 309, 400, 4000, 5000):
        for text in ("9" * digits, "-" + "9" * digits, "0" * digits + "1", "+" + "9" * digits):
            float(read_scalar(text))
        for text in ("9" * digits, "-" + "9" * digits):
            float(parse_json(text))
            if math.isinf(float(read_scalar(text))):
                with pytest.raises(ValueError, match="not a finite number"):
                    parse_json(text, finite=True)


@pytest.mark.parametrize("text", [DIGITS, "9" * 5000, "-" + DIGITS])
@pytest.mark.parametrize(
    "words",
    [
        ("run", "RIG", "--duration", "N"),
        ("run", "RIG", "--clock", "fake", "--set", "seed=N"),
        ("check", "RIG", "--set", "loop.cpu=N"),
        ("check", "RIG", "--set", "coupling.pairs.lever.wave_impedance=N"),
        ("check", "RIG", "--set", "coupling.pairs.lever.offset=N"),
        ("check", "RIG", "--set", "buses.N.driver=loopback"),
        ("check", "RIG", "--set", "simulation.hand.lever.reference.waypoints.N=[1, 2]"),
        ("run", "RIG", "--set", "operate={}", "--clock", "fake", "--commands", "times.txt"),
        ("identify", "table.csv", "--position", "x", "--effort", "f"),
        ("identify", "RIG", "--axis", "slave.lever", "--duration", "N"),
        ("sweep", "sweep.yaml"),
        ("sweep", "sweep.yaml", "--jobs", "N"),
        ("bench", "buses", "--cycles", "N"),
        ("export", ".", "--to", "lerobot", "--fps", "N"),
        ("report", ".", "--width", "N"),
    ],
    ids=lambda words: "-".join(word.partition("=")[0] for word in words[:8]),
)
def test_a_command_says_it_in_a_sentence(words: tuple[str, ...], text: str, tmp_path: Path) -> None:
    rig = CONFIGS / "bench-1dof-loopback.yaml"
    (tmp_path / "times.txt").write_text(f"{text} engage\n")
    (tmp_path / "table.csv").write_text(f"time_s,x,f\n0,0,0\n0.1,{text},0\n0.2,0,0\n")
    (tmp_path / "sweep.yaml").write_text(
        f"name: s\nrig: {rig}\ngrid: {{coupling.delay_s: [0.01, {text}]}}\ncolumns: [stable]\n"
    )
    found = [str(rig) if word == "RIG" else word.replace("N", text) for word in words]
    done = tautwave(*found, cwd=tmp_path)
    assert done.exit_code in (1, 2), done.output
    assert "unexpected error" not in done.output
    assert done.exception is None or isinstance(done.exception, SystemExit)
