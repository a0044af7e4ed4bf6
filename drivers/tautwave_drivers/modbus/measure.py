"""The host's cost of one exchange with a drive over TCP and RTU; pymodbus's client beside it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

from tautwave.clock import MonotonicClock
from tautwave.contracts import CycleCost
from tautwave.types import AxisCommand
from tautwave_drivers.cost import CHUNK, Exchange, Made, bench_bus, driver_cycle, measured, timed
from tautwave_drivers.modbus.driver import ModbusDriver
from tautwave_drivers.modbus.options import ModbusOptions
from tautwave_drivers.modbus.protocol.frames import rtu_frame, tcp_frame

TCP_RATIO, RTU_RATIO = 2.0, 1.5
UNIT = 1

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
    for rtu, ratio in ((False, TCP_RATIO), (True, RTU_RATIO)):
        where = "RTU over a pty" if rtu else "TCP"
        what = f"1 drive, FC 23 over {where}, ours"
        spent, floor = measured(_bytes(rtu), partial(_own_cycle, rtu), cycles)
        costs.append(CycleCost(what, spent, floor, goal_ratio=ratio))
        theirs = what.replace("ours", "pymodbus (synchronous client)")
        # It sleeps twice for a millisecond: a tenth of the exchanges is enough.
        fewer = max(CHUNK, cycles // 10 if rtu else cycles)
        costs.append(CycleCost(theirs, *measured(_bytes(rtu), partial(_sync_cycle, rtu), fewer)))
    return costs


def _driver(path: str, rtu: bool) -> ModbusDriver:
    options = ModbusOptions.model_validate(
        {
            "link": "rtu" if rtu else "tcp",
            "endpoint": path,
            "baud": 4_000_000,
            "gap_s": 1e-9,
            "devices": [{"unit": UNIT, "rated_torque": 1.0}],
        }
    )
    return ModbusDriver(options, bench_bus([UNIT]), MonotonicClock(), None)


def _bytes(rtu: bool) -> Exchange:
    """Return the bytes of a cycle, the response without its transaction identifier."""
    driver = _driver("tcp://127.0.0.1:1", False)
    request = bytes(driver.make_stations()[0].plan.requests[0].pdu)
    if rtu:
        return Exchange(rtu_frame(UNIT, request), rtu_frame(UNIT, RESPONSE))
    return Exchange(tcp_frame(1, UNIT, request), tcp_frame(0, UNIT, RESPONSE)[2:], tcp=True)


def _own_cycle(rtu: bool, path: str) -> Made:
    driver = _driver(path, rtu)
    driver.attach()
    return driver_cycle(driver, MonotonicClock(), [AxisCommand(0.05, 0.0)]), driver.detach


def _sync_cycle(rtu: bool, path: str) -> Made:
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

    return timed(cycle), client.close
