"""A Modbus drive and its line, byte by byte, written from the specifications alone.

Nothing of `sim/` or `drivers/` is used. Sources: MODBUS Application Protocol V1.1b3, MODBUS over
Serial Line V1.02, MODBUS Messaging on TCP/IP V1.0b; registers as in the profile `generic`, whose
file is its documentation. Time is the caller's: a port is one end of an in-memory transport.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from typing import Any

READ, READ_INPUT, WRITE_ONE, WRITE, READ_WRITE = 3, 4, 6, 16, 23
STATUS, POSITION, CONTROL, MODE, TORQUE, TIMEOUT = 2, 4, 16, 17, 18, 32
ENABLED, FAULT = 0x2, 0x4
NO_FUNCTION, NO_ADDRESS = 1, 2


def crc16(data: bytes) -> bytes:
    """CRC of a serial frame, low byte first (polynomial A001h)."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
    return struct.pack("<H", crc)


class Drive:
    """A drive of the profile `generic` with a motor of 4.4e-3 kg m^2, and what happened to it.

    `stubborn` writes of 0 to its control register are answered and have no effect; an `eager` one
    comes on by itself with its supply.
    """

    def __init__(self, stubborn: int = 0) -> None:
        self.words = dict.fromkeys(range(45), 0)
        self.words |= {0: 0x5457, 1: 1, 41: 1, 44: 1000}
        self.stubborn = stubborn
        self.position = self.speed = 0.0
        self.shown = 0.0  # when it was last asked
        self.now_ns = self.heard_ns = 0
        self.unguarded = False
        self.eager = False
        self.dead_until_ns = -1

    def cut_power(self, now_ns: int, span_ns: int) -> None:
        """Lose the supply, and with it all but the position; it answers again after `span_ns`."""
        kept = {place: self.words[place] for place in (POSITION, POSITION + 1)}
        self.words = dict.fromkeys(range(45), 0)
        self.words |= {0: 0x5457, 1: 1, 41: 1, 44: 1000, **kept}
        self.speed = 0.0
        self.dead_until_ns = now_ns + span_ns
        if self.eager:
            self.words[STATUS] = ENABLED

    @property
    def on(self) -> bool:
        """Whether its motor is enabled."""
        return bool(self.words[STATUS] & ENABLED)

    def advance(self, now_ns: int) -> None:
        span, self.now_ns = (now_ns - self.now_ns) * 1e-9, now_ns
        timeout = self.words[TIMEOUT]
        if self.on and timeout and now_ns - self.heard_ns > timeout * 1_000_000:
            self.words[STATUS] = FAULT
        torque = self.words[TORQUE] - (self.words[TORQUE] >> 15 << 16)
        push = torque * 1e-3 if self.on and self.words[MODE] == 2 else 0.0
        self.unguarded |= bool(push) and not timeout
        left = math.exp(-5.0 * span)
        self.speed = self.speed * left + push / 2.2e-2 * (1.0 - left)
        self.position += self.speed * span
        counts = round(self.position / math.tau * 65536) & 0xFFFFFFFF
        self.words[POSITION], self.words[POSITION + 1] = counts >> 16, counts & 0xFFFF

    def respond(self, pdu: bytes) -> bytes:
        """Take a request's PDU; return the response's."""
        function = pdu[0]
        if function in (READ, READ_INPUT):
            return self._read(function, *struct.unpack_from(">HH", pdu, 1))
        if function == WRITE_ONE:
            address, value = struct.unpack_from(">HH", pdu, 1)
            return self._write(function, address, [value]) or pdu[:5]
        if function == WRITE:
            address, count = struct.unpack_from(">HH", pdu, 1)
            values = struct.unpack_from(f">{count}H", pdu, 6)
            return self._write(function, address, values) or pdu[:5]
        if function == READ_WRITE:
            first, asked, address, count = struct.unpack_from(">HHHH", pdu, 1)
            values = struct.unpack_from(f">{count}H", pdu, 10)
            return self._write(function, address, values) or self._read(function, first, asked)
        return bytes((function | 0x80, NO_FUNCTION))

    def _read(self, function: int, address: int, count: int) -> bytes:
        places = range(address, address + count)
        if not all(place in self.words for place in places):
            return bytes((function | 0x80, NO_ADDRESS))
        if POSITION in places:
            self.shown = self.position
        data = struct.pack(f">{count}H", *(self.words[place] for place in places))
        return bytes((function, len(data))) + data

    def _write(self, function: int, address: int, values: Any) -> bytes:
        for place, value in enumerate(values, start=address):
            if place not in self.words:
                return bytes((function | 0x80, NO_ADDRESS))
            if place == CONTROL and value == 0 and self.on and self.stubborn:
                self.stubborn -= 1
                continue
            self.words[place] = value
            if place == CONTROL:
                status = self.words[STATUS]
                ready = 0 if status & FAULT else ENABLED
                self.words[STATUS] = {0: status & ~ENABLED, 1: status | ready, 2: 0}[value]
        return b""


