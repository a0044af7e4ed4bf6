"""No test leaves half a bytecode file behind, with which every later import fails."""

from __future__ import annotations

import importlib
import resource
import sys
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]


def test_who_limits_the_size_of_files_writes_no_bytecode() -> None:
    limiting = [path for path in TESTS.rglob("*.py") if "RLIMIT_" + "FSIZE" in path.read_text()]
    assert len(limiting) >= 2
    for path in limiting:
        assert "no_bytecode" in path.read_text(), path


def test_a_module_imported_under_a_limit_leaves_no_half_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, no_bytecode: None
) -> None:
    (tmp_path / "large_module.py").write_text(f"names = {[f'{n:06d}' for n in range(3000)]}\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "pycache_prefix", str(tmp_path / "cache"))
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        assert len(importlib.import_module("large_module").names) == 3000
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        del sys.modules["large_module"]
    assert not list((tmp_path / "cache").rglob("*.pyc"))
