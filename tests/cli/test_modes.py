"""One rule for the modes of what is left behind: the user's umask, in directories too."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from tautwave import config
from tests.commands import keep_in_one_process, page_of, tautwave

ROOT = Path(__file__).parents[2]
RIG = ROOT / "configs" / "bench-1dof-loopback.yaml"
OWN_MODE = re.compile(r"chmod|mkstemp|NamedTemporaryFile|mkdtemp|os\.open\([^)]*0o|mode=0o")


OWN = ("files.py", "registration.py", "certificates.py", "operator.py")
"""The rule's own place; the servers that run at present, in a shared /tmp; the keys of a site, the
user's alone whatever the umask; and a rig that is gone as soon as its run has read it."""


@pytest.fixture(params=[0o027, 0o077])
def umask(request: pytest.FixtureRequest) -> Iterator[int]:
    before = os.umask(request.param)
    yield request.param
    os.umask(before)


@pytest.mark.slow
def test_a_run_follows_the_umask(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, umask: int
) -> None:
    keep_in_one_process(monkeypatch)
    words = ("--clock", "fake", "--duration", 0.05)
    done = tautwave("run", RIG, *words, "--out", "out", cwd=tmp_path)
    assert done.exit_code == 0, done.stderr
    out = tmp_path / "out"
    assert out.stat().st_mode & 0o777 == 0o777 & ~umask
    modes = {path.name: path.stat().st_mode & 0o777 for path in out.iterdir()}
    page_of(out)
    modes["report.html"] = (out / "report.html").stat().st_mode & 0o777
    names = ("recording.mcap", "report.html", "rig.yaml", "summary.json")
    assert modes == dict.fromkeys(names, 0o666 & ~umask)


def test_the_traceback_of_an_error_follows_it_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, umask: int
) -> None:
    def load_rig(*_: object) -> None:
        raise RuntimeError("a bug")

    monkeypatch.setattr(config, "load_rig", load_rig)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    done = tautwave("check", RIG, cwd=tmp_path)
    assert done.exit_code == 1
    (kept,) = tmp_path.glob("tautwave-error-*.txt")
    assert str(kept) in done.stderr
    assert "RuntimeError: a bug" in kept.read_text()
    assert kept.stat().st_mode & 0o777 == 0o666 & ~umask


def test_nothing_sets_a_mode_of_its_own() -> None:
    sources = [path for top in ("src", "drivers", "sim") for path in (ROOT / top).rglob("*.py")]
    assert len(sources) > 100
    assert OWN_MODE.search("os.open(path, os.O_CREAT, 0o600)")
    own = [
        str(path)
        for path in sources
        if path.name not in OWN and OWN_MODE.search(path.read_text(encoding="utf-8"))
    ]
    assert own == []
