"""A line of Dynamixel X servos, byte by byte, written from the e-manual alone.

Nothing of `sim/` or `drivers/` is used: what both sides of a test have wrong in common would not be
seen. Sources, ROBOTIS e-manual: "DYNAMIXEL Protocol 2.0" and the control table of the XM430-W350.
Time is the caller's: the line is the other end of an in-memory transport.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterator, Mapping
from typing import Any

HEADER = b"\xff\xff\xfd\x00"
BROADCAST, STATUS = 0xFE, 0x55
PING, READ, WRITE, SYNC_READ, SYNC_WRITE = 0x01, 0x02, 0x03, 0x82, 0x83
RANGE, ACCESS = 4, 7
"""Error numbers of a status packet."""

MODE, SHADOW, CURRENT_LIMIT, TORQUE, LED, LEVEL, ERROR, WATCHDOG = 11, 12, 38, 64, 65, 68, 70, 98
GOAL_CURRENT, GOAL_VELOCITY, GOAL_POSITION, PRESENT, INDIRECT, INDIRECT_DATA = (
    102, 104, 116, 126, 168, 224,
)  # fmt: skip
XM430_W350 = 1020
EEPROM = {0: (2, XM430_W350), 6: (1, 45), 8: (1, 3), 9: (1, 0), 10: (1, 0), MODE: (1, 0),
          SHADOW: (1, 255), 13: (1, 2), 20: (4, 0), 36: (2, 885), CURRENT_LIMIT: (2, 1193),
          44: (4, 200), 48: (4, 4095), 52: (4, 0), 60: (1, 0), 63: (1, 0x34)}  # fmt: skip
RAM = {LEVEL: (1, 2), 100: (2, 885), GOAL_CURRENT: (2, 1193), GOAL_VELOCITY: (4, 200),
       144: (2, 120), 146: (1, 30)}  # fmt: skip


def crc16(data: bytes) -> int:
    """CRC-16 of polynomial 8005h, as the protocol's page prints it."""
    crc = 0
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = crc << 1 ^ (0x8005 if crc & 0x8000 else 0)
        crc &= 0xFFFF
    return crc


def packet(device: int, body: bytes) -> bytes:
    """Return a packet: stuffed, with length and checksum."""
    stuffed = body.replace(b"\xff\xff\xfd", b"\xff\xff\xfd\xfd")
    whole = HEADER + bytes((device,)) + struct.pack("<H", len(stuffed) + 2) + stuffed
    return whole + struct.pack("<H", crc16(whole))


def packets(buffer: bytearray) -> Iterator[tuple[int, int, bytes]]:
    """Take complete packets out of a buffer: id, instruction, parameters."""
    while True:
        at = buffer.find(HEADER)
        if at < 0 or len(buffer) < at + 10:
            return
        del buffer[:at]
        size = 7 + int.from_bytes(buffer[5:7], "little")
        if len(buffer) < size:
            return
        whole = bytes(buffer[:size])
        del buffer[:size]
        if crc16(whole[:-2]) == int.from_bytes(whole[-2:], "little"):
            yield whole[4], whole[7], whole[8:-2].replace(b"\xff\xff\xfd\xfd", b"\xff\xff\xfd")


class Servo:
    """One servo: its control table, its motor (a damped inertia) and what happened to it."""

    def __init__(self, device: int, registers: Mapping[int, tuple[int, int]] | None = None) -> None:
        self.device = device
        self.eeprom = {**EEPROM, 7: (1, device), **(registers or {})}
        self.memory = bytearray(1024)
        self.turn = 2048.0  # [counts], what a battery would keep
        self.speed = 0.0  # [counts/s]
        self.now_ns = self.heard_ns = 0
        self.dead_until_ns = -1
        self.deaf = False
        self.limp_goals = 0
        self.unguarded = False
        self.came_on_unwatched = False
        self.start()

    def put(self, address: int, size: int, value: int) -> None:
        self.memory[address : address + size] = (value % (1 << 8 * size)).to_bytes(size, "little")

    def get(self, address: int, size: int, *, signed: bool = False) -> int:
        return int.from_bytes(self.memory[address : address + size], "little", signed=signed)

    def start(self) -> None:
        """Forget all that is in RAM, as after a power cycle."""
        self.memory[:] = bytes(1024)
        for place in range(28):
            self.put(INDIRECT + 2 * place, 2, INDIRECT_DATA + place)
        for address, (size, value) in {**RAM, **self.eeprom}.items():
            self.put(address, size, value)
        self.put(TORQUE, 1, self.get(60, 1) & 1)
        self.speed = 0.0
        self.turn %= 4096.0

    def cut_power(self, now_ns: int, span_ns: int) -> None:
        """Lose the supply; it answers again after `span_ns`."""
        self.start()
        self.dead_until_ns = now_ns + span_ns

    def alive(self, now_ns: int) -> bool:
        return now_ns >= self.dead_until_ns

    @property
    def pushes(self) -> bool:
        """Whether its motor follows a goal other than zero."""
        goal = self.get(GOAL_CURRENT, 2, signed=True)
        driven = self.get(36, 2) and self.get(100, 2)  # PWM limit and goal cap the output
        return bool(self.get(TORQUE, 1) and self.get(MODE, 1) == 0 and goal and driven)

    def advance(self, now_ns: int) -> None:
        span_ns, self.now_ns = now_ns - self.now_ns, now_ns
        watchdog = self.get(WATCHDOG, 1, signed=True)
        on = self.get(TORQUE, 1)
        if on and watchdog > 0 and now_ns - self.heard_ns > watchdog * 20_000_000:
            self.put(WATCHDOG, 1, -1)
            self.put(GOAL_CURRENT, 2, 0)
        self.unguarded |= self.pushes and watchdog == 0
        goal = self.get(GOAL_CURRENT, 2, signed=True) if self.pushes else 0
        span = span_ns * 1e-9
        left = math.exp(-span / 0.2)
        self.speed = self.speed * left + 100.0 * goal * (1.0 - left)
        self.turn += self.speed * span

    def read(self, address: int, size: int) -> bytes:
        self.put(PRESENT, 2, self.get(GOAL_CURRENT, 2) if self.pushes else 0)
        self.put(PRESENT + 2, 4, round(self.speed / 4096.0 * 60.0 / 0.229))
        self.put(PRESENT + 6, 4, round(self.turn))
        shown = bytearray(self.memory)
        for place in range(28):
            at = self.get(INDIRECT + 2 * place, 2)
            shown[INDIRECT_DATA + place] = self.memory[at]
        return bytes(shown[address : address + size])

    def write(self, address: int, data: bytes) -> int:
        """Take a write; return the error number."""
        tripped = self.get(WATCHDOG, 1, signed=True) == -1
        if address < TORQUE and self.get(TORQUE, 1):
            return ACCESS
        if tripped and (address in (GOAL_CURRENT, GOAL_VELOCITY, GOAL_POSITION)):
            return RANGE
        if tripped and address == WATCHDOG and data[0]:
            return RANGE
        if address == GOAL_CURRENT and not self.get(TORQUE, 1) and any(data):
            self.limp_goals += 1
        if address == TORQUE and data[0] and self.get(WATCHDOG, 1) == 0:
            self.came_on_unwatched = True
        self.memory[address : address + len(data)] = data
        if address < TORQUE:
            self.eeprom[address] = (len(data), int.from_bytes(data, "little"))
        return 0


