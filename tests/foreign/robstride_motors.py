"""RobStride motors in virtual time, by the tables of their manual; of nobody else's code.

Identifiers are cut with integer arithmetic here, and codes rounded.
"""

from __future__ import annotations

import heapq
import itertools
import struct

from tautwave.contracts import Clock

OUT_NS, IN_NS = 160_000, 160_000
EFF = 1 << 31
MODE, LIMIT, PLACE, VOLTS, SILENCE = 0x7005, 0x700B, 0x7019, 0x701C, 0x7028


class RobstrideMotor:
    """One motor of `mass` [kg m^2]; `real` are the ranges that its codes have: p, v, t."""

    def __init__(
        self,
        number: int,
        mass: float = 1.0,
        real: tuple[float, float, float] = (12.57, 33.0, 14.0),
        gains: float = 1.0,
    ) -> None:
        self.number, self.mass, self.real, self.gains = number, mass, real, gains
        self.x = self.speed = 0.0
        self.deaf: set[int] = set()
        self.missing: set[int] = set()
        self.stuck = False
        self.off_until_ns = -1
        self.now_ns = 0
        self.answers = True
        self.power_up()

    def power_up(self) -> None:
        self.state = self.faults = 0
        self.torque = 0.0
        self.fed_ns = self.now_ns
        self.table: dict[int, float] = {MODE: 3, LIMIT: self.real[2], VOLTS: 24.0, SILENCE: 0}

    def cut_power(self, now_ns: int, span_ns: int) -> None:
        self.pass_time(now_ns)
        self.power_up()
        self.off_until_ns = now_ns + span_ns

    def pass_time(self, to_ns: int) -> None:
        counts = int(self.table[SILENCE])
        trip = self.fed_ns + counts * 50_000
        if self.state == 2 and counts and trip <= to_ns:
            self._move(max(trip, self.now_ns))
            self.state, self.torque = 0, 0.0
        self._move(to_ns)

    def _move(self, to_ns: int) -> None:
        h = max(to_ns - self.now_ns, 0) * 1e-9
        push = max(-self.table[LIMIT], min(self.table[LIMIT], self.torque))
        push = push if self.state == 2 else 0.0
        self.x += self.speed * h + 0.5 * push / self.mass * h * h
        self.speed += push / self.mass * h
        self.now_ns = max(to_ns, self.now_ns)

    def hear(self, now_ns: int, can_id: int, data: bytes) -> list[tuple[int, bytes]]:
        """Take a frame; return what it answers."""
        self.pass_time(now_ns)
        if now_ns < self.off_until_ns or not can_id & EFF or can_id % 256 != self.number:
            return []
        kind, middle = can_id // 2**24 % 32, can_id // 256 % 65536
        self.fed_ns = self.now_ns
        host = middle % 256
        if kind == 0:
            return [(EFF + self.number * 256 + 0xFE, bytes(range(7)) + bytes([self.number]))]
        if kind == 17:
            (which,) = struct.unpack_from("<H", data)
            if which in self.missing:
                return []
            value = self.x if which == PLACE else self.table.get(which, 0.0)
            return [(EFF + 17 * 2**24 + self.number * 256 + host, self._told(which, value))]
        if kind == 18:
            which, _ = struct.unpack_from("<HH", data)
            if which not in self.deaf:
                form = "<f" if which in (LIMIT, VOLTS) else "<I"
                self.table[which] = struct.unpack(form, data[4:])[0]
        elif kind == 3 and not self.stuck:
            self.state = 0 if self.faults else 2
        elif kind == 4 and not self.stuck:
            self.state, self.torque = 0, 0.0
            self.faults = 0 if data[0] else self.faults
        elif kind == 1 and self.state == 2:
            kp, kd = struct.unpack(">HH", data[4:])
            assert kp == kd == 0
            self.torque = (middle / 65535.0 * 2.0 - 1.0) * self.real[2] * (not self.stuck)
            host = 0xFD
        elif kind == 1:
            host = 0xFD
        return [self._feedback(host)] if self.answers else []

    def _told(self, which: int, value: float) -> bytes:
        body = struct.pack("<f", value) if which in (LIMIT, PLACE, VOLTS) else None
        return struct.pack("<HH", which, 0) + (body or int(value).to_bytes(4, "little"))

    def _feedback(self, host: int) -> tuple[int, bytes]:
        codes = [
            round((value / top + 1.0) * 32767.5)
            for value, top in zip((self.x, self.speed, self.torque), self.real, strict=True)
        ]
        can_id = EFF + 2 * 2**24 + self.state * 2**22 + self.faults * 2**16
        return can_id + self.number * 256 + host, struct.pack(">HHHH", *codes, 305)


class RobstrideLine:
    """A bus in virtual time with motors; the port of a driver."""

    def __init__(self, clock: Clock, *motors: RobstrideMotor) -> None:
        self.clock, self.motors = clock, list(motors)
        self.cut = self.spoiled = False
        self.sent: list[tuple[int, bytes]] = []
        self._due: list[tuple[int, int, int, bytes]] = []
        self._order = itertools.count()
        self._free_ns = 0
        self._now_ns = clock.now_ns()

    def send(self, can_id: int, data: bytes) -> bool:
        self.sent.append((can_id, data))
        self.advance(self.clock.now_ns())
        if self.cut:
            return True
        at = max(self._free_ns, self._now_ns) + OUT_NS
        for motor in self.motors:
            for answer_id, answer in motor.hear(self._now_ns, can_id, data):
                at += IN_NS
                self.inject(at, answer_id, answer)
        self._free_ns = at
        return True

    def inject(self, at_ns: int, can_id: int, data: bytes) -> None:
        """Put a frame on the bus."""
        if self.spoiled:  # that of another motor
            can_id = can_id - can_id // 256 % 256 * 256 + 99 * 256
        heapq.heappush(self._due, (at_ns, next(self._order), can_id, data))

    def receive(self) -> tuple[int, bytes, int] | None:
        self.advance(self.clock.now_ns())
        if not self.readable():
            return None
        at, _, can_id, data = heapq.heappop(self._due)
        return can_id, data, at

    def next_event_ns(self) -> int | None:
        return self._due[0][0] if self._due else None

    def readable(self) -> bool:
        return bool(self._due) and self._due[0][0] <= self._now_ns

    def advance(self, to_ns: int) -> None:
        self._now_ns = max(self._now_ns, to_ns)
        for motor in self.motors:
            motor.pass_time(self._now_ns)

    def close(self) -> None:
        pass
