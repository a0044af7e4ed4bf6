"""`tautwave sweep --scheduler`: real schedulers and workers, which are killed on the way."""

from __future__ import annotations

import functools
import os
import pickle
import signal
import weakref
from collections.abc import Iterator
from concurrent.futures import Future
from itertools import cycle, repeat
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from tautwave.cli import main
from tautwave.errors import ConfigError, LinkError
from tautwave.sweep import cluster as module
from tautwave.sweep.cluster import Cluster, about, work
from tautwave.sweep.file import SweepPlan, load_sweep
from tautwave.sweep.pool import MAX_QUEUED_PER_WORKER, Piece, Worker, in_process
from tautwave.sweep.runs import run_sweep
from tests.sweep.serving import Serving
from tests.sweep.test_sweep import GOOD

pytest.importorskip("distributed")


def times_ten() -> Worker:
    return lambda piece: 10 * piece[0]


def one_over() -> Worker:
    return lambda piece: 100 // piece[0]


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
    for field, part in (("tautwave", "has tautwave"), ("rounding", "rounds differently")):
        with pytest.raises(ConfigError, match=part):
            work("b", content, about()._replace(**{field: "0"}), (4, 5))
    assert work("a", content, about()._replace(numpy="0"), (6, 7)) == 60  # asked once


class Told:
    """A client of distributed whose pieces end at once, some with an error; counts its futures."""

    status = "running"

    def __init__(self, threads: Iterator[int]) -> None:
        self.threads, self.alive, self.most = threads, weakref.WeakSet[Future[Any]](), 0

    def wait_for_workers(self, least: int, timeout: float) -> None:
        """There are some."""

    def nthreads(self) -> dict[str, int]:
        return {"worker": next(self.threads)}

    def map(
        self, do: Worker, pieces: list[Piece], *, pure: bool, retries: int
    ) -> list[Future[Any]]:
        assert not pure
        assert retries
        futures = []
        for piece in pieces:
            future: Future[Any] = Future()
            self.alive.add(future)
            try:
                future.set_result(do(piece))
                future.status = "finished"  # type: ignore[attr-defined]
            except ArithmeticError as err:
                future.set_exception(err)
                future.status = "error"  # type: ignore[attr-defined]
            futures.append(future)
        self.most = max(self.most, len(self.alive))
        return futures

    def gather(self, futures: list[Future[Any]]) -> list[Any]:
        return [future.result() for future in futures]


def told(monkeypatch: pytest.MonkeyPatch, threads: Iterator[int]) -> tuple[Cluster, Told]:
    """Return a cluster that counts its workers before each piece, and its client."""
    client = Told(threads)
    monkeypatch.setattr("distributed.Client", lambda *_, **__: client)
    monkeypatch.setattr(module, "COUNT_S", -1.0)
    return Cluster("tcp://told:8786"), client


def test_a_long_sweep_holds_a_window_of_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    cluster, client = told(monkeypatch, cycle([5, 3, 1]))  # workers go, and come again
    results = list(cluster(times_ten, ((k, k + 1) for k in range(5000))))
    assert sorted(results) == list(range(0, 50_000, 10))
    assert (
        client.most <= 2 * MAX_QUEUED_PER_WORKER * 5
    )  # those that are waited for, and those just taken
    assert not client.alive


class Again(Future[Any]):
    """A piece whose worker dies when it is done, and which is then made again."""

    died = False

    @property
    def status(self) -> str:
        before, self.died = self.died, True
        return "finished" if before else "lost"


def test_a_result_that_went_with_its_worker_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    cluster, client = told(monkeypatch, repeat(1))
    lost, kept = Again(), Future[Any]()
    for number, future in enumerate((lost, kept)):
        future.set_result(number)
    kept.status = "finished"  # type: ignore[attr-defined]
    monkeypatch.setattr(client, "map", lambda *_, **__: [lost, kept])
    assert sorted(cluster(times_ten, [(0, 1), (1, 2)])) == [0, 1]


def test_what_ended_beside_a_failure_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    cluster, _ = told(monkeypatch, repeat(4))
    results = cluster(one_over, [(2, 3), (0, 1), (4, 5)])
    assert [next(results), next(results)] == [50, 25]
    with pytest.raises(LinkError, match="failed: ZeroDivisionError"):
        next(results)


@pytest.mark.slow
def test_a_cluster_that_lost_its_workers_is_not_waited_for_without_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    cluster, client = told(monkeypatch, cycle([2, 0, 0]))
    monkeypatch.setattr(module, "GONE_S", 0.0)
    monkeypatch.setattr(client, "map", lambda *_, **__: [Future()])  # nobody ever does it
    with pytest.raises(LinkError, match=r"has had no worker for 0 s; rows so far are kept"):
        list(cluster(times_ten, [(0, 1)]))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("where", "part"),
    [
        ("tcp://127.0.0.1:1", "no scheduler answers"),
        ("none.json", "no such scheduler file"),
        ("rig.yaml", "neither an address"),
        ("http://127.0.0.1:1", "neither an address"),
        ("list.json", "neither an address"),
        ("half.json", "line 1, column"),
    ],
)
def test_no_scheduler_is_one_sentence(
    where: str, part: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "ANSWER_S", 1)
    (tmp_path / "sweep.yaml").write_text(GOOD)
    (tmp_path / "list.json").write_text("[1]")
    (tmp_path / "half.json").write_text('{"address"')
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(main, ["sweep", "sweep.yaml", "--scheduler", where])
    assert done.exit_code == (5 if where in ("tcp://127.0.0.1:1", "none.json") else 2)
    assert part in done.output
    assert "Traceback" not in done.output


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
    held = cluster._client  # what distributed itself keeps of pieces that are done
    assert len(held.futures) <= MAX_QUEUED_PER_WORKER * 2
    assert held.scheduler_comm.recent_message_log.maxlen == module.KEPT
    cluster.close()


@pytest.mark.slow
@pytest.mark.nightly
def test_a_scheduler_that_dies_ends_the_work_with_a_sentence(
    served: Serving, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "ANSWER_S", 3)  # it is asked for results until then
    cluster = Cluster(str(served.file))
    work = cluster(functools.partial(kill, served.scheduler.pid), [(k, k + 1) for k in range(99)])
    with pytest.raises(LinkError, match=r"is gone.*resumes"):
        list(work)
    cluster.close()
