"""A line of Feetech servos, byte by byte, written from their memory tables for these tests.

Nothing of `sim/` or `drivers/` is used. Registers are bytes at addresses, numbers sign and
magnitude. The motor is a damped inertia in continuous time: by current on HLS, on STS by a voltage,
with its back-EMF; in position mode a stiff spring to the goal. Two that answer at once garble each
other; who has another return delay answers later.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

FF = b"\xff\xff"
ALL = 0xFE
PING, READ, WRITE, REG_WRITE, ACTION, SYNC_READ, SYNC_WRITE = 1, 2, 3, 4, 5, 0x82, 0x83
TABLE_SIZE = 90
FIRMWARE = {"STS": (3, 10, 9, 3), "HLS": (3, 42, 10, 13), "SCS": (0, 9, 5, 4)}
EEPROM_END = 40
DEFAULTS = {
    6: 0, 7: 0, 8: 1, 11: 255, 12: 15, 16: 0xE8, 17: 3, 18: 0, 28: 0xF4, 29: 1, 33: 0, 38: 200,
}  # fmt: skip
RAM = {40: 0, 48: 0xE8, 49: 3, 55: 1, 62: 74, 63: 31}
KT, OHM, AMPERE = {"STS": 1.21, "HLS": 0.814, "SCS": 1.0}, 2.68, 6.5e-3
FRICTION = 0.05
COUNT = math.tau / 4096


def frame(device: int, code: int, data: bytes = b"") -> bytes:
    body = bytes((device, len(data) + 2, code)) + data
    return FF + body + bytes((255 - sum(body) % 256,))


def frames(buffer: bytearray) -> Iterator[tuple[int, int, bytes]]:
    """Take the instructions out of a buffer: id, instruction, parameters."""
    while (at := buffer.find(FF)) >= 0 and len(buffer) >= at + 4:
        del buffer[:at]
        if buffer[2] == 255 or buffer[3] < 2:
            del buffer[:1]
            continue
        size = 4 + buffer[3]
        if len(buffer) < size:
            return
        whole = bytes(buffer[:size])
        del buffer[:size]
        if sum(whole[2:]) % 256 == 255:
            yield whole[2], whole[4], whole[5:-1]


def magnitude(value: int, sign: int) -> int:
    """Return a number as sign and magnitude."""
    return value if value >= 0 else -value | 1 << sign


class Servo:
    """One servo of `mass` [kg m^2]; `registers` are saved bytes by address."""

    def __init__(
        self, device: int, kind: str = "HLS", mass: float = 1.0,
        registers: Mapping[int, int] | None = None,
    ) -> None:  # fmt: skip
        major, minor, low, high = FIRMWARE[kind]
        self.kind = kind
        self.eeprom = {
            0: major, 1: minor, 2: int(kind == "SCS"), 3: low, 4: high, 5: device, **DEFAULTS,
            **({7: 0xFF} if kind == "HLS" else {}), **(registers or {}),
        }  # fmt: skip
        self.mass = mass
        self.x = self.v = 0.0  # [rad], of the horn, 0 at 2048
        self.now_ns = 0
        self.dead_until_ns = -1
        self.stubborn = self.mute = False
        self.status = 0
        self.volts = 7.4
        self.came_on: list[tuple[int, int]] = []
        """Mode and goal(44) whenever torque came on."""
        self.memory = bytearray(TABLE_SIZE)
        self.start()

    @property
    def device(self) -> int:
        return self.memory[5]

    @property
    def ids(self) -> tuple[int, ...]:
        return (self.device, self.memory[7]) if self.kind == "HLS" else (self.device,)

    def start(self) -> None:
        """Forget all that is in RAM, as after a power cycle."""
        self.memory[:] = bytes(TABLE_SIZE)
        for address, value in {**self.eeprom, **RAM}.items():
            self.memory[address] = value
        self.memory[48:50] = self.memory[16:18]
        self.v = 0.0

    def cut_power(self, now_ns: int, span_ns: int) -> None:
        """Lose the supply; it answers again after `span_ns`."""
        self.start()
        self.dead_until_ns = now_ns + span_ns

    def word(self, address: int, sign: int) -> int:
        held = self.memory[address] | self.memory[address + 1] << 8
        return -(held ^ 1 << sign) if held >> sign & 1 else held

    @property
    def effort(self) -> float:
        """[N m] What its motor is told to give, at standstill."""
        on, mode = self.memory[40], self.memory[33]
        if on != 1 or mode not in (0, 2):
            return 0.0
        constant = KT[self.kind]
        if mode == 0:
            return 20.0 * (COUNT * (self.word(42, 15) - 2048) - self.x)
        if self.kind == "HLS":
            return self.word(44, 15) * AMPERE * constant
        return self.word(44, 10) / 1000 * self.volts * constant / OHM

    def advance(self, now_ns: int) -> None:
        span = (now_ns - self.now_ns) * 1e-9
        self.now_ns = max(now_ns, self.now_ns)
        by_voltage = self.memory[40] == 1 and self.kind == "STS" and self.memory[33] == 2
        damping = FRICTION + (KT["STS"] ** 2 / OHM if by_voltage else 0.0)
        while span > 0.0:
            h = min(span, 1e-3)
            self.v += (self.effort - damping * self.v) / self.mass * h
            self.x += self.v * h
            span -= h

    def read(self, address: int, size: int) -> bytes:
        memory = self.memory
        place = magnitude(round(self.x / COUNT) + 2048, 15)
        speed = magnitude(round(self.v / COUNT / (1 if memory[18] & 4 else 50)), 15)
        amperes = magnitude(round(self.effort / KT[self.kind] / AMPERE), 15)
        for at, value in ((56, place), (58, speed), (69, amperes)):
            memory[at : at + 2] = value.to_bytes(2, "little")
        memory[62], memory[65] = round(10 * self.volts), self.status
        return bytes(memory[address : address + size])

    def write(self, address: int, data: bytes) -> None:
        """Take a write; below 40 it lasts only while lock(55) is 0."""
        unlocked = self.memory[55] == 0
        was_on = self.memory[40]
        for at, value in enumerate(data, address):
            if 5 <= at < 56 and not (at == 40 and self.stubborn):
                self.memory[at] = value
                if at < EEPROM_END and unlocked:
                    self.eeprom[at] = value
        if self.memory[40] == 1 and not was_on:
            self.came_on.append((self.memory[33], self.word(44, 15)))


class Line:
    """The servos and the wire: an in-memory transport, with the time on the wire.

    `echoes`: the host hears what it sends. `spoil` makes another frame of what a servo answers.
    """

    def __init__(self, clock: Any, *servos: Servo, baud: int = 1_000_000) -> None:
        self.clock = clock
        self.servos = list(servos)
        self.byte_ns = 10_000_000_000 // baud
        self.buffer = bytearray()
        self.coming: list[tuple[int, bytes]] = []
        self.sent: list[tuple[int, int, bytes]] = []
        self.echoes = self.cut = False
        self.spoil: Callable[[bytes], bytes] = bytes
        self.on_instruction: Callable[[], None] | None = None

    def write(self, data: bytes) -> None:
        now = self.clock.now_ns()
        self.advance(now)
        at = now
        for byte in data:
            at += self.byte_ns
            if self.echoes:
                self.coming.append((at, bytes((byte,))))
            self.buffer.append(byte)
            for device, code, params in frames(self.buffer):
                if self.on_instruction is not None:
                    self.on_instruction()
                self.sent.append((device, code, params))
                if not self.cut:
                    self._take(at, device, code, params)
        self.coming.sort(key=lambda one: one[0])

    def say(self, data: bytes) -> None:
        """Put bytes of another master on the line: the host hears them, and the servos."""
        self.coming.append((self.clock.now_ns() + 1, data))
        self.buffer += data
        for device, code, params in frames(self.buffer):
            self._take(self.clock.now_ns(), device, code, params)

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
        for servo in self.servos:
            servo.advance(to_ns)

    def _take(self, now_ns: int, device: int, code: int, data: bytes) -> None:
        here = [one for one in self.servos if now_ns >= one.dead_until_ns]
        if code == SYNC_READ and device == ALL:
            at = now_ns
            for asked in data[2:]:
                for one in here:
                    if one.device == asked and one.kind != "SCS":
                        at = self._answer(one, at, one.read(data[0], data[1]))
            return
        if code == SYNC_WRITE and device == ALL:
            for at in range(2, len(data), data[1] + 1):
                for one in here:
                    if data[at] in one.ids:
                        one.write(data[0], data[at + 1 : at + 1 + data[1]])
            return
        for number, one in enumerate(here):
            if code == PING and device == ALL:
                self._answer(one, now_ns + 300_000 * (number + 1), b"")
            if device not in (*one.ids, ALL):
                continue
            if code == WRITE:
                one.write(data[0], data[1:])
            if device != one.device:
                continue
            if code == READ:
                self._answer(one, now_ns, one.read(data[0], data[1]))
            elif code == PING or (code == WRITE and one.memory[8]):
                self._answer(one, now_ns, b"")

    def _answer(self, servo: Servo, at_ns: int, data: bytes) -> int:
        """Answer behind its return delay; return when it has."""
        if servo.mute:
            return at_ns
        answer = self.spoil(frame(servo.device, servo.status, data))
        delay = servo.memory[7] * 2000 if servo.kind == "STS" else 0
        begin = at_ns + delay + 20_000
        for offset, byte in enumerate(answer):
            due = begin + (offset + 1) * self.byte_ns
            clash = next((at for at, one in enumerate(self.coming) if one[0] == due), None)
            if clash is None:
                self.coming.append((due, bytes((byte,))))
            else:  # two at once: dominant bits win, and a framing error follows
                self.coming[clash] = (due, bytes((self.coming[clash][1][0] & byte ^ 0x10,)))
        self.coming.sort(key=lambda one: one[0])
        return begin + len(answer) * self.byte_ns
