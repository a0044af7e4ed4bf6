"""Simulated moteus controllers: the other end of the frames, in memory, on the clock of the run.

Written from the register reference alone, it shares no code with the driver: a wrong frame of
either would be seen. A controller answers only when it is asked; its subframes act in their order.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from typing import Any

from tautwave.plugin import AxisModel, BusSpec, Clock, SimulatorPlugin
from tautwave_example_moteus.options import Options
from tautwave_sim.axis import SimulatedAxis

ANSWERS_AFTER_NS = 60_000
"""From the end of a request to the end of its answer, one after the other."""
SIZES = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
EFF = 0x80000000


class Controller:
    """One controller and what it moves."""

    def __init__(self, number: int, direction: int, zero: float, axis: SimulatedAxis) -> None:
        self.number, self.direction, self.zero, self.axis = number, direction, zero, axis
        self.map_version = 5
        self.stuck = False
        self.deaf_to_watchdog = False
        self.dead_until_ns = -1
        self.fault = 0
        self.power_on()

    def power_on(self) -> None:
        """Start: stopped."""
        self.mode = 0
        self.torque = 0.0
        self.watchdog_s = 0.1
        self.heard_ns: int | None = None
        self._act()

    def fail(self, fault: int) -> None:
        """Stop with a fault that stays until a stop."""
        self.mode, self.fault, self.torque = 1, fault, 0.0
        self._act()

    def _act(self) -> None:
        self.axis.command(self.direction * (self.torque if self.mode == 10 else 0.0))

    def run(self, now_ns: int) -> None:
        """Trip the watchdog where it is due."""
        heard = now_ns if self.heard_ns is None else self.heard_ns
        if self.mode == 10 and now_ns - heard >= self.watchdog_s * 1e9:
            self.mode, self.torque = 11, 0.0
            self._act()

    def registers(self) -> dict[int, float]:
        """Return what may be read."""
        place = self.axis.measure().position
        speed = self.axis.physics.v
        return {
            0x000: self.mode,
            0x001: (self.direction * place + self.zero) / math.tau,
            0x002: self.direction * speed / math.tau,
            0x003: self.torque if self.mode == 10 else 0.0,
            0x00D: 24.0,
            0x00E: 30.0,
            0x00F: self.fault,
            0x027: self.watchdog_s,
            0x100: 4,
            0x101: 0x010A,
            0x102: self.map_version,
            0x120: 0x11111111,
            0x121: 0x22222222,
            0x122: self.number,
        }

    def receive(self, now_ns: int, data: bytes) -> bytes:
        """Take a frame's subframes in their order; return the answer's."""
        answer, wrote, at = b"", {}, 0
        while at < len(data):
            head = data[at]
            at += 1
            if head == 0x50:
                continue
            kind, count = (head >> 2) & 3, head & 3
            if not count:
                count, at = data[at], at + 1
            register = shift = 0
            while True:
                register |= (data[at] & 0x7F) << shift
                shift, at = shift + 7, at + 1
                if data[at - 1] < 0x80:
                    break
            for number in range(register, register + count):
                if head < 0x10:
                    size = (1, 2, 4, 4)[kind]
                    wrote[number] = _value(kind, number, data[at : at + size])
                    at += size
            if head >= 0x10:
                values = [self.registers().get(n) for n in range(register, register + count)]
                if None in values:
                    answer += bytes((0x31, register & 0x7F, 1))
                else:
                    answer += bytes(((head & 0x0F) | 0x20,)) + _varuint(register)
                    answer += b"".join(
                        _coded(kind, register + n, float(value or 0.0))
                        for n, value in enumerate(values)
                    )
        self._obey(now_ns, wrote)
        return answer

    def _obey(self, now_ns: int, wrote: dict[int, float]) -> None:
        if 0 not in wrote or self.stuck:
            return
        if wrote[0] == 0:
            self.mode, self.fault, self.torque = 0, 0, 0.0
        elif wrote[0] == 10 and self.mode in (0, 10):
            self.mode, self.heard_ns = 10, now_ns
            if not self.deaf_to_watchdog:
                self.watchdog_s = wrote.get(0x27, 0.1)
            gains = wrote.get(0x23, 1.0), wrote.get(0x24, 1.0), wrote.get(0x20, 0.0)
            # With gains or a goal it would hold a position; nothing here asks for that.
            free = gains[0] == gains[1] == 0.0 and math.isnan(gains[2])
            self.torque = wrote.get(0x22, 0.0) if free else math.nan
        self._act()


def _scale(kind: int, register: int) -> float:
    """Return what a count of an integer type stands for in a register."""
    if kind == 3:
        return 1.0
    if register in (0x01, 0x20):
        return (0.01, 1e-4, 1e-5)[kind]
    if register in (0x23, 0x24):
        return (1 / 127, 1 / 32767, 1 / 2147483647)[kind]
    return {0x0D: (0.5, 0.1, 0.001)[kind], 0x0E: (1.0, 0.1, 0.001)[kind]}.get(register, 1.0)


def _value(kind: int, register: int, data: bytes) -> float:
    if kind == 3:
        return float(struct.unpack("<f", data)[0])
    count = int.from_bytes(data, "little", signed=True)
    if count == -(1 << (8 * len(data) - 1)):
        return math.nan
    return count * _scale(kind, register)


def _coded(kind: int, register: int, value: float) -> bytes:
    if kind == 3:
        return struct.pack("<f", value)
    return struct.pack(("<b", "<h", "<i")[kind], round(value / _scale(kind, register)))


def _varuint(value: int) -> bytes:
    out = b""
    while value > 0x7F:
        out, value = out + bytes((value & 0x7F | 0x80,)), value >> 7
    return out + bytes((value,))


class Bus:
    """Controllers on a bus in memory; the driver's transport, and the simulator of a run."""

    def __init__(
        self, options: Options, bus: BusSpec, physics: Sequence[AxisModel], clock: Clock
    ) -> None:
        known = {one.id: one for one in options.devices}
        self.axes = [
            SimulatedAxis(spec.name, truth) for spec, truth in zip(bus.axes, physics, strict=True)
        ]
        self.controllers = [
            Controller(spec.device_id, known[spec.device_id].direction, known[spec.device_id].zero,
                       axis)
            for spec, axis in zip(bus.axes, self.axes, strict=True)
        ]  # fmt: skip
        self.columns = [column for axis in self.axes for column in axis.columns]
        self.transport = self
        self.cut = self.spoiled = False
        self._clock = clock
        self._period_ns = bus.period_ns
        self._slot_ns = self._now_ns = clock.now_ns()
        self._free = False
        self._line: list[tuple[int, int, bytes]] = []

    # -- the driver's end ----------------------------------------------------------------------

    def send(self, can_id: int, data: bytes) -> bool:
        """Take a frame of the host."""
        assert can_id & EFF
        assert len(data) in SIZES
        self.advance(self._clock.now_ns())
        if self.cut:
            return True
        wants, number = can_id >> 15 & 1, can_id & 0x7F
        for one in self.controllers:
            if one.number != number or self._now_ns < one.dead_until_ns:
                continue
            answer = one.receive(self._now_ns, data)
            if one.mode == 10:
                self._free = True  # time begins to move what is engaged
            if wants:
                free = max(self._now_ns, self._line[-1][0] if self._line else 0)
                answer += bytes((0x50,)) * (
                    next(n for n in SIZES if n >= len(answer)) - len(answer)
                )
                bare = number << 8
                self._line.append(
                    (
                        free + ANSWERS_AFTER_NS,
                        bare | (EFF if bare > 0x7FF else 0),
                        answer if not self.spoiled else bytes((0x30, 0, 1)) + answer[3:],
                    )
                )
        return True

    def receive(self) -> tuple[int, bytes, int] | None:
        """Return the oldest answer that has arrived."""
        self.advance(self._clock.now_ns())
        if not self.readable():
            return None
        at_ns, can_id, data = self._line.pop(0)
        return can_id, data, at_ns

    def next_event_ns(self) -> int | None:
        """Return when the next answer is there."""
        return self._line[0][0] if self._line else None

    def readable(self) -> bool:
        """Return whether one is."""
        return bool(self._line) and self._line[0][0] <= self._now_ns

    def close(self) -> None:
        """Leave; what was on the line is gone."""
        self._line.clear()

    # -- time ----------------------------------------------------------------------------------

    def advance(self, to_ns: int) -> None:
        """Let time pass: slots of the axes, and watchdogs."""
        while self._slot_ns + self._period_ns <= to_ns:
            self._slot_ns += self._period_ns
            for one in self.controllers:
                one.run(self._slot_ns)
            if self._free:
                for axis in self.axes:
                    axis.pass_slot()
        self._now_ns = max(self._now_ns, to_ns)
        for one in self.controllers:
            one.run(self._now_ns)

    def fill(self, row: Any, at: int) -> None:
        """Write the truth at this slot."""
        for axis in self.axes:
            axis.fill(row, at)
            at += len(axis.columns)

    def forget(self, which: int, span_ns: int) -> None:
        """Take a controller's power for a while."""
        self.controllers[which].power_on()
        self.controllers[which].dead_until_ns = self._now_ns + span_ns


simulator = SimulatorPlugin(Options, Bus, "moteus controllers in memory (example)")
