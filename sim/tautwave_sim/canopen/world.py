"""Simulated drives on one CAN bus: its wire, the nodes on it, and the slots their motors move on.

The slots are those of the bus' period. A SYNC latches: at its arrival all axes move to the slot
nearest to it, are measured there, and what was received before it acts from that slot on. What
does not wait for SYNC (an asynchronous RPDO, an SDO, a watchdog) acts within the slot. The slots
begin with the first SYNC after every operational drive has reported that it is enabled; until then
the axes are held. Without SYNC they begin when a drive is enabled.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from tautwave.contracts import BusSpec
from tautwave.truth import AxisModel
from tautwave_sim.axis import SimulatedAxis
from tautwave_sim.canopen.device import Device, Nmt
from tautwave_sim.canopen.motor import Motor, motor_scale
from tautwave_sim.canopen.options import NodeKeys, Quirks, SimulatedCanopenOptions
from tautwave_sim.cia402 import State
from tautwave_sim.wire.can_medium import MediumPort
from tautwave_sim.wire.can_world import CanWorld, Planned, listed, wire_of


class DriveBus(CanWorld):
    """A CAN bus with drives on it.

    Parameters
    ----------
    options : SimulatedCanopenOptions
        The bus and its nodes.
    bus : BusSpec
        Axes and rate.
    truths : sequence of AxisModel
        One per axis.
    now_ns : int
        When everything is switched on.
    """

    def __init__(
        self,
        options: SimulatedCanopenOptions,
        bus: BusSpec,
        truths: Sequence[AxisModel],
        now_ns: int,
    ) -> None:
        timing, plan = wire_of(options, truths)
        super().__init__(timing, plan, bus.period_ns, now_ns)
        self._sync = options.sync
        self._free = options.simulator.free or not options.sync
        self.devices: list[Device] = []
        self.axes: list[SimulatedAxis] = []
        self._motors: list[Motor] = []
        self._ports: list[MediumPort] = []
        self._stale: set[int] = set()
        self._events: list[int | None] = []
        self._braking: list[bool] = []
        self._next_ns: int | None = None
        known = listed(bus, "nodes", {node.id: node for node in options.nodes})
        for spec, node, truth in zip(bus.axes, known, truths, strict=True):
            motor = Motor(spec.name, truth, motor_scale(node, spec.kind, truth))
            quirks = options.simulator.nodes.get(node.id, Quirks())
            self._attach(node, motor, quirks, now_ns)

    def _attach(self, node: NodeKeys, motor: Motor, quirks: Quirks, now_ns: int) -> None:
        at = len(self.devices)
        port = self.medium.port(lambda t_ns, can_id, data: self._hear(at, t_ns, can_id, data))
        device = Device(node, quirks, motor, port.send)
        self._ports.append(port)
        self.devices.append(device)
        self._motors.append(motor)
        self.axes.append(motor.axis)
        device.power_on(now_ns)
        self._stale.add(at)
        self._events.append(None)
        self._braking.append(False)
        self._befalls(at, _planned_faults(device, quirks))

    # -- events ---------------------------------------------------------------------------

    def _device_event_ns(self) -> int | None:
        if self._stale:
            for at in self._stale:
                device = self.devices[at]
                self._events[at] = device.next_event_ns()
                self._braking[at] = device.drive.braking
            self._stale.clear()
            known = [time for time in self._events if time is not None]
            self._next_ns = min(known, default=None)
        times = (self._tick_ns(), self._next_ns)
        return min((time for time in times if time is not None), default=None)

    def _tick_ns(self) -> int | None:
        if self._origin_ns is None or not (self._free or any(self._braking)):
            return None
        return self._origin_ns + (self._slot + 1) * self._period_ns

    def _step(self, at_ns: int) -> None:
        super()._step(at_ns)
        self._begin_if_free(at_ns)

    def _run(self, at_ns: int) -> None:
        self._stale.update(range(len(self.devices)))
        tick_ns = self._tick_ns()
        if tick_ns is not None and tick_ns <= at_ns and self._origin_ns is not None:
            self._pass_to((at_ns - self._origin_ns) // self._period_ns)
        for at, device in enumerate(self.devices):
            device.run(at_ns)
            self._act(at, at_ns)

    # -- slots ----------------------------------------------------------------------------

    def _begin_if_free(self, now_ns: int) -> None:
        if self._free and self._origin_ns is None and self._some_enabled():
            self._begin(now_ns)

    def _some_enabled(self) -> bool:
        """Return whether a drive is enabled, and has said so where it sends by its own timer."""
        return any(
            device.drive.machine.state is State.ENABLED
            and (self._sync or device.drive.reported_enabled)
            for device in self.devices
        )

    def _begin(self, now_ns: int) -> None:
        self._origin_ns = now_ns
        self._slot = 0
        self._begin_slot()

    def _begin_slot(self) -> None:
        for device, motor in zip(self.devices, self._motors, strict=True):
            if device.drive.machine.state is State.ENABLED or motor.axis.in_hand:
                motor.free = True
            device.drive.begin_slot(self._slot)

    def _pass_to(self, slot: int) -> None:
        while self._slot < slot:
            for motor in self._motors:
                motor.pass_slot()
            self._slot += 1
            self._begin_slot()

    def _latch(self, now_ns: int) -> None:
        """Bring all axes to the slot of a SYNC."""
        if self._origin_ns is not None:
            since = now_ns - self._origin_ns
            self._pass_to((since + self._period_ns // 2) // self._period_ns)
            return
        working = [device for device in self.devices if device.nmt is Nmt.OPERATIONAL]
        in_hand = any(motor.axis.in_hand for motor in self._motors)
        if in_hand or (working and all(device.drive.reported_enabled for device in working)):
            self._begin(now_ns)

    def _act(self, at: int, now_ns: int) -> None:
        """Apply what a device received or did between two latches."""
        drive = self.devices[at].drive
        if not drive.changed or self._origin_ns is None:
            return
        since = now_ns - self._origin_ns
        self._pass_to(since // self._period_ns)
        self._motors[at].share = (since - self._slot * self._period_ns) / self._period_ns
        drive.begin_slot(self._slot)

    def _hear(self, at: int, now_ns: int, can_id: int, data: bytes) -> None:
        device = self.devices[at]
        self._stale.add(at)
        if not device.hears_sync(can_id):
            device.receive(now_ns, can_id, data)
            self._act(at, now_ns)
            return
        self._latch(now_ns)
        device.sync(now_ns)
        if self._origin_ns is not None:
            self._motors[at].share = 0.0
            device.drive.begin_slot(self._slot)
        device.on_sync()


def _planned_faults(device: Device, quirks: Quirks) -> list[Planned]:
    """Return the faults planned for a device, each with its time [s]."""

    def stop_beating(now_ns: int) -> None:
        device.beats = False

    def fall_silent(now_ns: int) -> None:
        device.silent = True
        device.drive.lose_voltage()

    def reset(now_ns: int) -> None:
        device.power_on(now_ns, quirks.boot_ms * 1_000_000)

    def lose_voltage(now_ns: int) -> None:
        device.drive.lose_voltage()

    def fail(now_ns: int) -> None:
        device.drive.fail(quirks.fault_code)

    def lose_mode(now_ns: int) -> None:
        device.drive.lose_mode()

    def warn(now_ns: int) -> None:
        device.emergency(quirks.fault_code, 0x01)

    def switch(value: int, now_ns: int) -> None:
        device.drive.inputs = value

    return [
        (quirks.heartbeat_lost_at_s, stop_beating),
        (quirks.silent_at_s, fall_silent),
        (quirks.resets_at_s, reset),
        (quirks.voltage_off_at_s, lose_voltage),
        (quirks.fault_at_s, fail),
        (quirks.mode_lost_at_s, lose_mode),
        (quirks.emergency_at_s, warn),
        *((at_s, partial(switch, value)) for at_s, value in quirks.inputs),
    ]
