"""All drives of a bus, and the slots in which their motors move.

A drive begins to move with the first request that finds it on and writes a command: that is slot 0,
a sample is taken in it, and the command acts from it on. From then on the slot of a request that
writes a command is the nearest whole number of periods since that first one, so that each drive may
have commands at a phase of its own; what only reads belongs to the slot of the last command, unless
whole periods have passed since. The first request in a new slot, to whichever drive, makes all of
them pass it and sample at the same time. A request counts with its first byte.
"""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.contracts import BusSpec
from tautwave.errors import ConfigError
from tautwave.truth import AxisModel
from tautwave_sim.modbus.drive import Drive
from tautwave_sim.modbus.faults import FaultPlan, Outcome
from tautwave_sim.modbus.options import LINK_FAULTS, Quirks, SimulatedModbusOptions
from tautwave_sim.modbus.registers import Refusal
from tautwave_sim.modbus.wire.protocol import READS, Request, exception, parse, respond

BROADCAST = 0


class DriveBus:
    """The drives by unit, one per axis.

    Parameters
    ----------
    options : SimulatedModbusOptions
        Of the bus.
    bus : BusSpec
        Its axes.
    truths : sequence of AxisModel
        One per axis.
    """

    def __init__(
        self, options: SimulatedModbusOptions, bus: BusSpec, truths: Sequence[AxisModel]
    ) -> None:
        self.plan = FaultPlan(options.simulator.faults)
        devices = {device.unit: device for device in options.devices}
        unknown = sorted(set(options.simulator.devices) - set(devices))
        if unknown:
            raise ConfigError(
                f"{bus.name}: simulator.devices names unit {unknown[0]}, not a device"
            )
        for event in options.simulator.faults.events:
            if event.unit is not None and event.unit not in devices:
                raise ConfigError(
                    f"{bus.name}: simulator.faults: {event.kind} is for unit {event.unit}, not a "
                    "device"
                )
            if event.kind in LINK_FAULTS and (event.kind == "unplugged") != (options.link == "rtu"):
                raise ConfigError(
                    f"{bus.name}: simulator.faults: {event.kind} does not apply to "
                    f"{options.link}; rtu can be unplugged, tcp reset, refused, half_open or gone"
                )
        self.drives: dict[int, Drive] = {}
        for spec, truth in zip(bus.axes, truths, strict=True):
            if spec.device_id not in devices:
                raise ConfigError(
                    f"{bus.name}: axis {spec.name} is unit {spec.device_id}, which is not among "
                    "the bus' devices; add it to options.devices"
                )
            quirks = options.simulator.devices.get(spec.device_id, Quirks())
            self.drives[spec.device_id] = Drive(
                devices[spec.device_id], quirks, spec.name, spec.kind, truth
            )
        self._period_ns = round(truths[0].period * 1e9) if truths else bus.period_ns
        turnaround_s = options.turnaround_s or 0.0
        self._response_ns = {
            unit: round(
                1e9 * _first(options.simulator.devices.get(unit, Quirks()).answer_s, turnaround_s)
            )
            for unit in self.drives
        }
        self._slot = 0
        self._began_ns: int | None = None

    def response_ns(self, unit: int) -> int:
        """Return how long a drive takes from the end of a request to its response [ns]."""
        return self._response_ns[unit]

    def elapsed_ns(self, now_ns: int) -> int | None:
        """Return the time since the drives began to move; None before."""
        return None if self._began_ns is None else now_ns - self._began_ns

    def latch(self, unit: int, pdu: bytes, now_ns: int) -> None:
        """Note a request's first byte: a slot may have begun."""
        drive = self.drives.get(unit)
        if drive is None:
            return
        request = self._parsed(drive, pdu)
        commanding = request is not None and drive.commanded_by(request)
        if drive.origin_ns is not None:
            if commanding:
                since = now_ns - drive.origin_ns
                slot = drive.base + (since + self._period_ns // 2) // self._period_ns
                drive.reported_ns, drive.reported_slot = now_ns, slot
            else:
                slot = drive.reported_slot + (now_ns - drive.reported_ns) // self._period_ns
            self._pass(slot, now_ns)
        drive.settle(now_ns)
        if drive.origin_ns is None and (drive.motor.axis.in_hand or (drive.on and commanding)):
            drive.origin_ns = drive.reported_ns = now_ns
            drive.base = drive.reported_slot = self._slot
            drive.motor.free = True
            drive.latch()
            if self._began_ns is None:
                self._began_ns = now_ns

    def _parsed(self, drive: Drive, pdu: bytes) -> Request | None:
        try:
            return parse(pdu, drive.functions)
        except Refusal:
            return None

    def _pass(self, slot: int, now_ns: int) -> None:
        moving = [drive for drive in self.drives.values() if drive.origin_ns is not None]
        if slot <= self._slot:
            return
        for number in range(self._slot, slot):
            for drive in moving:
                if drive.origin_ns is not None:
                    # What happens in the second half of a slot counts from the next one on.
                    halves = 2 * (number - drive.base) + 1
                    drive.settle(min(drive.origin_ns + halves * self._period_ns // 2, now_ns))
                    drive.pass_slot()
        self._slot = slot
        for drive in moving:
            drive.latch()

    def handle(self, unit: int, pdu: bytes, now_ns: int) -> tuple[bytes | None, Outcome]:
        """Take a complete request; return the response or None, and the outcome."""
        elapsed_ns = self.elapsed_ns(now_ns)
        outcome = self.plan.request(unit, elapsed_ns)
        if outcome.lost:
            return None, outcome
        if unit == BROADCAST and BROADCAST not in self.drives:
            for drive in self.drives.values():
                drive.hear(now_ns)
                request = self._parsed(drive, pdu)
                if request is not None and request.function not in READS:
                    respond(drive, pdu)
            return None, outcome
        addressed = self.drives.get(unit)
        if addressed is None:
            return None, outcome
        addressed.hear(now_ns)
        for kind, code in self.plan.drive_events(unit, elapsed_ns):
            addressed.inject(kind, code)
        if outcome.code is not None:
            return exception(pdu, outcome.code), outcome
        response = respond(addressed, pdu)
        request = self._parsed(addressed, pdu)
        missing = (
            not addressed.motor.valid and request is not None and addressed.shows_position(request)
        )
        return None if missing or outcome.unanswered else response, outcome


def _first(value: float | None, otherwise: float) -> float:
    return otherwise if value is None else value
