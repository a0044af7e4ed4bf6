"""Real-time conditions: requested, reported as text, and restored."""

from __future__ import annotations

import gc
import os
from collections.abc import Iterator
from contextlib import suppress
from importlib.util import find_spec, module_from_spec
from types import ModuleType

import pytest

from tautwave.runtime.machine import quiet_collector, realtime


def unpatched() -> ModuleType:
    """Return the module as it is written: `tests/conftest.py` keeps it from locking memory."""
    spec = find_spec("tautwave.runtime.machine")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def thawed() -> Iterator[None]:
    """Nothing is frozen, as in a program of its own; `tests/conftest.py` freezes what it found."""
    gc.unfreeze()
    yield
    gc.freeze()


@pytest.mark.usefixtures("thawed")
def test_the_collector_is_off_inside_and_back_afterwards() -> None:
    assert gc.isenabled()
    with suppress(RuntimeError), quiet_collector():
        assert not gc.isenabled()
        assert gc.get_freeze_count() > 0
        raise RuntimeError
    assert gc.isenabled()
    assert gc.get_freeze_count() == 0


def test_what_a_program_froze_itself_stays_frozen(thawed: None) -> None:
    gc.freeze()
    before = gc.get_freeze_count()
    with quiet_collector():
        assert not gc.isenabled()
    assert gc.get_freeze_count() == before


def test_a_collector_that_was_off_stays_off() -> None:
    gc.disable()
    try:
        with quiet_collector():
            assert not gc.isenabled()
        assert not gc.isenabled()
    finally:
        gc.enable()


def test_nothing_asked_for_is_said() -> None:
    with realtime(0, None, False) as reported:
        assert reported == [
            "not pinned to a core",
            "mlockall not requested",
            "SCHED_FIFO not requested",
        ]


def test_a_core_is_taken_and_given_back() -> None:
    before = os.sched_getaffinity(0)
    core = min(before)
    with suppress(RuntimeError), realtime(0, core, False) as reported:
        assert reported[0] == f"pinned to core {core}"
        assert os.sched_getaffinity(0) == {core}
        raise RuntimeError
    assert os.sched_getaffinity(0) == before


def test_a_core_that_is_not_there_is_refused_in_words() -> None:
    with realtime(0, 1000, False) as reported:
        assert reported[0].startswith("core 1000 refused (")


def test_a_refused_priority_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    real = os.sched_setscheduler

    def refuse(pid: int, policy: int, param: os.sched_param) -> None:
        if policy == os.SCHED_FIFO:
            raise PermissionError(1, "Operation not permitted")
        real(pid, policy, param)

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    with realtime(50, None, False) as reported:
        assert reported[2].startswith("SCHED_FIFO refused (Operation not permitted)")


def test_what_is_asked_is_asked_for_this_process_and_put_back(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Number 0 is this process, whatever the others have."""
    calls: list[tuple[object, ...]] = []
    had = os.sched_param(7)
    held = {"scheduler": os.SCHED_RR, "param": had, "affinity": {0, 3}}
    for what, value in held.items():

        def get(pid: int, value: object = value) -> object:
            assert pid == 0
            return value

        monkeypatch.setattr(os, f"sched_get{what}", get)
    for what in ("scheduler", "affinity"):
        monkeypatch.setattr(
            os, f"sched_set{what}", lambda *asked, what=what: calls.append((what, *asked))
        )

    class Library:
        def mlockall(self, flags: int) -> int:
            calls.append(("lock", flags))
            return 0

        def munlockall(self) -> None:
            calls.append(("unlock",))

    monkeypatch.setattr("ctypes.CDLL", lambda name, use_errno=False: Library())
    with unpatched().realtime(50, 3, True) as reported:
        assert reported == ["pinned to core 3", "memory locked", "SCHED_FIFO, priority 50"]
        calls.append(("inside",))
    assert calls == [
        ("affinity", 0, {3}),
        ("lock", 3),
        ("scheduler", 0, os.SCHED_FIFO, os.sched_param(50)),
        ("inside",),
        ("scheduler", 0, os.SCHED_RR, had),
        ("affinity", 0, {0, 3}),
        ("unlock",),
    ]


def test_a_granted_priority_is_reported_and_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    monkeypatch.setattr(os, "sched_setscheduler", lambda *args: asked.append(args[1]))
    before = os.sched_getscheduler(0)
    with realtime(50, None, False) as reported:
        assert reported[2] == "SCHED_FIFO, priority 50"
    assert asked == [os.SCHED_FIFO, before]
