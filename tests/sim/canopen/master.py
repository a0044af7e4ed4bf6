"""A small master for tests of simulated drives: frames by hand, on the fake clock."""

from __future__ import annotations

from typing import Any

from tautwave.clock import FakeClock
from tautwave.contracts import AxisSpec, BusSpec
from tautwave_sim.canopen import simulator
from tautwave_sim.canopen.options import SimulatedCanopenOptions
from tests.sim.truths import truth

PERIOD_NS = 1_000_000
RATED, COUNTS = 2.0, 4096

# RPDO1: controlword, target torque; TPDO1: statusword, position, torque; both at each SYNC
TORQUE_MAP = ((0x60400010, 0x60710010), (0x60410010, 0x60640020, 0x60770010))
SPEED_MAP = ((0x60400010, 0x60FF0020), (0x60410010, 0x60640020, 0x60770010))


class Master:
    """Sends frames to simulated drives and remembers all they answer."""

    def __init__(
        self,
        ids: tuple[int, ...] = (1,),
        *,
        servo: bool = False,
        faults: Any = None,
        quirks: Any = None,
        **truths: Any,
    ) -> None:
        self.clock = FakeClock()
        options = SimulatedCanopenOptions.model_validate(
            {
                "interface": "virtual",
                "nodes": tuple(
                    {"id": node, "rated_torque": RATED, "counts_per_revolution": COUNTS}
                    for node in ids
                ),
                "simulator": {
                    "faults": faults or {},
                    "nodes": {node: quirks or {} for node in ids[:1]},
                },
            }
        )
        causality = "admittance" if servo else "impedance"
        axes = tuple(AxisSpec(f"slave.a{node}", node, "rotary", causality, 10.0) for node in ids)
        physics = [truth(servo=servo, **truths) for _ in ids]
        self.bus = BusSpec("arm", axes, 1000.0)
        self.simulator = simulator.make(options, self.bus, physics, self.clock)
        self.port = self.simulator.transport
        self.world = self.simulator.world
        self.ids = ids
        self.log: list[tuple[int, int, bytes]] = []
        self.world.medium.listeners.append(lambda *frame: self.log.append(frame))
        self.heard: list[tuple[int, bytes, int]] = []

    def wait(self, duration_ns: int = PERIOD_NS) -> list[tuple[int, bytes, int]]:
        """Let time pass; return what has come meanwhile."""
        end = self.clock.now_ns() + duration_ns
        got = []
        while True:
            ready = self.clock.wait(self.port, end)
            while (frame := self.port.receive()) is not None:
                got.append(frame)
            if not ready:
                break
        self.heard += got
        return got

    def send(self, text: str) -> bool:
        """Send a frame written as `id#data`, in hex."""
        can_id, _, data = text.partition("#")
        return self.port.send(int(can_id, 16), bytes.fromhex(data))

    def ask(self, text: str) -> list[str]:
        """Send a frame; return what comes within 2 ms, written alike."""
        self.send(text)
        return [f"{can_id:03X}#{data.hex().upper()}" for can_id, data, _ in self.wait(2_000_000)]

    def read(self, node: int, index: int, sub: int = 0, *, signed: bool = False) -> int:
        request = bytes([0x40]) + index.to_bytes(2, "little") + bytes([sub]) + bytes(4)
        self.port.send(0x600 + node, request)
        response = self._respond(node)
        if response[0] == 0x80:
            raise SdoRefusal(int.from_bytes(response[4:], "little"))
        size = 4 - (response[0] >> 2 & 3)
        return int.from_bytes(response[4 : 4 + size], "little", signed=signed)

    def write(self, node: int, index: int, sub: int, value: int, size: int) -> None:
        head = bytes([0x23 | (4 - size) << 2]) + index.to_bytes(2, "little") + bytes([sub])
        data = (value & (1 << 8 * size) - 1).to_bytes(size, "little").ljust(4, b"\0")
        self.port.send(0x600 + node, head + data)
        response = self._respond(node)
        if response[0] == 0x80:
            raise SdoRefusal(int.from_bytes(response[4:], "little"))

    def _respond(self, node: int) -> bytes:
        for _ in range(20):
            for can_id, data, _ in self.wait(200_000):
                if can_id == 0x580 + node:
                    return data
        raise AssertionError(f"node {node} does not answer")

    def map(self, node: int, maps: Any = TORQUE_MAP, kind: int = 1) -> None:
        """Map RPDO1 and TPDO1 in the order of CiA 301."""
        for base, cob_id, parts in ((0x1400, 0x200, maps[0]), (0x1800, 0x180, maps[1])):
            self.write(node, base, 1, 0x80000000 | cob_id + node, 4)
            self.write(node, base, 2, kind, 1)
            self.write(node, base + 0x200, 0, 0, 1)
            for sub, part in enumerate(parts, start=1):
                self.write(node, base + 0x200, sub, part, 4)
            self.write(node, base + 0x200, 0, len(parts), 1)
            self.write(node, base, 1, cob_id + node, 4)

    def sync(self, words: dict[int, bytes] | None = None) -> dict[int, bytes]:
        """One cycle: RPDOs, SYNC, and the TPDOs that come within the period."""
        start = self.clock.now_ns()
        for node, data in (words or {}).items():
            self.port.send(0x200 + node, data)
        self.wait(400_000)
        self.port.send(0x80, b"")
        got = self.wait(start + PERIOD_NS - self.clock.now_ns())
        return {can_id - 0x180: data for can_id, data, _ in got if 0x180 < can_id < 0x200}

    def bring_up(self, mode: int = 10, maps: Any = TORQUE_MAP, kind: int = 1) -> None:
        """Configure all nodes and enable them."""
        self.wait()
        for node in self.ids:
            self.map(node, maps, kind)
            self.write(node, 0x6060, 0, mode, 1)
        self.send("000#0100")
        size = sum((part & 0xFF) // 8 for part in maps[0][1:])
        for word in (0x06, 0x07, 0x0F, 0x0F):
            self.cycle(word, bytes(size))

    def cycle(self, word: int, rest: bytes) -> dict[int, bytes]:
        return self.sync({node: word.to_bytes(2, "little") + rest for node in self.ids})

    def torque(self, counts: int, word: int = 0x0F) -> dict[int, bytes]:
        return self.cycle(word, counts.to_bytes(2, "little", signed=True))

    def state(self, node: int = 1) -> str:
        return self.device(node).drive.machine.state.name

    def device(self, node: int = 1) -> Any:
        return self.world.devices[self.ids.index(node)]

    def emergencies(self, node: int = 1) -> list[int]:
        return [
            int.from_bytes(data[:2], "little")
            for _, can_id, data in self.log
            if can_id == 0x80 + node
        ]


class SdoRefusal(Exception):
    def __init__(self, code: int) -> None:
        super().__init__(f"{code:08X}")
        self.code = code
