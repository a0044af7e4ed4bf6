"""The host's cost of one exchange of two drives, device excluded.

The other end is a process that answers the same bytes to every request of the right length, with
the request's transaction numbers; so nothing but our side differs between the driver, pymodbus's
synchronous client and the floor: the same bytes written and read back with nothing made of them.
They take turns in short chunks in one run.
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
from typing import Any

from tautwave.clock import MonotonicClock
from tautwave.contracts import AxisSpec, BusSpec, CycleCost
from tautwave.types import AxisCommand
from tautwave_drivers.modbus.driver import ModbusDriver
from tautwave_drivers.modbus.frames import rtu_frame, tcp_frame
from tautwave_drivers.modbus.options import ModbusOptions

CHUNK = 20
"""Exchanges of one kind in a row, before the next has its turn."""
TCP_RATIO, RTU_RATIO = 2.0, 1.5
LIMIT_NS = 200_000_000
UNIT = 1

RESPONDER = """
import os, sys
link, question, answer = int(sys.argv[1]), int(sys.argv[2]), bytes.fromhex(sys.argv[3])
numbered = len(sys.argv) > 4
held = b""
while True:
    held += os.read(link, 4096)
    while len(held) >= question:
        os.write(link, held[:2] + answer if numbered else answer)
        held = held[question:]
"""

Cycle = Callable[[], None]
ANSWER = bytes((23, 8, 0, 3, 0, 0, 0, 0, 4, 210))
"""Status, fault code and position of the generic profile."""


def measure(cycles: int) -> Sequence[CycleCost]:
    """Measure an exchange over TCP and over RTU, ours and pymodbus's, over the floor.

    Parameters
    ----------
    cycles : int
        Exchanges per figure.
    """
    costs = []
    for rtu in (False, True):
        where = "RTU over a pty" if rtu else "TCP"
        what = f"1 drive, FC 23 over {where}, ours"
        spent, floor = _in_turn(_own_cycle, rtu, cycles)
        ratio = RTU_RATIO if rtu else TCP_RATIO
        costs.append(CycleCost(what, spent, floor, goal_ratio=ratio))
        theirs = what.replace("ours", "pymodbus (synchronous client)")
        # Two sleeps of a millisecond each: a tenth of the exchanges tells as much.
        spent, floor = _in_turn(_sync_cycle, rtu, max(CHUNK, cycles // 10 if rtu else cycles))
        costs.append(CycleCost(theirs, spent, floor))
    return costs


def _in_turn(
    make: Callable[[str, bool], tuple[Cycle, Cycle]], rtu: bool, cycles: int
) -> tuple[list[float], list[float]]:
    """Return the times of one kind of cycle and of its floor [us], in turns of `CHUNK`."""
    spent: list[float] = []
    floor: list[float] = []
    question, answer = _bytes(rtu)
    with contextlib.ExitStack() as stack:
        path = stack.enter_context(_responder(rtu, len(question), answer))
        cycle, release = make(path, rtu)
        stack.callback(release)
        bare = stack.enter_context(_bare_end(path, rtu))
        size = len(answer) + (0 if rtu else 2)
        for _ in range(CHUNK):
            cycle()
        while len(spent) < cycles:
            _timed(cycle, spent)
            _timed(lambda: _bare(bare, question, size), floor)
    return spent[:cycles], floor[:cycles]


def _timed(cycle: Cycle, into: list[float]) -> None:
    gc.disable()
    try:
        for _ in range(CHUNK):
            began = time.perf_counter_ns()
            cycle()
            into.append((time.perf_counter_ns() - began) * 1e-3)
    finally:
        gc.enable()


def _options(path: str, rtu: bool) -> ModbusOptions:
    return ModbusOptions.model_validate(
        {
            "link": "rtu" if rtu else "tcp",
            "endpoint": path,
            "baud": 4_000_000,
            "gap_s": 1e-9,
            "devices": [{"unit": UNIT, "rated_torque": 1.0}],
        }
    )


def _driver(path: str, rtu: bool) -> ModbusDriver:
    axis = AxisSpec(f"slave.a{UNIT}", UNIT, "rotary", "impedance", 1.0)
    bus = BusSpec("bench", (axis,), 1000.0)
    return ModbusDriver(_options(path, rtu), bus, MonotonicClock(), None)


def _bytes(rtu: bool) -> tuple[bytes, bytes]:
    """Return the request of a cycle and the answer, without transaction number where there is."""
    driver = _driver("tcp://127.0.0.1:1", False)
    question = bytes(driver.make_stations()[0].plan.questions[0].pdu)
    if rtu:
        return rtu_frame(UNIT, question), rtu_frame(UNIT, ANSWER)
    return tcp_frame(1, UNIT, question), tcp_frame(0, UNIT, ANSWER)[2:]


@contextlib.contextmanager
def _responder(rtu: bool, question: int, answer: bytes) -> Iterator[str]:
    """Give the endpoint behind which a process answers; a TCP one answers two connections."""
    with contextlib.ExitStack() as stack:
        ends = []
        if rtu:
            master, slave = os.openpty()
            stack.callback(os.close, slave)
            tty.setraw(slave)
            ends.append(master)
            path = os.ttyname(slave)
        else:
            listener = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
            path = f"tcp://127.0.0.1:{listener.getsockname()[1]}"
        if rtu:
            _start(stack, ends.pop(), question, answer, numbered=False)
        else:
            _serve(stack, listener, question, answer)
        yield path


def _serve(
    stack: contextlib.ExitStack, listener: socket.socket, question: int, answer: bytes
) -> None:
    """Have one process per connection answer, each as soon as it is made."""
    code = (
        "import os, socket, sys\n"
        "listener = socket.socket(fileno=int(sys.argv[1]))\n"
        "while True:\n"
        "    peer, _ = listener.accept()\n"
        "    peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)\n"
        "    if os.fork() == 0:\n"
        "        break\n"
        "sys.argv[1] = str(peer.fileno())\n"
    ) + RESPONDER.replace("os.read(link, 4096)", "os.read(link, 4096) or os._exit(0)")
    words = [sys.executable, "-S", "-c", code, str(listener.fileno()), str(question), answer.hex()]
    child = subprocess.Popen(
        [*words, "numbered"], pass_fds=(listener.fileno(),), stderr=subprocess.DEVNULL
    )
    stack.callback(child.wait)
    stack.callback(child.kill)


def _start(
    stack: contextlib.ExitStack, end: int, question: int, answer: bytes, *, numbered: bool
) -> None:
    words = [sys.executable, "-S", "-c", RESPONDER, str(end), str(question), answer.hex()]
    try:
        child = subprocess.Popen(words, pass_fds=(end,), stderr=subprocess.DEVNULL)
    finally:
        os.close(end)
    stack.callback(child.wait)
    stack.callback(child.kill)


@contextlib.contextmanager
def _bare_end(path: str, rtu: bool) -> Iterator[int]:
    """Give a file descriptor of one's own to the responder."""
    if rtu:
        end = os.open(path, os.O_RDWR | os.O_NOCTTY)
        try:
            yield end
        finally:
            os.close(end)
        return
    host, port = path.removeprefix("tcp://").split(":")
    with socket.create_connection((host, int(port))) as link:
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        yield link.fileno()


