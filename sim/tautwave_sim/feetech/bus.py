"""All servos of a line: addressing, answers and their times, and slots.

Packets of the host closer together than 0.1 ms are one exchange, and its time is that of its first
byte: all axes move to that slot, a sync write in it acts at once, a sync read in it reports it. The
axes are held until the first sync read whose servos all have their torque on, and again once all
torque is off.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

from tautwave_sim.feetech import tables as t
from tautwave_sim.feetech.servo import Servo
from tautwave_sim.wire import packets1 as p1
from tautwave_sim.wire.packets1 import Packet
from tautwave_sim.wire.serial import SerialLine, Transmission, wire_ns
from tautwave_sim.wire.serial_faults import LINE_KINDS, Event, FaultPlan

ALL = 0xFE
PING, READ, WRITE, REG_WRITE, ACTION, CALIBRATE = 0x01, 0x02, 0x03, 0x04, 0x05, 0x0B
SYNC_READ, SYNC_WRITE = 0x82, 0x83
SILENCE_NS = 100_000_000
"""A packet begun is given up after this much silence."""
BURST_GAP_NS = 100_000
FREE_STEP_NS = 50_000_000
STATUS_BYTES = 6
ERRORS = {
    "input_voltage": t.VOLTAGE_BIT, "encoder": t.ENCODER_BIT, "overheat": t.HEAT_BIT,
    "over_current": t.CURRENT_BIT, "overload": t.OVERLOAD_BIT,
}  # fmt: skip
MOMENTS = (*ERRORS, "power_cycle", *LINE_KINDS)


class _Heard(NamedTuple):
    """A packet on its way to the servos."""

    packet: Packet
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
        How late a late answer is [ns].
    free : bool
        Move from the beginning on; else from the first exchange with torque on.
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
        self._events = [event for event in events if event.kind in MOMENTS]
        self._period_ns = period_ns
        self._late_ns = late_ns
        self._free = free
        self._origin_ns: int | None = None
        self._began_ns: int | None = None
        self._slot = 0
        self._burst_ns = 0
        self._sent_end_ns = -SILENCE_NS
        self._parser = p1.Parser()
        self._fed = 0
        line.listener = self

    def start(self, now_ns: int) -> None:
        """Begin to move freely, if requested."""
        if self._free:
            self._begin(now_ns)
            self._run_free(now_ns)

    def _run_free(self, now_ns: int) -> None:
        self._pass_slots(now_ns)
        then_ns = now_ns + FREE_STEP_NS
        self._line.call_at(then_ns, partial(self._run_free, then_ns))

    # -- slots --------------------------------------------------------------------------------

    def _pass_slots(self, time_ns: int) -> None:
        if self._origin_ns is None:
            return
        slot = (time_ns - self._origin_ns + self._period_ns // 2) // self._period_ns
        while self._slot < slot:
            for servo in self.servos:
                servo.pass_slot()
            self._slot += 1

    def _begin(self, origin_ns: int) -> None:
        self._origin_ns = origin_ns
        self._slot = 0
        for servo in self.servos:
            servo.free = True
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
        if not any(servo.torque_on for servo in self.servos):
            self._origin_ns = None
            for servo in self.servos:
                servo.free = False

    def _happen(self, event: Event, at_ns: int) -> None:
        self._pass_slots(at_ns)
        if event.kind == "unplug":
            self._line.unplug()
        elif event.kind == "replug":
            self._line.plugged = True
        for servo in self.servos:
            if event.device_id not in (None, servo.device_id):
                continue
            if event.kind in ERRORS:
                servo.fail(ERRORS[event.kind])
            elif event.kind == "power_cycle":
                servo.restart(at_ns)
            elif event.kind in ("remove", "restore"):
                servo.present = event.kind == "restore"

    def _time_s(self, now_ns: int) -> float:
        return -1.0 if self._began_ns is None else (now_ns - self._began_ns) * 1e-9

    # -- hearing ------------------------------------------------------------------------------

    def hear(self, sent: Transmission) -> None:
        """Find the packets in what the host sends; each is dealt with when its last byte is in."""
        gap_ns = sent.start_ns - self._sent_end_ns
        if gap_ns > BURST_GAP_NS:
            self._burst_ns = sent.start_ns
        self._sent_end_ns = sent.end_ns
        if gap_ns > SILENCE_NS:
            self._parser.reset()
        before = self._fed
        self._fed += len(sent.data)
        for packet, end in self._parser.feed(bytes(sent.data)):
            heard = _Heard(packet, sent, self._burst_ns)
            at_ns = sent.end_of_byte_ns(max(end - before - 1, 0))
            self._line.call_at(at_ns, partial(self._take, heard, at_ns))

    def _take(self, heard: _Heard, now_ns: int) -> None:
        packet, sent = heard.packet, heard.sent
        if sent.garbled or not self._line.plugged:
            return
        listening = [servo for servo in self.servos if servo.hears(sent.baud, now_ns)]
        self._pass_slots(heard.begun_ns)
        if not packet.intact:
            return  # a wrong checksum gets no answer
        time_s = self._time_s(now_ns)
        able = [servo for servo in listening if not self._deaf(servo, packet, time_s)]
        if packet.device_id == ALL and packet.instruction == SYNC_READ:
            self._exchange(able, heard, now_ns)
        elif packet.device_id == ALL and packet.instruction == SYNC_WRITE:
            self._write_many(able, packet.params)
        elif packet.device_id == ALL and packet.instruction == PING:
            self._ping_all(able, now_ns)
        else:
            self._single(able, packet, now_ns)
        self._rest()

    def _deaf(self, servo: Servo, packet: Packet, time_s: float) -> bool:
        mine = packet.device_id in (ALL, *servo.obeys)
        return mine and self._plan.deaf(servo.device_id, time_s)

    # -- one servo ----------------------------------------------------------------------------

    def _single(self, able: list[Servo], packet: Packet, now_ns: int) -> None:
        for servo in able:
            if packet.device_id not in (ALL, *servo.obeys):
                continue
            number, delay_ns, baud = servo.device_id, servo.delay_ns, servo.baud
            level = servo.memory[t.LEVEL]
            data = _execute(servo, packet)
            answers = packet.instruction in (PING, READ) or level
            if data is not None and packet.device_id == number and answers:
                self._respond(servo, number, data, now_ns + delay_ns, baud)

    def _ping_all(self, able: list[Servo], now_ns: int) -> None:
        """Each answers in its turn, by its id."""
        at_ns = now_ns
        for servo in sorted(able, key=lambda one: one.device_id):
            begin_ns = at_ns + servo.delay_ns
            at_ns = self._respond(servo, servo.device_id, b"", begin_ns, servo.baud)

    def _respond(self, servo: Servo, number: int, data: bytes, at_ns: int, baud: int) -> int:
        """Send a status packet; return when the line is free again if nothing goes wrong."""
        kind = self._plan.response_fault(number, self._time_s(at_ns))
        shown = (number + 1) % 253 if kind == "wrong_id" else number
        whole = p1.status(shown, servo.status, data)
        sent = self._plan.corrupt(kind, whole)
        if sent:
            self._line.respond(sent, at_ns, baud, self._late_ns if kind == "late" else 0)
        return at_ns + wire_ns(max(len(whole), len(sent)), baud)

    # -- many servos --------------------------------------------------------------------------

    def _write_many(self, able: list[Servo], params: bytes) -> None:
        if len(params) < 2:
            return
        address, size = params[0], params[1]
        for at in range(2, len(params) - size, size + 1):
            for servo in able:
                if params[at] in servo.obeys:
                    servo.write(address, params[at + 1 : at + 1 + size])

    def _exchange(self, able: list[Servo], heard: _Heard, now_ns: int) -> None:
        params = heard.packet.params
        if len(params) < 3:
            return
        address, size, asked = params[0], params[1], params[2:]
        by_id = {servo.device_id: servo for servo in able if servo.model.sync_reads}
        there = [by_id[one] for one in asked if one in by_id]
        if self._origin_ns is None and there and all(servo.torque_on for servo in there):
            self._begin(heard.begun_ns)
        at_ns = now_ns
        for number in asked:
            servo = by_id.get(number)
            data = None if servo is None else servo.read(address, size)
            if servo is None or data is None:
                # The next one waits as long as the missing answer would have taken.
                at_ns += wire_ns(STATUS_BYTES + size, heard.sent.baud)
                continue
            at_ns = self._respond(servo, number, data, at_ns + servo.delay_ns, servo.baud)


def _execute(servo: Servo, packet: Packet) -> bytes | None:
    """Execute an instruction; return the data of its answer, None: it stays silent."""
    instruction, params = packet.instruction, packet.params
    if instruction == PING:
        return b""
    if instruction == READ:
        return servo.read(params[0], params[1]) if len(params) == 2 else None
    if instruction == WRITE and len(params) >= 2:
        servo.write(params[0], params[1:])
        return b""
    if instruction == REG_WRITE and len(params) >= 2:
        servo.registered = (params[0], params[1:])
        return b""
    if instruction == ACTION:
        held, servo.registered = servo.registered, None
        if held is not None:
            servo.write(*held)
        return b""
    if instruction == CALIBRATE and len(params) == 2:
        servo.calibrate(int.from_bytes(params, "little"))
        return b""
    return None
