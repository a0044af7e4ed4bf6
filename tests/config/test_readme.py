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


def _stated() -> Iterator[tuple[str, float]]:
    """Yield each key of the tables whose default is a number, with it."""
    for line in REFERENCE.splitlines():
        names, given, *_ = (*(cell.strip() for cell in line.split("|")[1:-1]), "", "")
        keys = re.findall(r"`([a-z_0-9]+)`", names)
        numbers = [number.strip() for number in given.split(",")]
        if len(keys) == len(numbers):
            for key, number in zip(keys, numbers, strict=True):
                with suppress(ValueError):
                    yield key, float(number)


@pytest.mark.installed
def test_defaults_stated_as_numbers_are_those_of_the_keys() -> None:
    blocks = [(schema := rig_schema()), *schema["$defs"].values()]
    found: dict[str, set[object]] = {}
    for block in blocks:
        for key, keys in block.get("properties", {}).items():
            default = keys.get("default")
            if default is None or isinstance(default, int | float):
                found.setdefault(key, set()).add(default)
    stated = list(_stated())
    assert len(stated) > 70
    # One that depends on other keys is None in the schema.
    wrong = [(key, number) for key, number in stated if not {number, None} & found[key]]
    assert wrong == []


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.yaml")), ids=lambda path: path.name)
def test_rig_is_listed(path: Path) -> None:
    assert f"`{path.name}`" in README
