"""Real-time requests to the machine: priority, locked memory, a core, no garbage collector.

Every request may be refused; each result is a sentence for the report.
"""

from __future__ import annotations

import ctypes
import gc
import os
from collections.abc import Iterator
from contextlib import contextmanager

_MCL_CURRENT, _MCL_FUTURE = 1, 2


def _raise_priority(priority: int) -> str:
    if priority == 0:
        return "SCHED_FIFO not requested"
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError as err:
        return f"SCHED_FIFO refused ({err.strerror}); running under the default scheduler"
    return f"SCHED_FIFO, priority {priority}"


def lock_pages(wanted: bool) -> str:
    """Keep this process' memory from being swapped, if wanted; return what came of it."""
    if not wanted:
        return "mlockall not requested"
    try:
        libc = ctypes.CDLL(None, use_errno=True)
        if libc.mlockall(_MCL_CURRENT | _MCL_FUTURE) == 0:
            return "memory locked"
        reason = os.strerror(ctypes.get_errno())
    except (OSError, AttributeError) as err:
        reason = str(err)
    return f"mlockall refused ({reason}); a page fault may delay a cycle"


def _pin(cpu: int | None) -> str:
    if cpu is None:
        return "not pinned to a core"
    try:
        os.sched_setaffinity(0, {cpu})
    except OSError as err:
        return f"core {cpu} refused ({err.strerror})"
    return f"pinned to core {cpu}"


@contextmanager
def quiet_collector(*, off: bool = True) -> Iterator[None]:
    """Collect once, freeze live objects, and keep the collector off inside the block.

    Not `off`, for what runs for days, it goes on with new objects alone.

    In a program that froze its objects itself nothing more is frozen, and its objects stay frozen:
    there is a single heap of frozen objects, and thawing it thaws all of them.
    """
    was_enabled = gc.isenabled()
    frozen = gc.get_freeze_count() > 0
    gc.collect()
    if not frozen:
        gc.freeze()
    if off:
        gc.disable()
    try:
        yield
    finally:
        if not frozen:
            gc.unfreeze()
        if was_enabled:
            gc.enable()


@contextmanager
def realtime(priority: int, cpu: int | None, lock_memory: bool) -> Iterator[list[str]]:
    """Request real-time conditions inside the block; yield one sentence per request.

    The scheduler and the affinity are put back afterwards; locked memory is released.
    """
    scheduler = os.sched_getscheduler(0)
    parameters = os.sched_getparam(0)
    affinity = os.sched_getaffinity(0)
    sentences = [_pin(cpu), lock_pages(lock_memory), _raise_priority(priority)]
    try:
        yield sentences
    finally:
        os.sched_setscheduler(0, scheduler, parameters)
        os.sched_setaffinity(0, affinity)
        if lock_memory:
            ctypes.CDLL(None).munlockall()
