"""Protocol 1.0 byte for byte: e-manual, "DYNAMIXEL Protocol 1.0" (docs/en/dxl/protocol1)."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.clock import FakeClock
from tautwave_drivers import protocol1
from tautwave_drivers.dynamixel.protocol.messages import protocol1_text
from tautwave_drivers.dynamixel.scan import ScanOptions, find_at_baud

INSTRUCTIONS = {
    "write": (protocol1.build(1, 3, bytes((12, 100, 170))), "FFFF 01 05 03 0C64AA DC"),
    "ping": (protocol1.build(1, protocol1.PING), "FFFF 01 02 01 FB"),
    "read": (protocol1.read_packet(1, 43, 1), "FFFF 01 04 02 2B01 CC"),
    "write id": (protocol1.write_packet(0xFE, 3, b"\x01"), "FFFF FE 04 03 0301 F6"),
    "reg write": (protocol1.build(1, 4, b"\x1e\xf4\x01"), "FFFF 01 05 04 1EF401 E2"),
    "action": (protocol1.build(0xFE, 5), "FFFF FE 02 05 FA"),
    "factory reset": (protocol1.build(0, 6), "FFFF 00 02 06 F7"),
    "sync write": (
        protocol1.sync_write_packet(
            0x1E, 4, [(0, bytes.fromhex("10005001")), (1, bytes.fromhex("20026003"))]
        ),
        "FFFF FE 0E 83 1E04 00 10005001 01 20026003 67",
    ),
    "bulk read": (
        protocol1.build(0xFE, 0x92, bytes.fromhex("00 02011E 020224")),
        "FFFF FE 09 92 00 02011E 020224 1D",
    ),
}
STATUS = {
    "ping": ("FFFF 01 02 00 FC", 1, 0, ""),
    "read": ("FFFF 01 03 00 20 DB", 1, 0, "20"),
    "error": ("FFFF 01 02 24 D8", 1, 0x24, ""),
    "bulk read 1": ("FFFF 01 04 00 0080 7A", 1, 0, "0080"),
    "bulk read 2": ("FFFF 02 04 00 0080 79", 2, 0, "0080"),
}


@pytest.mark.parametrize("name", INSTRUCTIONS)
def test_instructions_are_those_of_the_e_manual(name: str) -> None:
    built, printed = INSTRUCTIONS[name]
    assert built == bytes.fromhex(printed)


@pytest.mark.parametrize("name", STATUS)
def test_status_packets_of_the_e_manual_are_read(name: str) -> None:
    printed, device_id, error, data = STATUS[name]
    found = protocol1.take_packet(bytearray(bytes.fromhex(printed)))
    assert found is not None
    assert (found.device_id, found.error, found.data) == (device_id, error, bytes.fromhex(data))


def test_the_errors_of_the_manuals_example_are_reported() -> None:
    assert protocol1_text(0x24) == "overheated and overloaded for too long"


@given(st.binary(max_size=60), st.binary(min_size=1, max_size=12))
def test_bytes_never_raise_and_a_packet_comes_through(noise: bytes, params: bytes) -> None:
    built = protocol1.build(7, 0, params)
    buffer = bytearray(noise + bytes(300) + built)
    found = []
    while (one := protocol1.take_packet(buffer)) is not None:
        found.append((one.device_id, one.error, one.data))
    assert (7, 0, params) in found


class Echo:
    """A half-duplex adapter without servos, which hears itself."""

    def __init__(self) -> None:
        self.heard = b""

    def write(self, data: bytes) -> None:
        self.heard += data

    def read(self) -> bytes:
        heard, self.heard = self.heard, b""
        return heard

    def readable(self) -> bool:
        return bool(self.heard)

    def next_event_ns(self) -> int | None:
        return None

    def advance(self, to_ns: int) -> None:
        pass

    def close(self) -> None:
        pass


@pytest.mark.parametrize("protocol", [1.0, 2.0])
def test_an_adapter_that_echoes_is_no_servo(protocol: float) -> None:
    options = ScanOptions(port="echo", protocol=protocol, ids=[1, 2])
    assert list(find_at_baud(Echo(), FakeClock(), 1_000_000, options, 0.0)) == []
