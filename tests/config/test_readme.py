"""The pages of a rig file name every key, with its own default; configs/README.md every rig."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from tautwave.config import rig_schema

CONFIGS = Path(__file__).parents[2] / "configs"
README = (CONFIGS / "README.md").read_text()
PAGES = sorted((CONFIGS.parent / "docs/reference/rig").glob("*.md"))
REFERENCE = "\n".join(page.read_text() for page in PAGES)


def _all_keys() -> set[str]:
    schema = rig_schema()
    blocks = [schema, *(v for k, v in schema["$defs"].items() if "." not in k)]
    return {key for block in blocks for key in block.get("properties", {})}


@pytest.mark.parametrize("key", sorted(_all_keys()))
def test_key_is_explained(key: str) -> None:
    assert re.search(rf"`[^`]*\b{key}\b[^`]*`", REFERENCE)


def _stated() -> Iterator[tuple[str, str]]:
    """Yield each key of the tables whose default is one word or number, with it."""
    for line in REFERENCE.splitlines():
        names, given, *_ = (*(cell.strip() for cell in line.split("|")[1:-1]), "", "")
        keys = re.findall(r"`([a-z_0-9]+)`", names)
        defaults = [default.strip() for default in given.split(",")]
        if len(keys) == len(defaults):
            yield from zip(keys, defaults, strict=True)


def _defaults() -> dict[str, set[object]]:
    """Return the plain defaults of each key, in whatever block; None where none is fixed."""
    found: dict[str, set[object]] = {}
    for block in ((schema := rig_schema()), *schema["$defs"].values()):
        for key, keys in block.get("properties", {}).items():
            if isinstance(default := keys.get("default"), str | int | float | None):
                found.setdefault(key, set()).add(default)
    return found


@pytest.mark.installed
def test_defaults_stated_as_numbers_are_those_of_the_keys() -> None:
    found = _defaults()
    stated: list[tuple[str, float]] = []
    for key, default in _stated():
        with suppress(ValueError):
            stated.append((key, float(default)))
    assert len(stated) > 70
    # One that depends on other keys is None in the schema.
    numbers = {
        key: {one for one in ones if not isinstance(one, str)} for key, ones in found.items()
    }
    wrong = [(key, one) for key, one in stated if not {one, None} & numbers[key]]
    assert wrong == []


@pytest.mark.installed
def test_defaults_stated_as_words_are_those_of_the_keys() -> None:
    found, seen = _defaults(), 0
    for key, default in _stated():
        word = re.fullmatch(r"`(\w+)`(?: \(.*\))?|(true|false)", default)
        if word is None or key not in found:  # a row of another table
            continue
        seen += 1
        wanted = word[1] if word[1] else word[2] == "true"
        assert {wanted, None} & found[key], key
    assert seen > 40


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.yaml")), ids=lambda path: path.name)
def test_rig_is_listed(path: Path) -> None:
    assert f"`{path.name}`" in README
