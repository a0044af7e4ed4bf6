"""`tautwave sweep --scheduler`: real schedulers and workers, which are killed on the way."""

from __future__ import annotations

import functools
import json
import os
import pickle
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from click.testing import CliRunner

from tautwave.cli import main
from tautwave.errors import ConfigError, LinkError
from tautwave.sweep import cluster as module
from tautwave.sweep.cluster import Cluster, about, work
from tautwave.sweep.file import SweepPlan, load_sweep
from tautwave.sweep.pool import Piece, Worker, in_process
from tautwave.sweep.runs import run_sweep
from tests.sweep.test_sweep import GOOD

pytest.importorskip("distributed")


def times_ten() -> Worker:
    return lambda piece: 10 * piece[0]


def die_once(mark: Path) -> Worker:
    """Return a worker that kills its process at piece 3, the first time."""

    def worker(piece: Piece) -> int:
        if piece[0] == 3 and not mark.exists():
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return piece[0]

    return worker


def kill(pid: int) -> Worker:
    """Return a worker that kills another process."""

    def worker(piece: Piece) -> int:
        if piece[0] == 5:
            os.kill(pid, signal.SIGKILL)
        return piece[0]

    return worker


def test_a_worker_has_to_be_like_the_process_that_asks() -> None:
    content = pickle.dumps(times_ten)
    assert work("a", content, about(), (4, 5)) == 40
    for field, part in (("tautwave", "has tautwave"), ("rounding", "rounds otherwise")):
        with pytest.raises(ConfigError, match=part):
            work("b", content, about()._replace(**{field: "0"}), (4, 5))
    assert work("a", content, about()._replace(numpy="0"), (6, 7)) == 60  # asked once


@pytest.mark.parametrize(
    ("where", "part"),
    [("tcp://127.0.0.1:1", "no scheduler answers"), ("none.json", "no such scheduler file")],
)
def test_no_scheduler_is_one_sentence(
    where: str, part: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "PATIENCE_S", 1)
    (tmp_path / "sweep.yaml").write_text(GOOD)
    words = ["sweep", str(tmp_path / "sweep.yaml"), "--out", str(tmp_path), "--scheduler", where]
    done = CliRunner().invoke(main, words)
    assert done.exit_code == 5
    assert part in done.output
    assert "Traceback" not in done.output


class Serving:
    """A scheduler and two workers as processes of their own."""

    def __init__(self, folder: Path) -> None:
        self.file = folder / "scheduler.json"
        quiet = ["--no-dashboard", "--host", "127.0.0.1", "--scheduler-file", str(self.file)]
        self.scheduler = self._start("dask_scheduler", "--port", "0", "--no-show", *quiet)
        self.others = [
            self._start("dask_worker", "--scheduler-file", str(self.file), "--nthreads", "1",
                        "--no-dashboard", "--local-directory", str(folder), "--death-timeout", "60")
            for _ in range(2)
        ]  # fmt: skip
        until = time.monotonic() + 60.0
        while not self._is_written() and time.monotonic() < until:
            time.sleep(0.05)

    def _is_written(self) -> bool:
        """Return whether the scheduler's file is there, and whole."""
        with suppress(FileNotFoundError, ValueError):
            return "address" in json.loads(self.file.read_text())
        return False

    def _start(self, tool: str, *words: str) -> subprocess.Popen[bytes]:
        root = str(Path(__file__).parents[2])
        path = os.pathsep.join([root, *filter(None, [os.environ.get("PYTHONPATH")])])
        return subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.{tool}", *words],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
            env=os.environ | {"PYTHONPATH": path},
        )  # fmt: skip

    def end(self) -> None:
        for process in (*self.others, self.scheduler):
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Serving]:
    serving = Serving(tmp_path)
    try:
        yield serving
    finally:
        serving.end()


@pytest.fixture
def plan(tmp_path: Path) -> SweepPlan:
    (tmp_path / "sweep.yaml").write_text(GOOD)
    return load_sweep(tmp_path / "sweep.yaml")


@pytest.mark.slow
def test_a_cluster_makes_the_same_bytes_and_outlives_its_workers(
    served: Serving, plan: SweepPlan, tmp_path: Path
) -> None:
    run_sweep(plan, tmp_path / "here", executor=in_process)
    words = ["sweep", str(tmp_path / "sweep.yaml"), "--out", str(tmp_path / "there")]
    done = CliRunner().invoke(main, [*words, "--scheduler", str(served.file)])
    assert done.exit_code == 0, done.output
    there = (tmp_path / "there" / "points.csv").read_bytes()
    assert there == (tmp_path / "here" / "points.csv").read_bytes()

    cluster = Cluster(str(served.file))
    pieces = [(at, at + 1) for at in range(20)]
    mark = tmp_path / "died"
    assert sorted(cluster(functools.partial(die_once, mark), pieces)) == list(range(20))
    assert mark.exists()
    cluster.close()


@pytest.mark.slow
def test_a_scheduler_that_dies_ends_the_work_with_a_sentence(
    served: Serving, monkeypatch: pytest.MonkeyPatch
) -> None:
    cluster = Cluster(str(served.file))
    monkeypatch.setattr(module, "PATIENCE_S", 3)
    work = cluster(functools.partial(kill, served.scheduler.pid), [(k, k + 1) for k in range(99)])
    with pytest.raises(LinkError, match=r"is gone.*resumes"):
        list(work)
    cluster.close()
