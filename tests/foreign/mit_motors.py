"""Damiao motors in virtual time, written from their manual for these tests; of nobody else's code.

Frames are cut with integer shifts here, and codes rounded where others truncate.
"""

from __future__ import annotations

import heapq
import itertools
import math
import struct

from tautwave.contracts import Clock

OUT_NS, IN_NS = 125_000, 125_000
ESC, MST, TIMEOUT, MODE, P, V, T, FIRMWARE, SUB, HARD, SERIAL, GEAR, INERTIA, VOLTS, FILTER = (
    8, 7, 9, 10, 21, 22, 23, 14, 36, 13, 15, 20, 12, 60, 32,
)  # fmt: skip
FLOATS = (P, V, T, GEAR, INERTIA, VOLTS, FILTER)


class ForeignMotor:
    """One motor of `mass` [kg m^2], free to turn; registers by number."""

    def __init__(self, esc: int, mst: int, mass: float, registers: dict[int, float]) -> None:
        self.saved: dict[int, float] = {
            ESC: esc, MST: mst, TIMEOUT: 0, MODE: 2, P: 12.5, V: 30.0, T: 10.0, FIRMWARE: 5013,
            SUB: 2, HARD: 4, SERIAL: 77, GEAR: 10.0, INERTIA: 1.8e-5, VOLTS: 24.1, FILTER: 100.0,
            **registers,
        }  # fmt: skip
        self.mass = mass
        self.x = self.speed = 0.0
        self.turns = 0
        self.powered = True
        self.back_ns: int | None = None
        self.mute = 0
        self.deaf_registers: set[int] = set()
        self.log: list[bytes] = []
        self.now_ns = 0
        self.power_up()

    def power_up(self) -> None:
        self.ram = dict(self.saved)
        self.state = 0
        self.kd = self.push = 0.0
        self.torque = 0.0
        self.fed_ns = self.now_ns

    def cut_power(self, now_ns: int, span_ns: int) -> None:
        """Lose its supply for so long; it turns on freely, and comes back with what was saved."""
        self.pass_time(now_ns)
        self.powered, self.torque, self.state = False, 0.0, 0
        self.back_ns = self.now_ns + span_ns

    def pass_time(self, to_ns: int) -> None:
        if not self.powered and self.back_ns is not None and to_ns >= self.back_ns:
            self.back_ns, self.powered = None, True
            self.power_up()
        if self.state == 1 and self.ram[TIMEOUT]:
            trip_ns = self.fed_ns + int(self.ram[TIMEOUT]) * 50_000
            if trip_ns <= to_ns:
                self._move(trip_ns)
                self.state, self.torque = 13, 0.0
        self._move(to_ns)

    def _move(self, to_ns: int) -> None:
        h = max(to_ns - self.now_ns, 0) * 1e-9
        self.now_ns = max(self.now_ns, to_ns)
        if self.state == 1 and self.kd > 0.0:
            # m v' = torque - kd v, the frame's velocity being in the torque
            time, last = self.mass / self.kd, self.push / self.kd
            fades = -math.expm1(-h / time)
            self.x += last * h + (self.speed - last) * time * fades
            self.speed += (last - self.speed) * fades
            self.torque = self.push - self.kd * self.speed
            return
        acceleration = self.torque / self.mass
        self.x += self.speed * h + 0.5 * acceleration * h * h
        self.speed += acceleration * h

    def hear(self, can_id: int, data: bytes) -> list[tuple[int, bytes]]:
        """Take a frame; return the answers."""
        if not self.powered:
            return []
        if can_id == 0x7FF:
            return self._register(data)
        if can_id != self.ram[ESC] or len(data) != 8:
            return []
        self.fed_ns = self.now_ns
        self.log.append(data)
        word = int.from_bytes(data, "big")
        if word >> 8 == 0xFF_FFFF_FFFF_FFFF:
            order = word & 0xFF
            if order == 0xFC and self.state == 0:
                self.state = 1
            elif (order == 0xFD and self.state == 1) or (order == 0xFB and self.state >= 8):
                self.state, self.torque = 0, 0.0
            return self._say()
        answer = self._say()
        if self.state == 1 and self.ram[MODE] == 1:
            assert word >> 24 & 0xFFF == 0, "no spring is asked for"
            self.kd = (word >> 12 & 0xFFF) / 4095 * 5.0
            goal = ((word >> 36 & 0xFFF) / 4095 * 2 - 1) * self.ram[V]
            self.push = ((word & 0xFFF) / 4095 * 2 - 1) * self.ram[T] + self.kd * goal
            self.torque = self.push - self.kd * self.speed
        return answer

    def _say(self) -> list[tuple[int, bytes]]:
        if self.mute > 0:
            self.mute -= 1
            return []
        x = self.x + self.turns * 6.283185307179586
        p_max, v_max, t_max = (
            self.ram[one] if 0.0 < self.ram[one] < 1e6 else 1.0 for one in (P, V, T)
        )
        p = round((x / p_max + 1) / 2 * 65535) & 0xFFFF
        v = round((self.speed / v_max + 1) / 2 * 4095) & 0xFFF
        t = round((self.torque / t_max + 1) / 2 * 4095)
        head = self.state << 4 | int(self.ram[ESC]) & 15
        word = head << 56 | p << 40 | v << 28 | t << 16 | 31 << 8 | 42
        return [(int(self.ram[MST]), word.to_bytes(8, "big"))]

    def _register(self, data: bytes) -> list[tuple[int, bytes]]:
        esc, kind, number = struct.unpack_from("<HBB", data)
        if esc != self.ram[ESC]:
            return []
        self.fed_ns = self.now_ns
        if kind == 0xCC:
            return self._say()
        if number not in self.ram or kind not in (0x33, 0x55):
            return []
        form = "<f" if number in FLOATS else "<I"
        if kind == 0x55:
            if number not in self.deaf_registers:
                (self.ram[number],) = struct.unpack_from(form, data, 4)
            return [(int(self.ram[MST]), data)]
        value = self.ram[number]
        packed = struct.pack(form, value if number in FLOATS else int(value))
        return [(int(self.ram[MST]), data[:4] + packed)]


