"""Masters for simulated drives: whole requests over a port in memory, on the fake clock."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any

from tautwave.clock import FakeClock
from tautwave.contracts import AxisSpec, BusSpec
from tautwave.truth import AxisModel
from tautwave_sim.modbus import simulator
from tautwave_sim.modbus.wire.framing import open_rtu, rtu_frame, tcp_frame
from tautwave_sim.modbus.world import ModbusSimulator
from tests.sim.truths import PERIOD, truth

ENDPOINT = "tcp://drive:502"
PERIOD_NS = round(PERIOD * 1e9)


def read(address: int, count: int = 1, function: int = 3) -> bytes:
    return struct.pack(">BHH", function, address, count)


def write_one(address: int, word: int) -> bytes:
    return struct.pack(">BHH", 6, address, word & 0xFFFF)


def write_many(address: int, *words: int) -> bytes:
    count = len(words)
    return struct.pack(
        f">BHHB{count}H", 16, address, count, 2 * count, *(w & 0xFFFF for w in words)
    )


def read_write(read_address: int, read_count: int, address: int, *words: int) -> bytes:
    count = len(words)
    head = (23, read_address, read_count, address, count, 2 * count)
    return struct.pack(f">BHHHHB{count}H", *head, *(w & 0xFFFF for w in words))


def pair(value: int) -> tuple[int, int]:
    """Return the words of a 32-bit value, high one first."""
    return value >> 16 & 0xFFFF, value & 0xFFFF


def words(response: bytes | None) -> list[int]:
    assert response is not None
    assert response[1] == len(response) - 2, response.hex(" ")
    return list(struct.unpack(f">{response[1] // 2}H", response[2:]))


def signed(high: int, low: int) -> int:
    return int.from_bytes(struct.pack(">HH", high, low), "big", signed=True)


class Bench:
    """Simulated drives and a master, with nothing but whole requests between them."""

    def __init__(
        self,
        link: str = "tcp",
        profile: str = "generic",
        units: Sequence[int] = (1,),
        *,
        causality: str = "impedance",
        truths: Sequence[AxisModel] | None = None,
        faults: dict[str, Any] | None = None,
        quirks: dict[str, Any] | None = None,
        device: dict[str, Any] | None = None,
        **options: Any,
    ) -> None:
        block = {
            "link": link,
            "endpoint": ENDPOINT,
            "devices": [{"unit": unit, "profile": profile, **(device or {})} for unit in units],
            "simulator": {
                "faults": faults or {},
                "devices": dict.fromkeys(units, quirks) if quirks else {},
            },
            **options,
        }
        self.options = simulator.options.model_validate(block)
        axes = tuple(AxisSpec(f"slave.{unit}", unit, "rotary", causality, 10.0) for unit in units)
        bus = BusSpec("modbus", axes, 1.0 / PERIOD)
        if truths is None:
            truths = [truth(servo=causality == "admittance") for _ in units]
        self.clock = FakeClock()
        made = simulator.make(self.options, bus, truths, self.clock)
        assert isinstance(made, ModbusSimulator)
        self.simulator = made
        self.link = link
        self.port = made.port("" if link == "rtu" else ENDPOINT)
        self.transaction = 0
        self.silent_ns = 1_750_000
        self.patience_ns = 50_000_000
        self.sent_ns = 0

    def drive(self, unit: int = 1) -> Any:
        return self.simulator.bus.drives[unit]

    def bytes_back(self, frame: bytes) -> bytes:
        """Send bytes; return all that comes until the line has been quiet."""
        self.sent_ns = self.clock.now_ns()
        self.port.write(frame)
        got = b""
        until = self.clock.now_ns() + self.patience_ns
        while self.clock.wait(self.port, until):
            got += self.port.read()
            until = self.clock.now_ns() + self.silent_ns
        return got

    def ask(self, pdu: bytes, unit: int = 1) -> bytes | None:
        """Send a request; return the response's PDU, None if nothing usable came."""
        if self.link == "rtu":
            found = open_rtu(self.bytes_back(rtu_frame(unit, pdu)))
            return None if found is None or found[0] != unit else found[1]
        self.transaction = self.transaction % 0xFFFF + 1
        got = self.bytes_back(tcp_frame(self.transaction, unit, pdu))
        if len(got) < 8:
            return None
        head = self.transaction.to_bytes(2, "big") + b"\0\0" + (len(got) - 6).to_bytes(2, "big")
        return got[7:] if got[:7] == head + bytes([unit]) else None

    def wait(self, seconds: float) -> None:
        self.clock.wait(self.port, self.clock.now_ns() + round(seconds * 1e9))

    def until(self, time_ns: int) -> None:
        """Let time pass up to `time_ns`."""
        self.clock.sleep_until(time_ns)
        self.port.advance(self.clock.now_ns())

    def number(self, name: str, unit: int = 1) -> int:
        """Return the value of a register, read over the line."""
        one = self.drive(unit).bank.registers[name]
        return one.decode(words(self.ask(read(one.address, one.words), unit)))

    def set(self, name: str, value: int, unit: int = 1) -> bytes | None:
        """Write the value of a register over the line."""
        one = self.drive(unit).bank.registers[name]
        return self.ask(write_many(one.address, *one.encode(value)), unit)
