"""The driver brings up drives made of canopen's own `LocalNode`, over python-can's virtual bus.

SDO server, NMT, heartbeat and the reading of PDO mappings are the library's; the state machine is
twenty lines here. Nothing of the simulator takes part. Real clock: the library has threads.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any

import canopen
import pytest
from canopen.objectdictionary import ODRecord, ODVariable, datatypes

from tautwave.clock import FakeClock, MonotonicClock
from tautwave.contracts import BusSpec
from tautwave.types import AxisCommand
from tautwave_drivers.can.python_can import PolledPort, port_kind
from tautwave_drivers.canopen import plugin
from tautwave_drivers.canopen.scan import ScanOptions, look
from tests.drivers.canopen.benches import block, bus_of, driver_options, node

can = pytest.importorskip("can")

RATE_HZ = 100.0
CHANNEL = "local-nodes"
U8, U16, U32 = datatypes.UNSIGNED8, datatypes.UNSIGNED16, datatypes.UNSIGNED32
I8, I16, I32 = datatypes.INTEGER8, datatypes.INTEGER16, datatypes.INTEGER32

OBJECTS: list[tuple[int, list[tuple[int, int, int]]]] = [
    (0x1000, [(0, U32, 0x00020192)]),
    (0x1001, [(0, U8, 0)]),
    (0x1005, [(0, U32, 0x80)]),
    (0x1014, [(0, U32, 0x80)]),
    (0x1016, [(0, U8, 1), (1, U32, 0)]),
    (0x1017, [(0, U16, 0)]),
    (0x1018, [(0, U8, 4), (1, U32, 0xABCD), (2, U32, 0x402), (3, U32, 1), (4, U32, 99)]),
    (0x6007, [(0, I16, 0)]),
    (0x603F, [(0, U16, 0)]),
    (0x6040, [(0, U16, 0)]),
    (0x6041, [(0, U16, 0x0240)]),
    (0x605A, [(0, I16, 2)]),
    (0x6060, [(0, I8, 0)]),
    (0x6061, [(0, I8, 0)]),
    (0x6064, [(0, I32, 1000)]),
    (0x6071, [(0, I16, 0)]),
    (0x6072, [(0, U16, 3000)]),
    (0x6076, [(0, U32, 500)]),
    (0x6077, [(0, I16, 0)]),
    (0x60C2, [(0, U8, 2), (1, U8, 1), (2, I8, -3)]),
    (0x6502, [(0, U32, 1 << 9)]),
]
PDOS = ((0x1400, 0x200), (0x1800, 0x180))
NEXT = {0x06: 0x0231, 0x07: 0x0233, 0x0F: 0x1237}


def dictionary(number: int) -> canopen.ObjectDictionary:
    od = canopen.ObjectDictionary()  # type: ignore[no-untyped-call]
    records = [*OBJECTS]
    for base, cob_id in PDOS:
        communication = [(0, U8, 5), (1, U32, cob_id + number), (2, U8, 255), (3, U16, 0)]
        records += [(base, [*communication, (5, U16, 0)])]
        records += [(base + 0x200, [(0, U8, 0), *((sub, U32, 0) for sub in range(1, 9))])]
    for index, subs in records:
        if len(subs) == 1:
            od.add_object(_variable(f"{index:04X}", index, *subs[0]))
            continue
        record = ODRecord(f"{index:04X}", index)
        for entry in subs:
            record.add_member(_variable(f"{index:04X} {entry[0]}", index, *entry))
        od.add_object(record)
    return od


def _variable(name: str, index: int, sub: int, kind: int, default: int) -> ODVariable:
    variable = ODVariable(name, index, sub)
    variable.data_type = kind
    variable.access_type = "rw"
    variable.default = default
    variable.pdo_mappable = True
    return variable


class Drive:
    """A drive that does what the controlword says; its position grows by its torque."""

    def __init__(self, network: Any, number: int) -> None:
        self.node = canopen.LocalNode(number, dictionary(number))
        network[number] = self.node
        network.subscribe(0x80, self.on_sync)
        self.mapped = False
        self.position = 1000
        self.node.nmt.send_command(0)  # type: ignore[no-untyped-call]  # initialising: boot-up

    def number(self, index: int) -> int:
        return int(self.node.sdo[index].raw)

    def on_sync(self, can_id: int, data: bytearray, timestamp: float) -> None:
        node = self.node
        if node.nmt.state != "OPERATIONAL":
            self.mapped = False
            return
        if not self.mapped:
            node.tpdo.read()
            node.rpdo.read()
            self.mapped = True
        for pdo in node.rpdo.values():
            if pdo.enabled and pdo.timestamp is not None:
                for variable in pdo:
                    node.sdo[variable.index].raw = variable.raw
        self.take(self.number(0x6040))
        enabled = self.number(0x6041) & 0x6F == 0x27
        self.position += self.number(0x6071) if enabled else 0
        node.sdo[0x6061].raw = self.number(0x6060)
        node.sdo[0x6064].raw = self.position
        for pdo in node.tpdo.values():
            if pdo.enabled and pdo.trans_type == 1:
                for variable in pdo:
                    variable.raw = self.number(variable.index)
                pdo.transmit()

    def take(self, word: int) -> None:
        reported = NEXT.get(word & 0x8F, 0x0240)
        ladder = [0x0240, 0x0231, 0x0233, 0x1237]
        here = ladder.index(self.number(0x6041))
        self.node.sdo[0x6041].raw = reported if ladder.index(reported) <= here + 1 else ladder[here]


@pytest.fixture
def drives() -> Iterator[list[Drive]]:
    with ExitStack() as stack:
        network = canopen.Network()
        network.connect(interface="virtual", channel=CHANNEL)
        stack.callback(network.disconnect)
        found = [Drive(network, number) for number in (1, 2)]
        for drive in found:
            stack.callback(drive.node.nmt.stop_heartbeat)
        yield found


@pytest.mark.sparse(2)
@pytest.mark.parametrize("mapping", ["lean", "full"])
def test_it_brings_up_local_nodes_and_commands_them(drives: list[Drive], mapping: str) -> None:
    identity = {"vendor": 0xABCD, "product": 0x402}
    both = [node(number, mapping=mapping, identity=identity) for number in (1, 2)]
    options = block(*both, heartbeat_ms=50, heartbeat_timeout_ms=2000) | {"channel": CHANNEL}
    bus = bus_of(options, ("impedance", "impedance"), RATE_HZ)
    clock = MonotonicClock()
    driver = plugin.make(driver_options(options), bus, clock, None)
    try:
        driver.open()
        notes = "\n".join(driver.notes)  # type: ignore[attr-defined]
        assert "vendor 0xABCD, product 0x402" in notes
        sdo = drives[0].node.sdo
        assert (sdo[0x60C2][1].raw, sdo[0x60C2][2].raw) == (10, -3)
        assert sdo[0x1016][1].raw == 127 << 16 | 2000
        assert sdo[0x6007].raw == 2
        _enable(driver, clock, bus)
        states = _run(driver, clock, bus, 0.05, 30)
        assert sum(all(state.valid for state in row) for row in states) > 15
        assert all(drive.position > 1000 for drive in drives)
        first, last = states[0][0].position, states[-1][0].position
        assert last > first
    finally:
        driver.close()
    for drive in drives:
        assert drive.number(0x6041) == 0x0240  # switch on disabled
        assert drive.number(0x6071) == 0
        assert drive.node.nmt.state == "PRE-OPERATIONAL"


def _enable(driver: Any, clock: MonotonicClock, bus: BusSpec) -> None:
    for _ in range(300):
        if driver.enable_step():
            return
        clock.sleep_until(clock.now_ns() + bus.period_ns)
    raise AssertionError("never enabled")


def _run(
    driver: Any, clock: MonotonicClock, bus: BusSpec, effort: float, cycles: int
) -> list[list[Any]]:
    rows = []
    for _ in range(cycles):
        begin = clock.now_ns()
        driver.request()
        rows.append(list(driver.read(begin + bus.period_ns * 7 // 10)))
        driver.write([AxisCommand(effort, 0.0)] * len(bus.axes))
        clock.sleep_until(begin + bus.period_ns)
    return rows


@pytest.mark.slow
def test_scan_lists_local_nodes(drives: list[Drive]) -> None:
    drives[1].node.sdo[0x603F].raw = 0x2310
    clock = MonotonicClock()
    bus = can.Bus(interface="virtual", channel=CHANNEL)
    port = port_kind(bus)(bus, clock, "virtual")
    assert isinstance(port, PolledPort)
    try:
        rows = look(port, clock, ScanOptions(interface="virtual", channel=CHANNEL, listen_s=0.3))
    finally:
        port.close()
    assert [row["node"] for row in rows] == [1, 2]
    assert rows[0]["vendor"] == "0xABCD"
    assert rows[0]["serial"] == "0x63"
    assert rows[0]["state"] == "SWITCH ON DISABLED"
    assert rows[0]["mode"] == "no mode"
    assert rows[0]["errors"] == "none"
    assert "0x2310: continuous overcurrent on the motor side" in rows[1]["errors"]


def test_a_bus_without_a_descriptor_is_looked_at_every_200_us_and_keeps_what_it_saw() -> None:
    clock = FakeClock()
    bus, other = (can.Bus(interface="virtual", channel="polled") for _ in range(2))
    port = port_kind(bus)(bus, clock, "virtual")
    try:
        assert port.next_event_ns() == clock.now_ns() + 200_000
        assert not port.readable()
        for number in (1, 2):
            other.send(can.Message(arbitration_id=number, data=b"x", is_extended_id=False))
        assert port.readable()
        assert port.readable()
        assert [port.receive() for _ in range(3)] == [(1, b"x", 0), (2, b"x", 0), None]
    finally:
        port.close()
        other.shutdown()
