"""When tests run in workers: `pytest` uses all processors, `pytest FILE` its own process."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path


def names_only_files(args: Sequence[str]) -> bool:
    """Return whether a command line names test files or single tests, and no folder."""
    named = [Path(word.partition("::")[0]) for word in args if not word.startswith("-")]
    there = [path for path in named if path.exists()]
    return bool(there) and all(path.is_file() for path in there)