class MotorLine:
    """The driver's port, with motors behind it, and other masters where a test sends as one.

    Parameters
    ----------
    clock : Clock
        The driver's.
    motors : sequence of ForeignMotor
        What is on the bus.
    """

    def __init__(self, clock: Clock, motors: list[ForeignMotor]) -> None:
        self._clock = clock
        self.motors = motors
        self.now_ns = clock.now_ns()
        self._order = itertools.count()
        self._queue: list[tuple[int, int, bool, int, bytes]] = []
        self._inbox: list[tuple[int, bytes, int]] = []
        self.classic_ids: set[int] = set()
        self.cut = False
        self.later_ns: dict[int, list[int]] = {}
        """By id of answers: how much later the next ones come."""

    def other_master(self, can_id: int, data: bytes) -> None:
        """Send as somebody else on the bus: motors hear it, and the driver as well."""
        at_ns = max(self.now_ns, self._clock.now_ns()) + OUT_NS
        self._push(at_ns, True, can_id, data)
        self._push(at_ns, False, can_id, data)

    def _push(self, at_ns: int, outward: bool, can_id: int, data: bytes) -> None:
        heapq.heappush(self._queue, (at_ns, next(self._order), outward, can_id, bytes(data)))

    def send(self, can_id: int, data: bytes) -> bool:
        self.advance(self._clock.now_ns())
        if not self.cut:
            self._push(self.now_ns + OUT_NS, True, can_id, data)
        return True

    def receive(self) -> tuple[int, bytes, int] | None:
        return self._inbox.pop(0) if self._inbox else None

    def readable(self) -> bool:
        return bool(self._inbox)

    def next_event_ns(self) -> int | None:
        return self._queue[0][0] if self._queue else None

    def advance(self, to_ns: int) -> None:
        while self._queue and self._queue[0][0] <= to_ns:
            at_ns, _, outward, can_id, data = heapq.heappop(self._queue)
            self._pass(at_ns)
            if not outward:
                self._inbox.append((can_id, data, at_ns))
                continue
            for motor in self.motors:
                for answer_id, answer in motor.hear(can_id, data):
                    waits = self.later_ns.get(answer_id, [])
                    later_ns = waits.pop(0) if waits else 0
                    self._push(at_ns + IN_NS + later_ns, False, answer_id, answer)
        self._pass(to_ns)

    def _pass(self, to_ns: int) -> None:
        self.now_ns = max(self.now_ns, to_ns)
        for motor in self.motors:
            motor.pass_time(to_ns)

    def close(self) -> None:
        self._inbox.clear()
