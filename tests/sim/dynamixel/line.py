"""Simulated servos on the fake clock, and a host that speaks to them byte by byte."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from tautwave.clock import FakeClock
from tautwave.contracts import AxisSpec, BusSpec
from tautwave_sim.dynamixel import packets as p2
from tautwave_sim.dynamixel.options import DynamixelOptions
from tautwave_sim.dynamixel.world import ServoWorld
from tautwave_sim.wire import packets1 as p1
from tests.sim.truths import truth

STEP = math.tau / 4096
MS = 1_000_000
PATIENCE_NS = 4 * MS


class Host:
    """A line with servos, and what a host does on it."""

    def __init__(
        self,
        ids: Sequence[int] = (1,),
        model: str = "XM430-W350",
        *,
        counts: Sequence[int] = (),
        free: bool = True,
        causality: str = "impedance",
        truths: dict[str, Any] | None = None,
        **options: Any,
    ) -> None:
        self.clock = FakeClock()
        simulator = {"factory": True, **options.pop("simulator", {})}
        servos = options.pop("servos", [{"id": one, "model": model} for one in ids])
        given = DynamixelOptions.model_validate(
            {"port": "sim", "servos": servos, "simulator": simulator, **options}
        )
        axes = tuple(AxisSpec(f"servo.{one}", one, "rotary", causality, 10.0) for one in ids)
        starts = [(at - 2048) * STEP for at in counts] or [0.0] * len(ids)
        made = [
            truth(
                **{"mass": 0.01, "seed": (one,), **(truths or {})},
                servo=causality == "admittance",
            )._replace(start_position=start)
            for one, start in zip(ids, starts, strict=True)
        ]
        self.world = ServoWorld(given, BusSpec("test", axes, 1000.0), made, self.clock, free)
        self.port = self.world.transport
        self.servos = self.world.servos
        self.axes = self.world.axes

    def send(self, data: bytes) -> None:
        """Write bytes without waiting."""
        self.port.write(data)

    def hear(self, wait_ns: int = PATIENCE_NS) -> bytes:
        """Return all that comes within a time."""
        end = self.clock.now_ns() + wait_ns
        heard = b""
        while self.clock.wait(self.port, end):
            heard += self.port.read()
        return heard

    def talk(self, data: bytes, wait_ns: int = PATIENCE_NS) -> bytes:
        """Send bytes and return the answer."""
        self.send(data)
        return self.hear(wait_ns)

    def ask(self, device_id: int, instruction: int, *params: int) -> bytes:
        """Send an instruction in protocol 2.0; return the answer's bytes."""
        return self.talk(p2.frame(device_id, bytes((instruction, *params))))

    def error(self, device_id: int, instruction: int, *params: int) -> int:
        """Send an instruction; return the error field of the answer."""
        response = self.ask(device_id, instruction, *params)
        assert len(response) >= 11, response.hex()
        return response[8]

    def ask1(self, device_id: int, instruction: int, *params: int) -> bytes:
        """Send an instruction in protocol 1.0; return the answer's bytes."""
        return self.talk(p1.frame(device_id, bytes((instruction, *params))))

    def write(self, device_id: int, name: str, value: int) -> int:
        """Write a register by its name; return the error field."""
        item = self.servos[0].memory.items[name]
        return self.error(device_id, p2.WRITE, *words(item.address), *item.encode(value))

    def read(self, device_id: int, name: str) -> int:
        """Read a register by its name."""
        item = self.servos[0].memory.items[name]
        response = self.ask(device_id, p2.READ, *words(item.address), *words(item.size))
        assert response[8] & 0x7F == 0, response.hex()
        return item.decode(p2.unstuff(response[7:-2])[2:])

    def sync_write(self, name: str, values: dict[int, int]) -> None:
        """Send a sync write of one register, and stay."""
        item = self.servos[0].memory.items[name]
        body = bytes((p2.SYNC_WRITE, *words(item.address), *words(item.size)))
        for one, value in values.items():
            body += bytes((one,)) + item.encode(value)
        self.send(p2.frame(p2.BROADCAST, body))

    def sync_read(
        self, ids: Sequence[int], address: int = 132, size: int = 4, code: int = p2.SYNC_READ
    ) -> bytes:
        """Return what comes on a sync read."""
        return self.ask(p2.BROADCAST, code, *words(address), *words(size), *ids)

    def pass_time(self, seconds: float) -> None:
        """Let time pass in silence."""
        self.clock.sleep_until(self.clock.now_ns() + round(seconds * 1e9))
        self.port.advance(self.clock.now_ns())
        self.world.bus.pass_slots(self.clock.now_ns())  # servos are lazy until they are asked


def words(value: int) -> tuple[int, int]:
    """Return a number as two bytes, little endian."""
    return value & 0xFF, value >> 8


def hexa(text: str) -> bytes:
    """Return the bytes of a row as the e-manual prints it: 0xFF | 0xFF | ..."""
    return bytes(int(word, 16) for word in text.replace("|", " ").split())


def split(response: bytes) -> list[bytes]:
    """Return the status packets in an answer without mistakes."""
    found = []
    while response:
        end = 7 + int.from_bytes(response[5:7], "little")
        found.append(response[:end])
        response = response[end:]
    return found
