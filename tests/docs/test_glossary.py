"""The glossary names every public name, and every module it points to exists."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest

import tautwave
from tautwave import plugin, registry

GLOSSARY = (Path(__file__).parents[2] / "docs/reference/glossary.md").read_text()
WORDS = set(re.findall(r"\w+", GLOSSARY))


def places(text: str) -> list[str]:
    """Return what the last column of each table names, in order."""
    rows = [line for line in text.splitlines() if line.startswith("|")]
    return sorted({cell for row in rows for cell in re.findall(r"`(tautwave[\w.]*)`", row)})


def resolved(place: str) -> bool:
    """Return whether a dotted place is a module, or a name in one."""
    try:
        importlib.import_module(place)
    except ModuleNotFoundError:
        module, _, name = place.rpartition(".")
        try:
            return bool(module) and hasattr(importlib.import_module(module), name)
        except ModuleNotFoundError:
            return False
    return True


@pytest.mark.parametrize("place", places(GLOSSARY))
def test_each_place_in_the_code_exists(place: str) -> None:
    assert resolved(place)


def test_a_place_that_does_not_exist_is_noticed() -> None:
    assert places("| a | `tautwave.laws.nowhere` |") == ["tautwave.laws.nowhere"]
    assert not resolved("tautwave.laws.nowhere")
    assert not resolved("tautwave.types.Nothing")


def test_every_public_name_is_in_the_glossary() -> None:
    assert not {*tautwave.__all__, *plugin.__all__} - WORDS


def test_every_law_is_in_the_glossary() -> None:
    assert not set(registry.coupling_names()) - WORDS
