"""A sweep's pieces on a cluster of Dask workers: what one machine makes, to the byte.

A piece carries what makes its worker, pickled once, so that a worker that comes late or anew needs
nothing of the others. A window of pieces is under way, never all: memory of client and scheduler
stays flat. Before its first piece each process of a worker is compared with this one; another
version, or a mathematics library that rounds otherwise, would leave rows that depend on where they
were made, and is refused.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import math
import pickle
import queue
import re
import threading
import time
import uuid
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import suppress
from itertools import chain, islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tautwave import __version__
from tautwave.config.guard import parse_json, read_guarded
from tautwave.errors import ConfigError, LinkError
from tautwave.sweep.pool import MAX_QUEUED_PER_WORKER, Piece, Worker

ANSWER_S = 10
"""[s] How long a scheduler may take to answer."""
PATIENCE_S = 30
"""[s] How long it may take to have a worker."""
KEPT = 16
"""Messages of the last ones that the client keeps, of its 1000."""
COUNT_S = 5.0
"""[s] How often the workers are counted, for as many pieces as keep them busy."""
RETRIES = 2
"""A piece is given out again so often when its worker dies."""
GONE_S = 300.0
"""[s] How long a sweep waits when all workers are gone; a queue may bring others."""
LARGEST = 256 * 1024
"""Bytes of a scheduler's file."""
_ADDRESS = re.compile(r"((tcp|tls|ws|wss|ucx)://)?([^\s/:\[\]]+|\[[^\s\]]+\]):\d{1,5}/?")


class About(NamedTuple):
    """What rows depend on besides the sweep."""

    tautwave: str
    numpy: str
    rounding: str


def about() -> About:
    """Return what rows depend on, of this process.

    `rounding` is a digest of functions whose last bit differs between mathematics libraries and
    processors.
    """
    at = np.linspace(0.01, 9.0, 512)
    values = [np.sin(at), np.exp(-at), np.tanh(at), np.log(at), np.sqrt(at), at**0.3]
    plain = [f(x) for x in at.tolist() for f in (math.sin, math.exp, math.log, math.atan)]
    digest = hashlib.sha256(b"".join(one.tobytes() for one in values) + np.array(plain).tobytes())
    return About(__version__, np.__version__, digest.hexdigest()[:12])


def read_address(scheduler: str) -> str:
    """Return the address of a scheduler that is named by it, or by its file.

    Raises
    ------
    ConfigError
        It is neither. Dask would find out in half a minute, and say so with a traceback.
    LinkError
        There is no such file: no scheduler has written it yet.
    """
    address: Any = scheduler
    if scheduler.endswith(".json"):
        if not Path(scheduler).is_file():
            raise LinkError(f"{scheduler}: no such scheduler file; is the scheduler running?")
        try:
            parsed = parse_json(read_guarded(Path(scheduler), "scheduler file", LARGEST))
        except ValueError as err:
            raise ConfigError(f"{scheduler}: not a Dask scheduler file: {err}") from err
        address = parsed.get("address") if isinstance(parsed, dict) else None
    if not isinstance(address, str) or not _ADDRESS.fullmatch(address):
        raise ConfigError(
            f"--scheduler {scheduler}: neither an address, such as tcp://10.0.0.5:8786, nor the "
            "file that `dask scheduler --scheduler-file FILE.json` writes"
        )
    return address


