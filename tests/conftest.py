"""Rules for every test: repeatable random cases, nothing left running or switched off."""

from __future__ import annotations

import fcntl
import gc
import multiprocessing
import os
import pickle
import signal
import socket
import subprocess
import sys
import tempfile
import threading
from collections import Counter
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any

if sys.dont_write_bytecode:
    # To keep a checkout clean of bytecode is no wish to compile every module again in each of a
    # hundred processes: a second a start. It goes elsewhere.
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    sys.pycache_prefix = os.environ["PYTHONPYCACHEPREFIX"] = str(cache / "tautwave" / "bytecode")
    sys.dont_write_bytecode = False
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# Before NumPy: threads of BLAS only wait for each other beside the workers of xdist.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
from hypothesis import HealthCheck, settings

from tautwave.config.text import document, yaml12
from tautwave.runtime import machine
from tests import compiling, workers
from tests.examples import FEW

# `.ci/run` sets it: it has installed every library, so a test that misses one is a hole in the net.
# `.ci/peers` sets the second, to the clients of others that it could install.
LIBRARIES_REQUIRED = os.environ.get("TAUTWAVE_LIBRARIES") == "required"
PEERS = os.environ.get("TAUTWAVE_PEERS", "").split()

# The same cases each time, so that a red run is about the change and not about luck; the machine's
# speed is nobody's business. `pytest --hypothesis-profile=more` tries twice as many of them, also
# where a default test has a number of its own (`tests.examples`); `explore` looks for new ones.
settings.register_profile(
    "steady",
    derandomize=True,
    deadline=None,
    max_examples=FEW,
    print_blob=True,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.register_profile("more", settings.get_profile("steady"), max_examples=2 * FEW)
settings.register_profile("explore", deadline=None, max_examples=1000, print_blob=True)
settings.load_profile("steady")
# Hypothesis also tries the constants of whatever modules a worker happens to have loaded: the same
# test would try other numbers in each run. It has no setting for that; older versions do not.
providers: Any = sys.modules.get("hypothesis.internal.conjecture.providers")
if hasattr(providers, "_get_local_constants"):
    providers._get_local_constants = lambda: providers._local_constants

if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    # Under nohup a program leaves SIGHUP ignored, on purpose; tests of SIGHUP need the default.
    signal.signal(signal.SIGHUP, signal.SIG_DFL)

Report = pytest.TestReport | pytest.CollectReport


# `.ci/vcan` sets it: there a skipped vcan test is a hole in the net, and fails.
VCAN_REQUIRED = os.environ.get("TAUTWAVE_VCAN") == "required"


COMPILER = pytest.StashKey[subprocess.Popen[bytes] | None]()


def pytest_configure(config: pytest.Config) -> None:
    config.stash[COMPILER] = compiling.start(config)


def pytest_unconfigure(config: pytest.Config) -> None:
    compiler = config.stash.get(COMPILER, None)
    if compiler is not None:
        compiler.terminate()
        compiler.wait()


@pytest.fixture
def no_bytecode(monkeypatch: pytest.MonkeyPatch) -> None:
    """Write no bytecode, here and in children: for tests that limit the size of files.

    What a limit or a full disk cuts off, importlib of Python 3.11 takes for written, and every
    later import of that module ends with an EOFError.
    """
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int | None:
    """A few files run in this process: workers take longer to start than most files run."""
    return 0 if workers.names_only_files(config.invocation_params.args) else None


@pytest.hookimpl(tryfirst=True)  # before markers are looked at
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    without_vcan = all(name != "vcan0" for _, name in socket.if_nameindex())
    seen: Counter[str] = Counter()
    for item in items:
        if without_vcan and item.get_closest_marker("vcan"):
            item.add_marker(pytest.mark.skip(reason="there is no interface vcan0; see .ci/vcan"))
        if item.name == "test_compiled_it_is_the_same_to_the_bit":
            item.add_marker(pytest.mark.slow)  # of the suite for authors: a compile for each law
            item.add_marker(pytest.mark.nightly)
        if item.get_closest_marker("nightly"):
            item.add_marker(pytest.mark.slow)
        sparse = item.get_closest_marker("sparse")
        if sparse is not None:
            function = item.nodeid.partition("[")[0]
            if seen[function] % sparse.args[0]:
                item.add_marker(pytest.mark.slow)
            seen[function] += 1


def pytest_collection_finish() -> None:
    """Keep thousands of collected tests out of what the garbage collector looks through."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 10, 10)  # a hundredth of all the time went into looking


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, Report, Report]:
    return forbid_skip((yield), item.get_closest_marker("vcan") is not None)


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector: pytest.Collector) -> Generator[None, Report, Report]:
    return forbid_skip((yield), collector.path.parent.name == "vcan")


def forbid_skip(report: Report, about_vcan: bool) -> Report:
    """Turn a skip into a failure, whoever asked for it, where what it misses is required."""
    if not report.skipped or hasattr(report, "wasxfail"):
        return report
    reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
    required = ""
    if VCAN_REQUIRED and about_vcan:
        required = "TAUTWAVE_VCAN"
    elif LIBRARIES_REQUIRED and "could not import" in reason:
        required = "TAUTWAVE_LIBRARIES"
    elif any(peer in reason for peer in PEERS):
        required = "TAUTWAVE_PEERS"
    if required:
        report.outcome = "failed"
        report.longrepr = f"{required}=required, but: {reason}"
    return report


@pytest.fixture(autouse=True, scope="session")
def alone_with_its_servers(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep what this worker serves from being found by others, and theirs by it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_RUNTIME_DIR", str(tmp_path_factory.mktemp("runtime")))
        yield


@pytest.fixture(autouse=True, scope="session")
def cheap_in_a_worker() -> Iterator[None]:
    """Keep this worker's memory unlocked and have it wait for who compiles.

    Tests of the installed command lock theirs. A worker has gigabytes of it: to lock them took
    seconds for every run.
    """
    with pytest.MonkeyPatch.context() as patch:
        asked = machine.lock_pages
        patch.setattr(machine, "lock_pages", lambda w: "memory locked" if w else asked(w))
        compiling.wait_for_it(patch)
        yield


@pytest.fixture(autouse=True, scope="session")
def rig_files_parsed_once() -> Iterator[None]:
    """Parse the same YAML text once; its parser is Python, and tests load the shipped rigs often.

    Each load gets a copy of its own. Tests of the parser call it directly.
    """
    parsed: dict[tuple[str, Any], bytes] = {}

    def parse_once(text: str, mark: Any = None) -> Any:
        if (text, mark) not in parsed:
            parsed[text, mark] = pickle.dumps(yaml12.parse_yaml(text, mark))
        return pickle.loads(parsed[text, mark])

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(document, "parse_yaml", parse_once)
        yield


@pytest.fixture(autouse=True)
def alone_on_the_buses(request: pytest.FixtureRequest) -> Iterator[None]:
    """Keep the other workers of xdist off vcan0 and vcan1 while a vcan test has them."""
    if not request.node.get_closest_marker("vcan"):
        yield
        return
    with (Path(tempfile.gettempdir()) / f"tautwave-vcan-{os.getuid()}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


KEPT = ("Dask-Callback", "IO loop")
"""Threads that a Dask client keeps until its process ends."""


@pytest.fixture(autouse=True)
def nothing_left_behind() -> Iterator[None]:
    """Fail a test that leaves a process, a thread, a signal handler or the collector changed."""
    interrupt = signal.getsignal(signal.SIGINT)
    threads = set(threading.enumerate())
    priority = os.sched_getscheduler(0)
    yield
    left = [
        *(f"process {child.name}" for child in multiprocessing.active_children()),
        *(
            f"thread {t.name}"
            for t in set(threading.enumerate()) - threads
            if t.is_alive() and not t.name.startswith(KEPT)
        ),
    ]
    if signal.getsignal(signal.SIGINT) is not interrupt:
        signal.signal(signal.SIGINT, interrupt)
        left.append("a handler of SIGINT")
    if not gc.isenabled():
        gc.enable()
        left.append("the garbage collector off")
    if os.sched_getscheduler(0) != priority:
        left.append("another scheduling policy")
    assert not left, f"the test left behind: {', '.join(left)}"