class DriveLine:
    """A serial line or TCP server with drives by unit; `port` gives the host's end of it.

    `echo`: what is sent comes back, `cut`: nothing arrives any more; `resets`: how many connections
    break at the next write to a control register; `connections` counts those made, `requests` what
    was asked, and `on_request` is called with that before each. `spoil` makes another frame of what
    a drive answers, `refuse` an exception code of a request, 0 for none; on a serial line `twin`
    answers and obeys as unit 1 too.
    """

    def __init__(self, clock: Any, drives: dict[int, Drive], *, tcp: bool, echo: bool = False):
        self.clock, self.drives, self.tcp, self.echo = clock, drives, tcp, echo
        self.cut = False
        self.resets = 0
        self.requests = 0
        self.on_request: Callable[[int], None] | None = None
        self.spoil: Callable[[bytes], bytes] = bytes
        self.refuse: Callable[[bytes], int] = lambda pdu: 0
        self.twin: Drive | None = None
        self.connections = 0
        self.more_ns = 0
        """How much longer each answer takes than it has to."""

    def port(self, endpoint: str) -> Port:
        self.connections += 1
        return Port(self)


class Port:
    """One end of a line, as the driver's transport; raises what `lost` makes of a lost one."""

    lost: Any = OSError

    def __init__(self, line: DriveLine) -> None:
        self.line = line
        self.coming: list[tuple[int, bytes]] = []
        self.buffer = b""
        self.broken = False

    def write(self, data: bytes) -> None:
        now = self.line.clock.now_ns()
        self.advance(now)
        if self.broken:
            raise self.lost("connection reset")
        if self.line.echo:
            self.coming.append((now + 50_000, data))
        if self.line.cut:
            return
        self.buffer += data
        take = self._take_tcp if self.line.tcp else self._take_serial
        while take(now):
            pass

    def _take_tcp(self, now_ns: int) -> bool:
        if len(self.buffer) < 8:
            return False
        size = 6 + int.from_bytes(self.buffer[4:6], "big")
        if len(self.buffer) < size:
            return False
        frame, self.buffer = self.buffer[:size], self.buffer[size:]
        pdu = self._answer(frame[6], frame[7:], now_ns)
        if pdu:
            header = frame[:4] + struct.pack(">HB", len(pdu) + 1, frame[6])
            self.coming.append(
                (now_ns + 200_000 + self.line.more_ns, self.line.spoil(header + pdu))
            )
        return True

    def _take_serial(self, now_ns: int) -> bool:
        frame, self.buffer = self.buffer, b""
        if len(frame) < 4 or crc16(frame[:-2]) != frame[-2:]:
            return False
        pdu = self._answer(frame[0], frame[1:-2], now_ns)
        if pdu:
            whole = frame[:1] + pdu
            self.coming.append(
                (now_ns + 500_000 + self.line.more_ns, self.line.spoil(whole + crc16(whole)))
            )
        if self.line.twin is not None and frame[0] == 1:
            other = frame[:1] + self.line.twin.respond(frame[1:-2])
            self.coming.append((now_ns + 2_500_000, other + crc16(other)))
        return False

    def _answer(self, unit: int, pdu: bytes, now_ns: int) -> bytes:
        if self.line.on_request is not None:
            self.line.on_request(self.line.requests)
        self.line.requests += 1
        writes_control = pdu[0] in (WRITE_ONE, WRITE) and pdu[1:3] == struct.pack(">H", CONTROL)
        if self.line.resets and writes_control and self.line.drives[unit].on:
            self.line.resets -= 1
            self.broken = True
            return b""
        drive = self.line.drives.get(unit)
        if drive is None or now_ns < drive.dead_until_ns:
            return b""
        drive.heard_ns = now_ns
        code = self.line.refuse(pdu)
        return bytes((pdu[0] | 0x80, code)) if code else drive.respond(pdu)

    def read(self) -> bytes:
        now = self.line.clock.now_ns()
        self.advance(now)
        if self.broken:
            raise self.lost("connection reset")
        here = b"".join(data for at, data in self.coming if at <= now)
        self.coming = [(at, data) for at, data in self.coming if at > now]
        return here

    def close(self) -> None:
        self.broken = True

    def next_event_ns(self) -> int | None:
        return min((at for at, _ in self.coming), default=None)

    def readable(self) -> bool:
        now = self.line.clock.now_ns()
        return self.broken or any(at <= now for at, _ in self.coming)

    def advance(self, to_ns: int) -> None:
        for drive in self.line.drives.values():
            drive.advance(to_ns)
