"""A disk without room for the recording is named before anything moves."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tautwave.config import load_rig
from tautwave.session import keeping
from tautwave.session.running import run
from tests.commands import keep_in_one_process

RIG = Path(__file__).parents[2] / "configs" / "bench-1dof-loopback.yaml"


def has_free(monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    monkeypatch.setattr("shutil.disk_usage", lambda path: SimpleNamespace(free=count))


@pytest.mark.parametrize(("free", "warned"), [(0, True), (7999, True), (8000, False)])
def test_less_room_than_the_rows_may_take_is_a_warning(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, free: int, warned: bool
) -> None:
    has_free(monkeypatch, free)
    said: list[str] = []
    keeping.warn_of_little_room(tmp_path, 100.0, 10, said.append)
    assert len(said) == warned
    if warned:
        assert f"{tmp_path}: " in said[0]
        assert "may take up to 0.008 MB" in said[0]
    keeping.warn_of_little_room(tmp_path, 100.0, 10, None)  # nobody to tell


def test_a_disk_that_tells_nothing_is_no_reason_against_a_run(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def unknown(path: Any) -> Any:
        raise OSError("no such file system")

    monkeypatch.setattr("shutil.disk_usage", unknown)
    keeping.warn_of_little_room(tmp_path, 1e9, 100, pytest.fail)


@pytest.mark.parametrize(
    ("seconds_each", "bytes_per_s", "warned"),
    [(0.0, 1e6, False), (0.1, 1e6, False), (0.3, 1e6, True), (0.3, 1e5, False), (5.0, 1e5, True)],
)
def test_a_disk_that_takes_less_than_a_run_records_is_named_and_left_as_it_was(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    seconds_each: float,
    bytes_per_s: float,
    warned: bool,
) -> None:
    """A quarter of a megabyte takes a disk so long to have for good."""
    spent = [0.0]
    monkeypatch.setattr("os.fsync", lambda _: spent.__setitem__(0, spent[0] + seconds_each))
    said: list[str] = []
    keeping.warn_of_slow_disk(tmp_path, bytes_per_s, said.append, now=lambda: spent[0])
    assert len(said) == warned
    assert all("MB/s (measured)" in one and "rows may be lost" in one for one in said)
    assert spent[0] <= max(keeping.PROBE_S + seconds_each, seconds_each)
    assert list(tmp_path.iterdir()) == []
    keeping.warn_of_slow_disk(tmp_path / "not there", bytes_per_s, pytest.fail)
    keeping.warn_of_slow_disk(tmp_path, bytes_per_s, None)


def test_rows_that_wait_for_the_disk_are_told_once_before_any_is_lost() -> None:
    waiting, said = [0.0], []
    look = keeping.backlog_warning(lambda: waiting[0], said.append)
    for waiting[0] in (0.0, 0.3, 0.5, 0.6, 0.9, 0.2, 0.9):
        look()
        assert len(said) == (waiting[0] > 0.5 or bool(said))
    assert len(said) == 1
    keeping.backlog_warning(lambda: 1.0, None)()


@pytest.mark.slow
def test_a_run_says_it_first(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    keep_in_one_process(monkeypatch)
    has_free(monkeypatch, 1000)
    said: list[str] = []
    run(load_rig(RIG), out=tmp_path / "out", clock="fake", duration_s=0.05, warn=said.append)
    assert any("0.001 MB free" in one for one in said), said