class ServoLine:
    """The servos and the wire: an in-memory transport, with the time on the wire.

    `instructions` counts the packets of the host; `on_instruction`, if given, is called with that
    count before each; `spoil` makes another frame of what a servo answers.
    """

    def __init__(self, clock: Any, *servos: Servo, baud: int = 4_000_000) -> None:
        self.clock = clock
        self.servos = servos
        self.byte_ns = 10_000_000_000 // baud
        self.buffer = bytearray()
        self.coming: list[tuple[int, bytes]] = []
        self.busy_ns = 0
        self.instructions = 0
        self.on_instruction: Callable[[int], None] | None = None
        self.on_advance: Callable[[int], None] | None = None
        self.spoil: Callable[[bytes], bytes] = bytes

    # -- the transport ------------------------------------------------------------------------

    def write(self, data: bytes) -> None:
        now = self.clock.now_ns()
        self.advance(now)
        self.busy_ns = max(self.busy_ns, now) + len(data) * self.byte_ns
        self.buffer += data
        for device, instruction, parameters in packets(self.buffer):
            if self.on_instruction is not None:
                self.on_instruction(self.instructions)
            self.instructions += 1
            self._take(now, device, instruction, parameters)

    def read(self) -> bytes:
        now = self.clock.now_ns()
        self.advance(now)
        here = b"".join(data for at, data in self.coming if at <= now)
        self.coming = [(at, data) for at, data in self.coming if at > now]
        return here

    def close(self) -> None:
        pass

    def next_event_ns(self) -> int | None:
        return self.coming[0][0] if self.coming else None

    def readable(self) -> bool:
        return bool(self.coming) and self.coming[0][0] <= self.clock.now_ns()

    def advance(self, to_ns: int) -> None:
        if self.on_advance is not None:
            self.on_advance(to_ns)
        for servo in self.servos:
            servo.advance(to_ns)

    # -- the servos ---------------------------------------------------------------------------

    def _take(self, now_ns: int, device: int, instruction: int, data: bytes) -> None:
        here = [one for one in self.servos if one.alive(now_ns) and not one.deaf]
        for one in here:
            one.heard_ns = now_ns
        if instruction == SYNC_READ:
            address, size = struct.unpack_from("<HH", data)
            for asked in data[4:]:
                for one in here:
                    if one.device == asked:
                        self._answer(one, 0, one.read(address, size))
        elif instruction == SYNC_WRITE:
            address, size = struct.unpack_from("<HH", data)
            for at in range(4, len(data), size + 1):
                for one in here:
                    if data[at] in (one.device, one.get(SHADOW, 1)):
                        one.write(address, data[at + 1 : at + 1 + size])
        for one in here:
            own = one.device == device
            if instruction == PING and (own or device == BROADCAST):
                self._answer(one, 0, one.memory[0:2] + one.memory[6:7])
            elif instruction == READ and own:
                address, size = struct.unpack("<HH", data)
                self._answer(one, 0, one.read(address, size))
            elif instruction == WRITE and (own or device in (BROADCAST, one.get(SHADOW, 1))):
                error = one.write(int.from_bytes(data[:2], "little"), data[2:])
                if own and one.get(LEVEL, 1) == 2:
                    self._answer(one, error, b"")

    def _answer(self, servo: Servo, error: int, data: bytes) -> None:
        alert = 0x80 if servo.get(ERROR, 1) else 0
        frame = packet(servo.device, bytes((STATUS, error | alert)) + data)
        self.busy_ns += len(frame) * self.byte_ns
        self.coming.append((self.busy_ns, self.spoil(frame)))
