"""The host's cost of one exchange with a drive over TCP and RTU; pymodbus's client beside it."""

from __future__ import annotations

import contextlib
import os
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from tautwave.clock import MonotonicClock
from tautwave.contracts import AxisSpec, BusSpec, CycleCost
from tautwave.types import AxisCommand
from tautwave_drivers.cost import (
    CHUNK,
    LIMIT_NS,
    RESPONDER,
    bare_exchange,
    in_turn,
    responder_on_pty,
    timed,
)
from tautwave_drivers.modbus.driver import ModbusDriver
from tautwave_drivers.modbus.options import ModbusOptions
from tautwave_drivers.modbus.protocol.frames import rtu_frame, tcp_frame

TCP_RATIO, RTU_RATIO = 2.0, 1.5
UNIT = 1

Work = Callable[[], None]
RESPONSE = bytes((23, 8, 0, 3, 0, 0, 0, 0, 4, 210))
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
        # It sleeps twice for a millisecond: a tenth of the exchanges is enough.
        spent, floor = _in_turn(_sync_cycle, rtu, max(CHUNK, cycles // 10 if rtu else cycles))
        costs.append(CycleCost(theirs, spent, floor))
    return costs


def _in_turn(
    make: Callable[[str, bool], tuple[Work, Work]], rtu: bool, cycles: int
) -> tuple[list[float], list[float]]:
    """Return the times of one kind of cycle and of its floor [us]."""
    request, response = _bytes(rtu)
    with contextlib.ExitStack() as stack:
        path = stack.enter_context(_responder(rtu, len(request), response))
        cycle, release = make(path, rtu)
        stack.callback(release)
        end = stack.enter_context(_bare_end(path, rtu))
        size = len(response) + (0 if rtu else 2)
        floor = timed(lambda: bare_exchange(end, request, size))
        return in_turn(cycles, timed(cycle), floor)


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
    """Return request and response of a cycle, the response without its transaction identifier."""
    driver = _driver("tcp://127.0.0.1:1", False)
    request = bytes(driver.make_stations()[0].plan.requests[0].pdu)
    if rtu:
        return rtu_frame(UNIT, request), rtu_frame(UNIT, RESPONSE)
    return tcp_frame(1, UNIT, request), tcp_frame(0, UNIT, RESPONSE)[2:]


@contextlib.contextmanager
def _responder(rtu: bool, request: int, response: bytes) -> Iterator[str]:
    """Yield an endpoint with a process that responds, over TCP on two connections."""
    with contextlib.ExitStack() as stack:
        if rtu:
            path, _ = stack.enter_context(responder_on_pty(request, response))
        else:
            listener = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
            path = f"tcp://127.0.0.1:{listener.getsockname()[1]}"
            _serve(stack, listener, request, response)
        yield path


def _serve(
    stack: contextlib.ExitStack, listener: socket.socket, request: int, response: bytes
) -> None:
    """Start one responding process per connection."""
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
    words = [sys.executable, "-S", "-c", code, str(listener.fileno()), str(request), response.hex()]
    child = subprocess.Popen(
        [*words, "numbered"], pass_fds=(listener.fileno(),), stderr=subprocess.DEVNULL
    )
    stack.callback(child.wait)
    stack.callback(child.kill)


@contextlib.contextmanager
def _bare_end(path: str, rtu: bool) -> Iterator[int]:
    """Yield a file descriptor to the responder."""
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


def _own_cycle(path: str, rtu: bool) -> tuple[Work, Work]:
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


def _sync_cycle(path: str, rtu: bool) -> tuple[Work, Work]:
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
        response = client.readwrite_registers(
            read_address=2, read_count=4, write_address=18, values=[50], device_id=UNIT
        )
        client.convert_from_registers(response.registers[2:4], client.DATATYPE.INT32)

    return cycle, client.close