def _bare(end: int, question: bytes, count: int) -> None:
    """Write the request and read the answer, blocking, and make nothing of it."""
    os.write(end, question)
    while count > 0:
        ready, _, _ = select.select([end], [], [], LIMIT_NS * 1e-9)
        if not ready:
            return
        count -= len(os.read(end, 4096))


def _own_cycle(path: str, rtu: bool) -> tuple[Cycle, Cycle]:
    """Return what the driver does in a cycle: command from SI, exchange, sample in SI."""
    driver = _driver(path, rtu)
    driver.attach()
    clock = MonotonicClock()
    commands = [AxisCommand(0.05, 0.0)]

    def cycle() -> None:
        driver.request()
        driver.read(clock.now_ns() + LIMIT_NS)
        driver.write(commands)

    return cycle, driver.detach


def _sync_cycle(path: str, rtu: bool) -> tuple[Cycle, Cycle]:
    """Return what pymodbus's synchronous client does for the same exchange."""
    from pymodbus.client import ModbusSerialClient, ModbusTcpClient

    client: Any
    if rtu:
        client = ModbusSerialClient(path, baudrate=115_200, timeout=0.2, retries=0)
    else:
        host, port = path.removeprefix("tcp://").split(":")
        client = ModbusTcpClient(host, port=int(port), timeout=0.2, retries=0)
    client.connect()

    def cycle() -> None:
        answer = client.readwrite_registers(
            read_address=2, read_count=4, write_address=18, values=[50], device_id=UNIT
        )
        client.convert_from_registers(answer.registers[2:4], client.DATATYPE.INT32)

    return cycle, client.close