class Cluster:
    """Runs pieces on the workers of a scheduler; an executor of a sweep.

    Parameters
    ----------
    scheduler : str
        Address, as `tcp://host:8786`, or the path of a scheduler file (`.json`).

    Attributes
    ----------
    jobs : int
        Threads of all workers there are.

    Raises
    ------
    ConfigError
        `distributed` is not installed.
    LinkError
        There is no scheduler, or it has no workers.
    """

    def __init__(self, scheduler: str) -> None:
        try:
            self._dask = importlib.import_module("distributed")
        except ImportError as err:
            raise ConfigError(
                "--scheduler needs Dask's distributed: pip install 'tautwave[cluster]'"
            ) from err
        self._name = scheduler
        self._client = self._connect(scheduler)
        self.jobs, self._counted, self._manned = 1, -math.inf, time.monotonic()
        self._count()

    def _connect(self, scheduler: str) -> Any:
        address = read_address(scheduler)
        settings = importlib.import_module("dask.config")
        try:
            # It keeps what it sent last, and a piece carries what makes its worker.
            with settings.set({"distributed.admin.low-level-log-length": KEPT}):
                client = self._dask.Client(address, timeout=ANSWER_S, set_as_default=False)
        except (OSError, TimeoutError) as err:
            raise LinkError(
                f"no scheduler answers at {scheduler} ({err}); start one with `dask scheduler`, "
                "and workers with `dask worker`"
            ) from err
        try:
            client.wait_for_workers(1, timeout=PATIENCE_S)
        except TimeoutError as err:
            client.close()
            raise LinkError(
                f"the scheduler at {scheduler} has had no worker for {PATIENCE_S} s; start some "
                "with `dask worker`"
            ) from err
        return client

    def _count(self) -> None:
        """Count the threads again, now and then: workers come and go."""
        now = time.monotonic()
        if now - self._counted > COUNT_S:
            threads = sum(self._client.nthreads().values())
            self.jobs, self._counted = max(1, threads), now
            self._manned = now if threads else self._manned

    def close(self) -> None:
        """Leave the cluster; its workers stay."""
        with suppress(OSError, TimeoutError):
            self._client.close()

    def __call__(
        self, begin: Callable[[], Worker], pieces: Iterable[Piece]
    ) -> Generator[Any, None, None]:
        """Yield results in any order; closing the generator takes back what has not begun.

        Raises
        ------
        ConfigError
            A worker is not like this process.
        LinkError
            The scheduler is gone, or a worker cannot do a piece.
        """
        client = self._client
        do = functools.partial(work, uuid.uuid4().hex, pickle.dumps(begin), about())
        ahead: Iterator[Piece] = iter(pieces)
        finished: queue.SimpleQueue[Any] = queue.SimpleQueue()
        waiting: set[Any] = set()

        def fill() -> None:
            self._count()
            more = list(islice(ahead, max(0, MAX_QUEUED_PER_WORKER * self.jobs - len(waiting))))
            for future in client.map(do, more, pure=False, retries=RETRIES) if more else ():
                waiting.add(future)
                future.add_done_callback(finished.put)

        try:
            fill()
            while waiting:
                by_status: dict[str, list[Any]] = {}
                for one in self._next(finished):
                    by_status.setdefault(one.status, []).append(one)
                good = by_status.pop("finished", [])
                for one in (*by_status.pop("lost", []), *by_status.pop("pending", [])):
                    # Its worker died with the result; the scheduler has it made again.
                    one.add_done_callback(finished.put)
                yield from client.gather(good)
                for one in chain.from_iterable(by_status.values()):
                    one.result()  # raises what befell it
                waiting.difference_update(good)
                fill()
        except (ConfigError, LinkError):
            raise
        except Exception as err:
            if client.status != "running" or isinstance(err, OSError):
                raise self._lost() from err
            raise LinkError(
                f"a worker of {self._name} failed: {type(err).__name__}: {err}; rows so far are "
                "kept, and the same command resumes"
            ) from err
        finally:
            for future in waiting:
                with suppress(Exception):
                    future.cancel()

    def _next(self, finished: queue.SimpleQueue[Any]) -> list[Any]:
        """Wait for a piece and take all that ended; without scheduler or workers none comes."""
        while True:
            with suppress(queue.Empty):
                ended = [finished.get(timeout=1.0)]
                while not finished.empty():
                    ended.append(finished.get())
                return ended
            if self._client.status != "running":
                raise self._lost()
            self._count()
            if time.monotonic() - self._manned > GONE_S:
                raise LinkError(
                    f"the scheduler at {self._name} has had no worker for {GONE_S:g} s; rows so "
                    "far are kept, and the same command resumes"
                )

    def _lost(self) -> LinkError:
        return LinkError(
            f"the scheduler at {self._name} is gone; rows so far are kept, and the same command "
            "resumes"
        )


_here = threading.local()


def work(token: str, content: bytes, wanted: About, piece: Piece) -> Any:
    """Do a piece on a worker; each thread makes its own worker of a sweep, once.

    Raises
    ------
    ConfigError
        This process is not like the one that asks.
    """
    if getattr(_here, "token", None) != token:
        worker = about()
        for name, this, that in zip(About._fields, worker, wanted, strict=True):
            if this != that:
                cause = {
                    "rounding": "its processor or math library rounds differently, so rows would "
                    "depend on the machine; use machines of the same type",
                }.get(name, f"it has {name} {this}, this machine {that}; install the same on both")
                raise ConfigError(f"worker {_address()}: {cause}")
        _here.worker, _here.token = pickle.loads(content)(), token
    return _here.worker(piece)


def _address() -> str:
    try:
        return str(importlib.import_module("distributed").get_worker().address)
    except (ImportError, ValueError):
        return "here"
