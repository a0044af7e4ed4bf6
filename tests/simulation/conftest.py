"""The kernel is compiled once, however many processes share the tests."""

from __future__ import annotations

import fcntl
from importlib.util import find_spec
from pathlib import Path

import pytest

from tautwave.config import load_rig
from tautwave.simulation import simulate
from tautwave.simulation.kernel.compiled import cache_directory
from tests.simulation.live import CONFIGS


@pytest.fixture(scope="session", autouse=True)
def compiled_once() -> None:
    """Let the first process compile, and the others wait for what it leaves in the cache."""
    if find_spec("numba") is not None:
        directory: Path = cache_directory()
        directory.mkdir(parents=True, exist_ok=True)
        with (directory / "compiling").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            simulate(load_rig(CONFIGS[0]), duration_s=0.01)
