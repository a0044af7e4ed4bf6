"""Captures of our simulators by hosts of other people: `python -m tests.reports.foreign_hosts`.

The CAN host is canopen's `RemoteNode` on python-can, logged by python-can's `Logger`; the Modbus
one is pymodbus' client, its bytes by its own trace. Neither knows of our drivers: they have their
own order, their own settings and their own PDO mapping.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

import can
import canopen
from pymodbus.client import ModbusTcpClient

from tautwave.multicast import only_its_group
from tests.session.newcomers import served

HERE = Path(__file__).parent / "foreign"
PLACE = "239.74.163.91"
READ = ((0x1018, 1), (0x1018, 2), (0x6502, 0), (0x6041, 0), (0x6064, 0), (0x6076, 0), (0x1A00, 0))
MAPPED = ((0x6064, 32), (0x6041, 16))
"""The other way round than ours, and without the mode."""
CONTROL = 0x10
WRITTEN = (
    (0x22, 1000), (0x20, 100), (0x20, 0), (0x11, 2), (0x12, 0), (0x21, 0), (CONTROL, 0),
    (0x20, 100),
)  # fmt: skip
"""Of the generic profile: torque limit, time-out, mode, torque, fault reset, control."""


def header(tools: Sequence[str]) -> str:
    made = ", ".join(f"{name} {version(name)}" for name in tools)
    day = datetime.now(UTC).date()
    return f"# made by python -m tests.reports.foreign_hosts with {made}, {day}, of our simulator\n"


def canopen_host(path: Path, work: Path) -> None:
    """Read a drive, map its PDOs, bring it to OPERATION ENABLED and back, and log all of it."""
    place = ("--interface", "udp_multicast", "--channel", PLACE)
    with served(work, "canopen", *place):
        bus = can.Bus(interface="udp_multicast", channel=PLACE, receive_own_messages=False)
        tap = can.Bus(interface="udp_multicast", channel=PLACE)
        only_its_group(bus)
        only_its_group(tap)
        logger = can.CanutilsLogWriter(work / "host.log")
        notifier = can.Notifier(tap, [logger])
        network = canopen.Network(bus)
        network.notifier = can.Notifier(bus, network.listeners, 0.1)
        node = network.add_node(1, canopen.ObjectDictionary())
        network.nmt.send_command(0x80)
        time.sleep(0.3)
        for index, sub in READ:
            with suppress(canopen.SdoAbortedError):
                node.sdo.upload(index, sub)
        mapping = [(index << 16 | bits).to_bytes(4, "little") for index, bits in MAPPED]
        for index, sub, data in (
            (0x1800, 1, (0x80000181).to_bytes(4, "little")), (0x1A00, 0, b"\0"),
            (0x1A00, 1, mapping[0]), (0x1A00, 2, mapping[1]), (0x1A00, 0, b"\2"),
            (0x1800, 2, b"\1"), (0x1800, 1, (0x181).to_bytes(4, "little")), (0x6060, 0, b"\x0a"),
        ):  # fmt: skip
            with suppress(canopen.SdoAbortedError):
                node.sdo.download(index, sub, data)
        network.nmt.send_command(0x01)
        for word in (0x06, 0x07, 0x0F):
            node.sdo.download(0x6040, 0, word.to_bytes(2, "little"))
            time.sleep(0.05)
        for _ in range(20):
            network.sync.transmit()
            time.sleep(0.01)
        node.sdo.download(0x6040, 0, b"\0\0")
        time.sleep(0.1)
        network.disconnect()
        notifier.stop()
        logger.stop()
        tap.shutdown()
    path.write_text(header(("canopen", "python-can")) + (work / "host.log").read_text())


def modbus_host(path: Path, work: Path, *, thorough: bool) -> None:
    """Poll a drive; `thorough`: set it up, enable and command it, too, in an order of its own."""
    lines: list[str] = []
    began = time.monotonic()

    def traced(sending: bool, data: bytes) -> bytes:
        mark = ">" if sending else "<"
        lines.append(f"{time.monotonic() - began:.6f} line {mark} {data.hex().upper()}")
        return data

    with served(work, "modbus", "--profile", "generic", "--tcp", "127.0.0.1:0", "--units", "1") as (
        _, announced,
    ):  # fmt: skip
        host, _, port = announced["endpoint"].removeprefix("tcp://").rpartition(":")
        client = ModbusTcpClient(host, port=int(port), trace_packet=traced)
        client.connect()
        for _ in range(20):
            client.read_holding_registers(0, count=9, device_id=1)
        if thorough:
            for start, count in ((0x10, 7), (0x20, 4), (0x29, 4), (2, 1)):
                client.read_holding_registers(start, count=count, device_id=1)
            for address, value in WRITTEN:
                client.write_registers(address, [value], device_id=1)
                client.read_holding_registers(address, count=1, device_id=1)
            client.write_registers(CONTROL, [1], device_id=1)
            for _ in range(3):
                client.read_holding_registers(2, count=1, device_id=1)
                time.sleep(0.05)
            for _ in range(60):
                client.readwrite_registers(
                    read_address=2, read_count=4, write_address=0x12, values=[0], device_id=1
                )
                time.sleep(0.005)
            client.write_registers(CONTROL, [0], device_id=1)
        client.close()
    path.write_text(header(("pymodbus",)) + "".join(f"{line}\n" for line in lines))


MAKERS: dict[str, Callable[[Path, Path], None]] = {
    "canopen-remote-node.log": canopen_host,
    "modbus-pymodbus-polls.log": lambda path, work: modbus_host(path, work, thorough=False),
    "modbus-pymodbus-drives.log": lambda path, work: modbus_host(path, work, thorough=True),
}

if __name__ == "__main__":
    import tempfile

    for name, maker in MAKERS.items():
        with tempfile.TemporaryDirectory() as folder:
            target = Path(sys.argv[1]) if len(sys.argv) > 1 else HERE
            maker(target / name, Path(folder))
            print(target / name)
