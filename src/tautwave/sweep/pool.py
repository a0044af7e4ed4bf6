"""Executors of a sweep's pieces: this process, a pool of processes; a cluster is in `cluster`.

An executor is a function. It gets a worker factory, and an iterator of pieces that it consumes as
needed; it yields the workers' results in any order. That is all a sweep knows about it.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import suppress
from multiprocessing import connection, get_context, parent_process
from typing import Any, Protocol

MAX_QUEUED_PER_WORKER = 2
"""Queued pieces per worker: enough to keep it busy, few enough to keep memory flat."""

Piece = tuple[int, int]
"""First point and end (exclusive)."""

Worker = Callable[[Piece], Any]


class Executor(Protocol):
    """Runs pieces. `begin` and its arguments can be sent to other processes."""

    def __call__(
        self, begin: Callable[[], Worker], pieces: Iterable[Piece]
    ) -> Generator[Any, None, None]:
        """Yield the result of every piece as it finishes; closing the generator ends the work."""
        ...


def in_process(begin: Callable[[], Worker], pieces: Iterable[Piece]) -> Generator[Any, None, None]:
    """Run the pieces one after the other in this process."""
    worker = begin()
    for piece in pieces:
        yield worker(piece)


class ProcessPool:
    """Run pieces in processes on this machine; each creates one worker."""

    def __init__(self, jobs: int) -> None:
        self.jobs = jobs

    def __call__(
        self, begin: Callable[[], Worker], pieces: Iterable[Piece]
    ) -> Generator[Any, None, None]:
        """Yield results in any order; started pieces are finished and kept, never killed."""
        pool = ProcessPoolExecutor(
            self.jobs, get_context("spawn"), initializer=_begin, initargs=(begin,)
        )
        queue: Iterator[Piece] = iter(pieces)
        waiting: set[Future[Any]] = set()

        def fill() -> None:
            while len(waiting) < MAX_QUEUED_PER_WORKER * self.jobs:
                piece = next(queue, None)
                if piece is None:
                    return
                waiting.add(pool.submit(_work, piece))

        try:
            fill()
            while waiting:
                done, _ = wait(waiting, return_when=FIRST_COMPLETED)
                for future in done:
                    yield future.result()
                    waiting.discard(future)
                fill()
        except KeyboardInterrupt:
            pool.shutdown(cancel_futures=True)
            for future in waiting:
                if future.done() and not future.cancelled():
                    yield future.result()
            raise
        finally:
            pool.shutdown(cancel_futures=True)


_worker: Worker | None = None


def _begin(begin: Callable[[], Worker]) -> None:
    """Make this process' worker. Ctrl-C is handled by the process that distributes the work."""
    global _worker
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with suppress(OSError):
        os.nice(5)
    parent = parent_process()
    if parent is not None:  # a killed sweep leaves no worker behind
        threading.Thread(target=_leave_with, args=(parent.sentinel,), daemon=True).start()
    _worker = begin()


def _leave_with(sentinel: int) -> None:
    connection.wait([sentinel])
    os._exit(1)


def _work(piece: Piece) -> Any:
    assert _worker is not None
    return _worker(piece)
