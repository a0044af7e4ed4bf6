"""The kernel of law wave is compiled once, beside the first tests, and not by each worker.

python -m tests.compiling
"""

from __future__ import annotations

import fcntl
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

import pytest

from tautwave.controller.steps import Law

ROOT = Path(__file__).parents[1]


@contextmanager
def compiling() -> Iterator[None]:
    """Wait for whoever compiles, and keep others waiting meanwhile."""
    from tautwave.simulation.kernel.compiled import cache_directory

    directory = cache_directory()
    directory.mkdir(parents=True, exist_ok=True)
    with (directory / "compiling").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def start(config: pytest.Config) -> subprocess.Popen[bytes] | None:
    """Begin to compile where there will be several workers, in the one process that has none."""
    if hasattr(config, "workerinput") or not config.getoption("numprocesses", None):
        return None
    if config.option.collectonly or find_spec("numba") is None:
        return None
    return subprocess.Popen([sys.executable, "-m", "tests.compiling"], cwd=ROOT)


def wait_for_it(patch: pytest.MonkeyPatch) -> None:
    """Have this process wait for who compiles, at the first simulation that is compiled."""
    if find_spec("numba") is None:
        return
    from tautwave.simulation.kernel import compiled

    at_once = compiled.compiled_kernel

    def compiled_kernel(law: Law) -> Callable[..., int]:
        if law.steps not in compiled._kernels:
            with compiling():
                return at_once(law)
        return at_once(law)

    patch.setattr(compiled, "compiled_kernel", compiled_kernel)


if __name__ == "__main__":
    from tautwave.config import load_rig
    from tautwave.rig import coupling_law
    from tautwave.simulation import simulate
    from tautwave.simulation.kernel.compiled import is_cached
    from tautwave.simulation.kernel.run import run_law

    with compiling():
        rig = load_rig(ROOT / "configs" / "bench-1dof-loopback.yaml")
        if not is_cached(run_law, coupling_law(rig)):
            simulate(rig, duration_s=0.01)
