"""Blocks of keys and options: what none of them accepts, wherever it is written."""

from __future__ import annotations

import importlib
import inspect
from pathlib import Path

import pytest
from pydantic import BaseModel

ROOT = Path(__file__).parents[2]
TREES = ("src", "drivers", "sim")
WITH_MODELS = sorted(
    path.relative_to(ROOT / tree).with_suffix("")
    for tree in TREES
    for path in (ROOT / tree).rglob("*.py")
    if "BaseModel" in path.read_text(encoding="utf-8")
)


@pytest.mark.parametrize("module", WITH_MODELS, ids=lambda path: path.as_posix())
def test_no_block_converts_changes_or_takes_infinity(module: Path) -> None:
    loaded = importlib.import_module(".".join(module.parts))
    for name, kind in inspect.getmembers(loaded, inspect.isclass):
        if issubclass(kind, BaseModel) and kind is not BaseModel and kind.model_fields:
            rules = kind.model_config
            assert rules.get("extra") in ("forbid", "ignore"), name
            # What only picks a few keys of a file that others check need not be strict again.
            if rules["extra"] == "forbid" or "strict" in rules:
                assert (rules["strict"], rules["frozen"], rules["allow_inf_nan"]) == (
                    True,
                    True,
                    False,
                ), name
