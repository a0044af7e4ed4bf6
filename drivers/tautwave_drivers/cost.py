"""The host's cost of an exchange, in turns with its floor: what the drivers' `measure` share.

The floor is the same bytes written and read back without interpretation. Driver, vendor library and
floor take turns in short chunks of one run, so that they meet the same machine.
"""

from __future__ import annotations

import contextlib
import gc
import os
import select
import subprocess
import sys
import time
import tty
from collections.abc import Callable, Iterator

CHUNK = 20
"""Exchanges of one kind in a row, before it is the next kind's turn."""

LIMIT_NS = 200_000_000
"""Longest wait for a response."""

RESPONDER = """
import os, sys
link, request, response = int(sys.argv[1]), int(sys.argv[2]), bytes.fromhex(sys.argv[3])
numbered = len(sys.argv) > 4
held = b""
while True:
    held += os.read(link, 4096)
    while len(held) >= request:
        os.write(link, held[:2] + response if numbered else response)
        held = held[request:]
"""
"""Program of a process that answers every request of the right length with the same bytes."""

Cycle = Callable[[], int]
"""One cycle; returns the time it took [ns]."""


def timed(cycle: Callable[[], object]) -> Cycle:
    """Return a cycle that also returns its time."""
    tick = time.perf_counter_ns

    def run() -> int:
        began = tick()
        cycle()
        return tick() - began

    return run


def in_turn(
    cycles: int, one: Cycle, floor: Cycle, chunk: int = CHUNK
) -> tuple[list[float], list[float]]:
    """Return the times [us] of both, in turns of `chunk`, the garbage collector off as in a run."""
    taken: tuple[list[float], list[float]] = ([], [])
    was_enabled = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        for turn in range(-(-cycles // chunk) + 1):
            for cycle, times in zip((one, floor), taken, strict=True):
                spent = [cycle() * 1e-3 for _ in range(chunk)]
                if turn:  # the first turn warms up
                    times += spent
    finally:
        if was_enabled:
            gc.enable()
    return taken[0][:cycles], taken[1][:cycles]


def bare_exchange(end: int, request: bytes, count: int) -> None:
    """Write a request and read `count` bytes of response, blocking, without interpretation."""
    os.write(end, request)
    while count > 0:
        ready, _, _ = select.select([end], [], [], LIMIT_NS * 1e-9)
        if not ready:
            return
        count -= len(os.read(end, 4096))


@contextlib.contextmanager
def responder_on_pty(request: int, response: bytes) -> Iterator[tuple[str, int]]:
    """Yield path and open end of a pseudo-terminal with a process that responds behind it."""
    master, slave = os.openpty()
    tty.setraw(slave)
    words = [sys.executable, "-S", "-c", RESPONDER, str(master), str(request), response.hex()]
    with contextlib.ExitStack() as stack:
        stack.callback(os.close, slave)
        try:
            child = subprocess.Popen(words, pass_fds=(master,), stderr=subprocess.DEVNULL)
        finally:
            os.close(master)
        stack.callback(child.wait)
        stack.callback(child.kill)
        yield os.ttyname(slave), slave
