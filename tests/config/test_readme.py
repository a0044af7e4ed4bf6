"""configs/README.md names every key and every shipped rig."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tautwave.config import rig_schema

CONFIGS = Path(__file__).parents[2] / "configs"
README = (CONFIGS / "README.md").read_text()


def _all_keys() -> set[str]:
    schema = rig_schema()
    blocks = [schema, *(v for k, v in schema["$defs"].items() if "." not in k)]
    return {key for block in blocks for key in block.get("properties", {})}


@pytest.mark.parametrize("key", sorted(_all_keys()))
def test_key_is_explained(key: str) -> None:
    assert re.search(rf"`[^`]*\b{key}\b[^`]*`", README)


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.yaml")), ids=lambda path: path.name)
def test_rig_is_listed(path: Path) -> None:
    assert f"`{path.name}`" in README
