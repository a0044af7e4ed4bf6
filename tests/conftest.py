"""Rules for every test: repeatable random cases, nothing left running or switched off."""

from __future__ import annotations

import gc
import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

# The same cases each time, so that a red run is about the change and not about luck; the machine's
# speed is nobody's business. `pytest --hypothesis-profile=explore` looks for new ones.
settings.register_profile(
    "steady",
    derandomize=True,
    deadline=None,
    print_blob=True,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.register_profile("explore", deadline=None, max_examples=1000, print_blob=True)
settings.load_profile("steady")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    if Path("/sys/class/net/vcan0").exists():
        return
    for item in items:
        if item.get_closest_marker("vcan"):
            item.add_marker(pytest.mark.skip(reason="there is no interface vcan0 on this machine"))


@pytest.fixture(autouse=True)
def nothing_left_behind() -> Iterator[None]:
    """Fail a test that leaves a process, a thread, a signal handler or the collector changed."""
    interrupt = signal.getsignal(signal.SIGINT)
    threads = set(threading.enumerate())
    priority = os.sched_getscheduler(0)
    yield
    left = [
        *(f"process {child.name}" for child in multiprocessing.active_children()),
        *(f"thread {t.name}" for t in set(threading.enumerate()) - threads if t.is_alive()),
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
