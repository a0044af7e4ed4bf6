"""All servos of a line: addressing, responses and their times, and slots."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

from tautwave_sim.dynamixel import packets as p2
from tautwave_sim.dynamixel.hardware import HARDWARE_KINDS, MOMENT_KINDS
from tautwave_sim.dynamixel.instructions import execute
from tautwave_sim.dynamixel.packets import BROADCAST
from tautwave_sim.dynamixel.servo import Reply, Servo
from tautwave_sim.wire import packets1 as p1
from tautwave_sim.wire.packets1 import Packet
from tautwave_sim.wire.serial import SerialLine, Transmission, wire_ns
from tautwave_sim.wire.serial_faults import Event, FaultPlan

SILENCE_NS = 100_000_000
"""A packet begun is given up after this much silence (e-manual, protocol 1.0: 100 ms)."""
BURST_GAP_NS = 100_000
"""Packets of the host closer together than this are one exchange."""
FREE_STEP_NS = 50_000_000
STATUS_BYTES = 11
EXCHANGES = (p2.SYNC_READ, p2.FAST_SYNC_READ, p2.BULK_READ, p2.FAST_BULK_READ)

Part = tuple[int, int, int]  # id, address, length


class _Heard(NamedTuple):
    """A packet on its way to the servos."""

    packet: Packet
    protocol: float
    sent: Transmission
    begun_ns: int


class ServoBus:
    """The servos on a line, its `Listener`.

    Parameters
    ----------
    line : SerialLine
        The line.
    servos : sequence of Servo
        In the order of the axes.
    plan : FaultPlan
        What goes wrong with packets.
    events : sequence of Event
        Scripted moments; those of packets are the plan's.
    period_ns : int
        Length of a slot [ns].
    late_ns : int
        How late a late response is [ns].
    free : bool
        Move from the beginning on, torque or not; else from the first exchange with torque on.
    """

    def __init__(
        self,
        line: SerialLine,
        servos: Sequence[Servo],
        plan: FaultPlan,
        events: Sequence[Event],
        period_ns: int,
        late_ns: int,
        free: bool = False,
    ) -> None:
        self.servos = list(servos)
        self._line = line
        self._plan = plan
        self._events = [event for event in events if event.kind in MOMENT_KINDS]
        self._period_ns = period_ns
        self._late_ns = late_ns
        self._free = free
        self._origin_ns: int | None = None
        self._began_ns: int | None = None
        self._slot = 0
        self._burst_ns = 0
        self._sent_end_ns = -SILENCE_NS
        self._parsers: dict[float, p1.Parser | p2.Parser] = {2.0: p2.Parser(), 1.0: p1.Parser()}
        self._fed = {2.0: 0, 1.0: 0}
        line.listener = self

    def start(self, now_ns: int) -> None:
        """Begin to move freely, if requested."""
        if self._free:
            self._begin(now_ns)
            self._run_free(now_ns)

    def _run_free(self, now_ns: int) -> None:
        self.pass_slots(now_ns)
        then_ns = now_ns + FREE_STEP_NS
        self._line.call_at(then_ns, partial(self._run_free, then_ns))

    # --------------------------------------------------------------------------------- slots

    def pass_slots(self, time_ns: int) -> None:
        """Move all axes to the slot nearest to a time."""
        if self._origin_ns is None:
            return
        slot = (time_ns - self._origin_ns + self._period_ns // 2) // self._period_ns
        while self._slot < slot:
            at_ns = self._origin_ns + self._slot * self._period_ns
            for servo in self.servos:
                servo.pass_slot(at_ns)
            self._slot += 1

    def _begin(self, origin_ns: int) -> None:
        self._origin_ns = origin_ns
        self._slot = 0
        if self._began_ns is not None:
            return
        self._began_ns = origin_ns
        for event in self._events:
            at_ns = origin_ns + round((event.at_s or 0.0) * 1e9)
            self._line.call_at(at_ns, partial(self._happen, event, at_ns))

    def _rest(self) -> None:
        """Hold still once all torque was switched off, until it is on again."""
        if self._free or self._origin_ns is None:
            return
        if not any(servo.torque_on or servo.errors for servo in self.servos):
            self._origin_ns = None

    def _happen(self, event: Event, at_ns: int) -> None:
        self.pass_slots(at_ns)
        if event.kind == "unplug":
            self._line.unplug()
        elif event.kind == "replug":
            self._line.plugged = True
        for servo in self.servos:
            if event.device_id not in (None, servo.device_id):
                continue
            if event.kind in HARDWARE_KINDS:
                servo.fail(HARDWARE_KINDS[event.kind])
            elif event.kind in ("remove", "restore"):
                servo.present = event.kind == "restore"

    def _time_s(self, now_ns: int) -> float:
        return -1.0 if self._began_ns is None else (now_ns - self._began_ns) * 1e-9

    # ------------------------------------------------------------------------------ hearing

    def hear(self, sent: Transmission) -> None:
        """Find the packets in what the host sends; each is dealt with when its last byte is in."""
        gap_ns = sent.start_ns - self._sent_end_ns
        if gap_ns > BURST_GAP_NS:
            self._burst_ns = sent.start_ns
        self._sent_end_ns = sent.end_ns
        for protocol in {servo.protocol for servo in self.servos}:
            parser = self._parsers[protocol]
            if gap_ns > SILENCE_NS:
                parser.reset()
            before = self._fed[protocol]
            self._fed[protocol] += len(sent.data)
            for packet, end in parser.feed(bytes(sent.data)):
                heard = _Heard(packet, protocol, sent, self._burst_ns)
                at_ns = sent.end_of_byte_ns(max(end - before - 1, 0))
                self._line.call_at(at_ns, partial(self._take, heard, at_ns))

    def _take(self, heard: _Heard, now_ns: int) -> None:
        packet, sent = heard.packet, heard.sent
        if sent.garbled or not self._line.plugged:
            return
        listening = [
            servo
            for servo in self.servos
            if servo.protocol == heard.protocol and servo.hears(sent.baud, now_ns)
        ]
        self.pass_slots(heard.begun_ns)
        if not packet.intact:
            self._refuse(listening, packet, now_ns)
            return
        time_s = self._time_s(now_ns)
        able = []
        for servo in listening:
            mine = packet.device_id in (BROADCAST, servo.device_id, servo.second_id)
            if mine and not self._plan.deaf(servo.device_id, time_s):
                servo.listen(now_ns)
                able.append(servo)
        if packet.instruction in EXCHANGES and heard.protocol >= 2.0:
            self._exchange(able, heard, now_ns)
        elif packet.instruction in (p2.SYNC_WRITE, p2.BULK_WRITE):
            self._write_many(able, packet, heard.protocol, now_ns)
        else:
            self._single(able, packet, now_ns)
        self._rest()

    def _refuse(self, listening: list[Servo], packet: Packet, now_ns: int) -> None:
        for servo in listening:
            if servo.device_id == packet.device_id and servo.level == 2:
                self._respond(servo, servo.device_id, Reply(p2.CRC_ERROR), now_ns)

    # --------------------------------------------------------------------------- one servo

    def _single(self, able: list[Servo], packet: Packet, now_ns: int) -> None:
        broadcast = packet.device_id == BROADCAST
        if broadcast and packet.instruction == p2.PING:
            self._ping_all(able, now_ns)
            return
        if broadcast and packet.instruction == p2.READ:
            return
        if broadcast and packet.instruction == p2.FACTORY_RESET and packet.params in (b"", b"\xff"):
            return  # all servos with one id would be lost: they do not (e-manual, 0x06)
        for servo in able:
            own, level, delay_ns = servo.device_id, servo.level, servo.delay_ns
            # Framed as of the request: the write may change id, baud rate or protocol.
            spoken = (servo.baud, servo.protocol)
            reply = execute(servo, packet.instruction, packet.params, now_ns)
            if reply is None or packet.device_id != own or not _wanted(packet.instruction, level):
                continue
            self._respond(servo, own, reply, now_ns + delay_ns, spoken)

    def _ping_all(self, able: list[Servo], now_ns: int) -> None:
        at_ns = now_ns
        for servo in sorted(able, key=lambda one: one.device_id):
            at_ns = self._respond(servo, servo.device_id, servo.ping(), at_ns + servo.delay_ns)

    def _respond(
        self,
        servo: Servo,
        device_id: int,
        reply: Reply,
        at_ns: int,
        spoken: tuple[int, float] | None = None,
    ) -> int:
        """Send a status packet; return when the line is free again if nothing goes wrong."""
        baud, protocol = spoken or (servo.baud, servo.protocol)
        kind = self._plan.response_fault(device_id, self._time_s(at_ns))
        shown = (device_id + 1) % 253 if kind == "wrong_id" else device_id
        whole = servo.frame(shown, reply, protocol)
        data = self._plan.corrupt(kind, whole)
        if data:
            self._line.respond(data, at_ns, baud, self._late_ns if kind == "late" else 0)
        return at_ns + wire_ns(max(len(whole), len(data)), baud)

    # -------------------------------------------------------------------------- many servos

    def _write_many(self, able: list[Servo], packet: Packet, protocol: float, now_ns: int) -> None:
        if packet.device_id != BROADCAST:
            self._single(able, packet._replace(instruction=0), now_ns)
            return
        for device_id, address, data in _writes(packet, protocol):
            for servo in able:
                if device_id in (servo.device_id, servo.second_id):
                    servo.write(address, data, now_ns)

    def _exchange(self, able: list[Servo], heard: _Heard, now_ns: int) -> None:
        packet = heard.packet
        if packet.device_id != BROADCAST:
            self._single(able, packet._replace(instruction=0), now_ns)
            return
        parts = _parts(packet)
        by_id = {servo.device_id: servo for servo in able}
        asked = [by_id[one] for one, _, _ in parts if one in by_id]
        if self._origin_ns is None and asked and all(servo.torque_on for servo in asked):
            self._begin(heard.begun_ns)
        if packet.instruction in (p2.FAST_SYNC_READ, p2.FAST_BULK_READ):
            self._respond_fast(by_id, parts, now_ns)
            return
        at_ns = now_ns
        for device_id, address, length in parts:
            servo = by_id.get(device_id)
            reply = None
            if servo is not None and servo.level >= 1:
                reply = servo.read(address, length, now_ns)
            if servo is None or reply is None:
                # The next one waits as long as the missing response would have taken.
                at_ns += wire_ns(STATUS_BYTES + length, heard.sent.baud)
                continue
            at_ns = self._respond(servo, device_id, reply, at_ns + servo.delay_ns)

    def _respond_fast(self, by_id: dict[int, Servo], parts: list[Part], now_ns: int) -> None:
        """Send the one packet of a fast read; it ends before the first servo that is silent.

        The servos behind it cannot go on: each checksum covers all bytes before.
        """
        pieces: list[tuple[int, int, bytes]] = []
        kinds: list[str] = []
        baud, start_ns = 0, now_ns
        for device_id, address, length in parts:
            servo = by_id.get(device_id)
            if servo is None or servo.level < 1 or servo.firmware < servo.model.fast_firmware:
                break
            reply = servo.read(address, length, now_ns)
            kind = self._plan.response_fault(device_id, self._time_s(now_ns))
            if reply is None or kind == "lost":
                break
            if not pieces:
                baud, start_ns = servo.baud, now_ns + servo.delay_ns
            data = reply.params if len(reply.params) == length else bytes(length)
            shown = (device_id + 1) % 253 if kind == "wrong_id" else device_id
            pieces.append((shown, servo.alert(reply.error), data))
            kinds.append(kind)
        if not pieces:
            return
        total = 1 + sum(4 + length for _, _, length in parts)
        sent = b""
        for kind, piece in zip(kinds, p2.fast_status(pieces, total), strict=True):
            sent += self._plan.corrupt(kind, piece)
            if kind == "truncated":
                break
        self._line.respond(sent, start_ns, baud, self._late_ns if "late" in kinds else 0)


def _wanted(instruction: int, level: int) -> bool:
    """Return whether Status Return Level lets a servo respond to this instruction."""
    if instruction == p2.PING:
        return True
    return level >= (1 if instruction == p2.READ else 2)


def _word(data: bytes, at: int) -> int:
    return data[at] | data[at + 1] << 8


def _parts(packet: Packet) -> list[Part]:
    """Return the address and size that a sync or bulk read wants from each servo."""
    params = packet.params
    if packet.instruction in (p2.SYNC_READ, p2.FAST_SYNC_READ):
        if len(params) < 5:
            return []
        return [(one, _word(params, 0), _word(params, 2)) for one in params[4:]]
    return [
        (params[at], _word(params, at + 1), _word(params, at + 3))
        for at in range(0, len(params) - 4, 5)
    ]


def _writes(packet: Packet, protocol: float) -> list[tuple[int, int, bytes]]:
    """Return what a sync or bulk write writes to whom, as far as it is whole."""
    params = packet.params
    writes = []
    if packet.instruction == p2.SYNC_WRITE:
        wide = 2 if protocol >= 2.0 else 1
        head = 2 * wide
        if len(params) < head:
            return []
        address = int.from_bytes(params[:wide], "little")
        length = int.from_bytes(params[wide:head], "little")
        return [
            (params[at], address, params[at + 1 : at + 1 + length])
            for at in range(head, len(params) - length, length + 1)
        ]
    at = 0
    while protocol >= 2.0 and at + 5 <= len(params):
        length = _word(params, at + 3)
        data = params[at + 5 : at + 5 + length]
        if len(data) == length:
            writes.append((params[at], _word(params, at + 1), data))
        at += 5 + length
    return writes
