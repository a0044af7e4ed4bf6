"""The CANopen side of a drive: NMT, SDO, PDO, SYNC, heartbeat, EMCY (CiA 301 v4.2.0)."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from fractions import Fraction

from tautwave.registry import load_driver
from tautwave_sim.canopen.described import follow
from tautwave_sim.canopen.dictionary import (
    NOT_STORED,
    TOO_LOW,
    WRONG_VALUE,
    Entry,
    SdoAbort,
)
from tautwave_sim.canopen.drive import Drive
from tautwave_sim.canopen.motor import Motor
from tautwave_sim.canopen.objects import INVALID, LOAD, PDOS, SAVE, build
from tautwave_sim.canopen.options import NodeKeys, Quirks
from tautwave_sim.canopen.pdo import Rpdo, Tpdo
from tautwave_sim.canopen.sdo import SdoServer
from tautwave_sim.cia402 import State

HEARTBEAT_LOST, RPDO_LATE = 0x8130, 0x8250
PDO_TOO_SHORT = 0x8210
GENERIC, COMMUNICATION = 0x01, 0x10
"""Bits of the error register 1001h."""
HISTORY = 8
MAXON = 0xFB
NEVER_SAVED = (0x1003, 0x6040, 0x6060, 0x6071, 0x607A, 0x60B0, 0x60B1, 0x60B2, 0x60FF)
MS = 1_000_000
_WRITTEN = (0x60, 0x20, 0x30)
"""Responses to a download, or to a segment of one."""


class Nmt(IntEnum):
    """States as in a heartbeat."""

    INITIALISING = 0
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127


class Device:
    """One node on the bus.

    Parameters
    ----------
    node : NodeKeys
        Its id, identity and motor data.
    quirks : Quirks
        How it misbehaves.
    motor : Motor
        What it moves.
    send : callable
        Sends a frame on the bus.
    """

    def __init__(
        self,
        node: NodeKeys,
        quirks: Quirks,
        motor: Motor,
        send: Callable[[int, bytes], object],
    ) -> None:
        self.id = node.id
        self.objects = build(node.id, quirks)
        self.nmt = Nmt.INITIALISING
        self.silent = False
        self.beats = True
        """Whether it still sends heartbeats."""
        self._quirks = quirks
        self._send = send
        self._now_ns = 0
        self._boot_ns: int | None = None
        self._beat_ns: int | None = None
        self._watched: dict[int, tuple[int, int | None]] = {}
        self._lost: set[int] = set()
        self.drive = Drive(self.objects, motor, quirks, self._drive_error)
        self._sdo = SdoServer(self.objects)

        def configurable() -> bool:
            return self.nmt is Nmt.PRE_OPERATIONAL

        self.rpdos = [Rpdo(self.objects, 0x1400 + n, configurable) for n in range(PDOS)]
        self.tpdos = [Tpdo(self.objects, 0x1800 + n, configurable) for n in range(PDOS)]
        self._wire(node)
        self._scale(node)
        if node.eds is not None:
            self._follow(node, node.eds)
        self.objects.restore()

    def _follow(self, node: NodeKeys, path: str) -> None:
        """Be the drive of the file that the rig names for it."""
        contents = load_driver("canopen").contents
        assert contents is not None
        modes = follow(self.objects, contents(path, node.id), identified=node.identity is not None)
        if modes is not None:
            self.drive.support(modes)

    def _scale(self, node: NodeKeys) -> None:
        """Show in the factor group what the motor is built from (CiA 402-2, 6076h to 6092h)."""
        gear = Fraction(node.gear_ratio).limit_denominator(1_000_000)
        milli = node.rated_torque * 1e3
        micro = node.rated_torque_unit == "uN m" or (
            node.rated_torque_unit is None
            and node.identity is not None
            and node.identity.vendor == MAXON
        )  # mN m by the standard, uN m on an EPOS4
        if node.torque_constant is not None:
            milli /= node.torque_constant  # a current, in mA
        rated = max(1, round(1e3 * milli if micro else milli))
        turn = round(node.counts_per_revolution * node.gear_ratio)
        for index, sub, value in (
            (0x6076, 0, rated),
            (0x608F, 1, node.counts_per_revolution),
            (0x6091, 1, gear.numerator),
            (0x6091, 2, gear.denominator),
            (0x6092, 1, turn),
        ):
            self.objects.add(index, sub, Entry("U32", "rw", value))

    def _wire(self, node: NodeKeys) -> None:
        objects = self.objects
        sensor = node.effort_sensor
        if sensor is not None:
            at = sensor.index, sensor.subindex
            if sensor.subindex:
                objects.add(sensor.index, 0, Entry("U8", "ro", sensor.subindex))
            objects.add(*at, Entry("I16", "ro", 0, "t"))
            objects.readers[at] = lambda: self.drive.motor.sensor_counts(sensor.effort, sensor.zero)
        identity = node.identity
        words = (0, 0, None, None) if identity is None else tuple(identity.model_dump().values())
        known = dict(zip(("vendor", "product", "revision", "serial"), words, strict=True))
        product = known["product"] if self._quirks.identity is None else self._quirks.identity
        serial = self.id if known["serial"] is None else known["serial"]
        for sub, word in enumerate((known["vendor"], product, known["revision"], serial), start=1):
            objects.add(0x1018, sub, Entry("U32", "ro", word or 0))
        writers = objects.writers
        writers[0x1003, 0] = self._clear_history
        writers[0x1005, 0] = self._take_sync_id
        writers[0x1010, 1] = self._save
        writers[0x1011, 1] = self._load
        writers[0x1014, 0] = self._take_emergency_id
        writers[0x1017, 0] = self._take_heartbeat
        objects.readers[0x1010, 1] = objects.readers[0x1011, 1] = lambda: 1
        for sub in range(1, 5):
            if (0x1016, sub) in objects:
                writers[0x1016, sub] = self._consumer(sub)
                if self._quirks.ignores_heartbeat_consumer:
                    objects.readers[0x1016, sub] = lambda: 0

    # -- power and NMT --------------------------------------------------------------------

    def power_on(self, now_ns: int, delay_ns: int = 0) -> None:
        """Begin with everything at its default; the boot-up frame follows after `delay_ns`."""
        self._now_ns = now_ns
        self.drive.at(now_ns)
        self.objects.restore()
        self.drive.restart()
        self._restart_communication(now_ns, delay_ns)

    def _restart_communication(self, now_ns: int, delay_ns: int) -> None:
        self.nmt = Nmt.INITIALISING
        self.objects.restore(0x1000, 0x1FFF)
        self._sdo.reset()
        for pdo in (*self.rpdos, *self.tpdos):
            pdo.load()
            pdo.begin()
        self._beat_ns = None
        self._watched.clear()
        self._lost.clear()
        self._boot_ns = now_ns + delay_ns

    def _command(self, command: int) -> None:
        if command == 1:
            self._enter(Nmt.OPERATIONAL)
        elif command == 2:
            self._enter(Nmt.STOPPED)
        elif command == 128:
            self._enter(Nmt.PRE_OPERATIONAL)
        elif command == 129:
            self.power_on(self._now_ns, self._quirks.boot_ms * MS)
        elif command == 130:
            self.drive.machine.drop()
            self._restart_communication(self._now_ns, self._quirks.boot_ms * MS)

    def _enter(self, state: Nmt) -> None:
        if self.nmt is state:
            return
        was, self.nmt = self.nmt, state
        for pdo in (*self.rpdos, *self.tpdos):
            pdo.begin()
        if was is Nmt.OPERATIONAL:
            self.drive.lose_master()  # no set-point can come any more

    # -- time -----------------------------------------------------------------------------

    def next_event_ns(self) -> int | None:
        """Return when it does something by itself."""
        if self.silent:
            return None
        times = [self._boot_ns, self._beat_ns, self.drive.next_event_ns()]
        times += [deadline for _, deadline in self._watched.values()]
        if self.nmt is Nmt.OPERATIONAL:
            times += [rpdo.deadline_ns for rpdo in self.rpdos if rpdo.valid]
            times += [tpdo.next_event_ns() for tpdo in self.tpdos]
        return min((time for time in times if time is not None), default=None)

    def run(self, now_ns: int) -> None:
        """Do what is due by `now_ns`."""
        self._now_ns = now_ns
        self.drive.at(now_ns)
        if self.silent:
            return
        if self._boot_ns is not None and now_ns >= self._boot_ns:
            self._boot_ns = None
            self.nmt = Nmt.PRE_OPERATIONAL
            self._send(0x700 + self.id, b"\0")
        if self._beat_ns is not None and now_ns >= self._beat_ns:
            self._beat_ns += self.objects.number(0x1017) * MS
            if self._beat_ns <= now_ns:
                self._beat_ns = now_ns + self.objects.number(0x1017) * MS
            if self.beats:
                self._send(0x700 + self.id, bytes([self.nmt]))
        for producer, (span_ns, deadline_ns) in list(self._watched.items()):
            if deadline_ns is not None and now_ns >= deadline_ns:
                self._watched[producer] = (span_ns, None)
                self._lost.add(producer)
                self._lose_connection(HEARTBEAT_LOST)
        if self.nmt is Nmt.OPERATIONAL:
            for rpdo in self.rpdos:
                if rpdo.valid and rpdo.deadline_ns is not None and now_ns >= rpdo.deadline_ns:
                    rpdo.deadline_ns = None
                    self._lose_connection(RPDO_LATE)
            self.send_changes()

    def send_changes(self) -> None:
        """Send the TPDOs whose content has changed, or whose time is over."""
        if self.nmt is not Nmt.OPERATIONAL or self.silent:
            return
        for tpdo in self.tpdos:
            data = tpdo.at_event(self._now_ns)
            if data is not None:
                self._send_pdo(tpdo, data)

    def _send_pdo(self, tpdo: Tpdo, data: bytes) -> None:
        if tpdo.carries(0x6041):
            self._note_reported()
        self._send(tpdo.cob_id, data)

    def _note_reported(self) -> None:
        if self.drive.machine.state is State.ENABLED:
            self.drive.reported_enabled = True

    # -- frames ---------------------------------------------------------------------------

    def hears_sync(self, can_id: int) -> bool:
        """Return whether this frame is a SYNC that it acts on."""
        if self.nmt is not Nmt.OPERATIONAL or self.silent:
            return False
        return can_id == self.objects.number(0x1005) & 0x7FF

    def receive(self, now_ns: int, can_id: int, data: bytes) -> None:
        """Take any frame but SYNC; malformed ones have no effect."""
        if self.silent:
            return
        self._now_ns = now_ns
        self.drive.at(now_ns)
        if can_id == 0:
            if len(data) == 2 and data[1] in (0, self.id) and self.nmt is not Nmt.INITIALISING:
                self._command(data[0])
        elif can_id == 0x600 + self.id:
            self._respond_sdo(data)
        elif 0x700 < can_id < 0x780:
            self._hear_heartbeat(can_id - 0x700)
        elif self.nmt is Nmt.OPERATIONAL:
            for rpdo in self.rpdos:
                if rpdo.valid and rpdo.cob_id == can_id:
                    self._receive_pdo(rpdo, data)
        self.send_changes()

    def _respond_sdo(self, data: bytes) -> None:
        if self.nmt not in (Nmt.PRE_OPERATIONAL, Nmt.OPERATIONAL):
            return
        response = self._sdo.respond(data)
        if response is None:
            return
        self.drive.changed = self.drive.changed or response[0] in _WRITTEN
        if response[1:4] == b"\x41\x60\x00" and response[0] & 0xE0 == 0x40:
            self._note_reported()
        self._send(0x580 + self.id, response)

    def _receive_pdo(self, rpdo: Rpdo, data: bytes) -> None:
        if len(data) < rpdo.size:
            self.emergency(PDO_TOO_SHORT, GENERIC | COMMUNICATION)
            return
        if rpdo.receive(self._now_ns, data):
            rpdo.act()
            self.drive.changed = True

    def sync(self, now_ns: int) -> None:
        """Take a SYNC: received RPDOs act, and samples are sent."""
        self._now_ns = now_ns
        self.drive.at(now_ns)
        for rpdo in self.rpdos:
            if rpdo.valid:
                rpdo.act()
        self.drive.at(now_ns)

    def on_sync(self) -> None:
        """Send the TPDOs of this SYNC."""
        for tpdo in self.tpdos:
            data = tpdo.at_sync()
            if data is not None and self.drive.motor.valid:
                self._send_pdo(tpdo, data)
        self.send_changes()

    # -- heartbeat and errors -------------------------------------------------------------

    def _hear_heartbeat(self, producer: int) -> None:
        if producer in self._watched:
            span_ns, _ = self._watched[producer]
            self._watched[producer] = (span_ns, self._now_ns + span_ns)
            if producer in self._lost:
                self._lost.discard(producer)
                if not self._lost:
                    self.emergency(0, 0)

    def _lose_connection(self, code: int) -> None:
        self.emergency(code, GENERIC | COMMUNICATION)
        if self.objects.number(0x6007) == 1:
            self.objects.set(0x603F, 0, code)
        self.drive.lose_master()
        reaction = self.objects.number(0x1029, 1)
        if reaction != 1 and self.nmt is Nmt.OPERATIONAL:
            self.nmt = Nmt.STOPPED if reaction == 2 else Nmt.PRE_OPERATIONAL

    def _drive_error(self, code: int) -> None:
        self.emergency(code, GENERIC if code else 0)

    def emergency(self, code: int, register: int, vendor: bytes = b"") -> None:
        """Send an EMCY and keep it in 1001h and 1003h."""
        self.objects.set(0x1001, 0, register)
        if code:
            self._remember(code)
        cob_id = self.objects.number(0x1014)
        if not cob_id & INVALID and self.nmt in (Nmt.PRE_OPERATIONAL, Nmt.OPERATIONAL):
            frame = code.to_bytes(2, "little") + bytes([register]) + vendor.ljust(5, b"\0")
            self._send(cob_id & 0x7FF, frame)

    def _remember(self, code: int) -> None:
        objects = self.objects
        count = min(objects.number(0x1003) + 1, HISTORY)
        for sub in range(count, 0, -1):
            newer = code if sub == 1 else objects.number(0x1003, sub - 1)
            if (0x1003, sub) not in objects:
                objects.add(0x1003, sub, Entry("U32", "ro", 0))
            objects.set(0x1003, sub, newer)
        objects.set(0x1003, 0, count)

    def _clear_history(self, count: int) -> None:
        if count != 0:
            raise SdoAbort(WRONG_VALUE)
        for sub in range(1, HISTORY + 1):
            self.objects.remove(0x1003, sub)

    # -- objects of the communication area ------------------------------------------------

    def _take_sync_id(self, value: int) -> None:
        if value & 0x40000000 or value & 0x7FF > 0x80 or not value & 0x7FF:
            raise SdoAbort(WRONG_VALUE)  # it produces no SYNC itself

    def _take_emergency_id(self, value: int) -> None:
        if not value & INVALID and not 0x80 < value & 0x7FF <= 0xFF:
            raise SdoAbort(WRONG_VALUE)

    def _take_heartbeat(self, span_ms: int) -> None:
        self._beat_ns = self._now_ns + span_ms * MS if span_ms else None

    def _consumer(self, sub: int) -> Callable[[int], None]:
        return lambda word: self._take_consumer(sub, word)

    def _take_consumer(self, sub: int, word: int) -> None:
        if self._quirks.ignores_heartbeat_consumer:
            return
        producer, span_ms = word >> 16 & 0x7F, word & 0xFFFF
        if 0 < span_ms < self._quirks.least_heartbeat_ms:
            raise SdoAbort(TOO_LOW)
        old = self.objects.number(0x1016, sub) >> 16 & 0x7F
        self._watched.pop(old, None)
        if producer and span_ms:
            self._watched[producer] = (span_ms * MS, None)

    def _save(self, word: int) -> None:
        if word != SAVE:
            raise SdoAbort(NOT_STORED)
        self.objects.save(NEVER_SAVED)

    def _load(self, word: int) -> None:
        if word != LOAD:
            raise SdoAbort(NOT_STORED)
        self.objects.forget()
