"""The host's cost of an exchange, in turns with its floor: the harness of the drivers' `measure`.

It takes a driver, or a vendor's library, and the bytes of a cycle; a process of its own responds to
them, over a pseudo-terminal or TCP, or stand-ins of the devices between the calls. The floor is the
same bytes written and read back without interpretation. Both take turns in short chunks of one run,
so that they meet the same machine.
"""

from __future__ import annotations

import contextlib
import gc
import os
import select
import socket
import subprocess
import sys
import time
import tty
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from tautwave.contracts import AxisSpec, BusSpec, Clock, Driver
from tautwave.errors import DriverError
from tautwave.types import AxisCommand

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

ACCEPTING = """
import os, socket, sys
listener = socket.socket(fileno=int(sys.argv[1]))
while True:
    peer, _ = listener.accept()
    peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    if os.fork() == 0:
        break
sys.argv[1] = str(peer.fileno())
"""
"""What makes it one process for each connection."""

Cycle = Callable[[], int]
"""One cycle; returns the time it took [ns]."""

Made = tuple[Cycle, Callable[[], None]]
"""A cycle, and what closes its end."""


class Exchange(NamedTuple):
    """The bytes of a cycle; over TCP the two that number a request begin its response as well."""

    request: bytes
    response: bytes
    tcp: bool = False


def bench_bus(ids: Sequence[int]) -> BusSpec:
    """Return a bus with axes of these ids that take effort, at 1 kHz."""
    axes = (AxisSpec(f"bench.a{one}", one, "rotary", "impedance", 1.0) for one in ids)
    return BusSpec("bench", tuple(axes), 1000.0)


def driver_cycle(
    driver: Driver,
    clock: Clock,
    commands: Sequence[AxisCommand],
    work: Callable[[], None] | None = None,
) -> Cycle:
    """Return what a driver does in a cycle, from commands in SI to samples in SI.

    `work` is that of stand-ins in this process, in between and not timed: they miss no sample.
    """
    tick = time.perf_counter_ns

    def cycle() -> int:
        first = tick()
        driver.request()
        spent = tick() - first
        if work is not None:
            work()
        first = tick()
        states = driver.read(clock.now_ns() + LIMIT_NS)
        driver.write(commands)
        spent += tick() - first
        if work is not None:
            work()
            if not all(state.valid for state in states):
                raise DriverError(f"bench: a sample is missing: {list(driver.faults())}")
        return spent

    return cycle


def measured(
    exchange: Exchange, make: Callable[[str], Made], cycles: int
) -> tuple[list[float], list[float]]:
    """Return the times [us] of what `make` makes in front of a responder, and of their floor."""
    request, response, tcp = exchange
    with contextlib.ExitStack() as stack:
        path, end = stack.enter_context(responder(exchange))
        cycle, release = make(path)
        stack.callback(release)
        size = len(response) + (2 if tcp else 0)
        return in_turn(cycles, cycle, timed(lambda: bare_exchange(end, request, size)))


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
def responder(exchange: Exchange) -> Iterator[tuple[str, int]]:
    """Yield what a driver opens, and an open end for the floor, with a process that responds."""
    with contextlib.ExitStack() as stack:
        if exchange.tcp:
            listener = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
            code = ACCEPTING + RESPONDER.replace(
                "os.read(link, 4096)", "os.read(link, 4096) or os._exit(0)"
            )
            _start(stack, code, listener.fileno(), exchange)
            address = listener.getsockname()
            end = stack.enter_context(socket.create_connection(address))
            end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            yield f"tcp://127.0.0.1:{address[1]}", end.fileno()
            return
        master, slave = os.openpty()
        stack.callback(os.close, slave)
        tty.setraw(slave)
        try:
            _start(stack, RESPONDER, master, exchange)
        finally:
            os.close(master)
        yield os.ttyname(slave), slave


def _start(stack: contextlib.ExitStack, code: str, link: int, exchange: Exchange) -> None:
    """Start the process that responds on a descriptor."""
    request, response, tcp = exchange
    words = [sys.executable, "-S", "-c", code, str(link), str(len(request)), response.hex()]
    words += ["numbered"] if tcp else []
    child = subprocess.Popen(words, pass_fds=(link,), stderr=subprocess.DEVNULL)
    stack.callback(child.wait)
    stack.callback(child.kill)
