"""The cache of machine code: found again by the next process, never stale after an edit."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import tautwave
from tautwave.config import load_rig
from tautwave.controller.steps import ALONE
from tautwave.models.crossing import motion_bounds
from tautwave.rig import coupling_law
from tautwave.simulation import simulate
from tautwave.simulation.kernel import compiled
from tests.simulation.live import CONFIGS

pytest.importorskip("numba")
pytestmark = pytest.mark.timeout(600)  # where the kernel has to be compiled first

SOURCE = Path(str(tautwave.__file__)).parent
RIG = next(path for path in CONFIGS if path.stem == "bench-1dof-loopback")
HIT = """\
import sys
from tautwave import load_rig, simulate
from tautwave.rig import coupling_law
from tautwave.simulation.kernel.compiled import compiled_kernel
simulate(load_rig(sys.argv[1]), duration_s=0.05)
stats = compiled_kernel(coupling_law(load_rig(sys.argv[1]))).stats
print(sum(stats.cache_hits.values()), sum(stats.cache_misses.values()))
"""
# A caller in one module and what it calls in another: numba looks at the text of the caller only.
EDITED = """\
from tautwave.models.crossing import motion_bounds
from tautwave.simulation.kernel.compiled import cached, cache_directory
kernel = cached(motion_bounds)
print(kernel(0.0, 0.0, 2.0, 1.0, 1.0, 0.0, 0.5)[1], sum(kernel.stats.cache_hits.values()))
print(cache_directory().name)
"""


def python(code: str, *arguments: str, **environment: str) -> list[str]:
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, **environment},
    )
    return done.stdout.split()


def kept(monkeypatch: pytest.MonkeyPatch, directory: Path) -> bool:
    """Return whether what is compiled would be kept in a folder."""
    monkeypatch.setattr(compiled, "cache_directory", lambda *_: directory)
    found = compiled._compile(motion_bounds, ALONE, lambda _, __, kept, ___: kept)
    assert isinstance(found, bool)
    return found


def test_where_nothing_can_be_kept_it_is_compiled_every_time(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "file").touch()
    assert not kept(monkeypatch, tmp_path / "file" / "cache")
    assert kept(monkeypatch, tmp_path / "cache")


def files(directory: Path) -> set[str]:
    return {path.name for path in directory.rglob("*.nb?")}


@pytest.mark.slow
def test_the_next_process_finds_the_kernel() -> None:
    simulate(load_rig(RIG), duration_s=0.05)
    folder = compiled.cache_directory(coupling_law(load_rig(RIG)))
    before = files(folder)
    assert python(HIT, str(RIG)) == ["1", "0"]
    assert files(folder) == before
    kernels = [name for name in before if "kernel.run.run_law-" in name and ".nbc" in name]
    assert len(kernels) == 1  # one signature for all


@pytest.mark.slow
def test_what_is_cached_is_known_without_compiling(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert not compiled.is_cached(motion_bounds)
    environment = {"NUMBA_CACHE_DIR": str(tmp_path)}
    python(EDITED, **environment)
    assert compiled.is_cached(motion_bounds)


@pytest.mark.nightly
@pytest.mark.slow
def test_one_signature_serves_every_rig_of_a_law() -> None:
    laws = {}
    for path in CONFIGS:
        rig = load_rig(path)
        simulate(rig, duration_s=0.01)
        laws[rig.coupling.law] = coupling_law(rig)
    for law in laws.values():
        assert len(compiled.compiled_kernel(law).signatures) == 1  # type: ignore[attr-defined]


@pytest.mark.slow
def test_another_checkout_of_the_same_sources_finds_it(tmp_path: Path) -> None:
    cache = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    hits = []
    for name in ("one", "two"):
        shutil.copytree(SOURCE, tmp_path / name / "tautwave")
        found = python(EDITED, PYTHONPATH=str(tmp_path / name), **cache)
        hits.append(found[1])
    assert hits == ["0", "1"]


@pytest.mark.slow
@pytest.mark.nightly
def test_an_edited_model_is_compiled_again(tmp_path: Path) -> None:
    shutil.copytree(SOURCE, tmp_path / "tautwave")
    where = {"PYTHONPATH": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    first = python(EDITED, **where)
    again = python(EDITED, **where)
    assert (first[1], again[1]) == ("0", "1")
    assert first[0] == again[0] == "0.625"
    called = tmp_path / "tautwave/models/plant_params.py"
    text = called.read_text()
    assert text.count("bound = t / mass") == 1
    called.write_text(text.replace("bound = t / mass", "bound = 2.0 * t / mass"))
    edited = python(EDITED, **where)
    assert edited[1] == "0"
    assert edited[2] != first[2]
    assert edited[0] == "0.75"


def test_the_folder_follows_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    name = compiled.source_hash()
    monkeypatch.setenv("NUMBA_CACHE_DIR", "/somewhere")
    assert compiled.cache_directory() == Path("/somewhere/tautwave") / name
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", "/cache")
    assert compiled.cache_directory() == Path("/cache/tautwave") / name
