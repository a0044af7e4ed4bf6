"""The servos of a bus, built from its options: in this process, or served on a pseudo-terminal."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from tautwave.contracts import AxisSpec, Bench, BusSpec, Clock
from tautwave.errors import ConfigError
from tautwave.truth import AxisModel
from tautwave_sim.axis import SimulatedAxis
from tautwave_sim.bench import free_axis, require_distinct
from tautwave_sim.dynamixel.bus import ServoBus
from tautwave_sim.dynamixel.items import Model
from tautwave_sim.dynamixel.memory import Memory
from tautwave_sim.dynamixel.models import find_model
from tautwave_sim.dynamixel.motor import LOAD_UNIT, REV_PER_MIN, Heat, Joint
from tautwave_sim.dynamixel.options import (
    BenchOptions,
    DynamixelOptions,
    FaultOptions,
    ServoOptions,
    ServoQuirks,
    ShadowOptions,
    SimulatorOptions,
)
from tautwave_sim.dynamixel.servo import Servo, Shadow
from tautwave_sim.wire.serial import MemoryPort, SerialLine
from tautwave_sim.wire.serial_world import (
    LineWorld,
    bench_faults,
    is_served,
    planned,
    serve_world,
    slot_ns,
)

DELAY_UNIT_S = 2e-6
BENCH_PERIOD_S = 1e-3


class ServoWorld(LineWorld):
    """The simulated servos of one bus, and the host's end of their line.

    Parameters
    ----------
    options : DynamixelOptions
        Of the bus.
    bus : BusSpec
        Its axes.
    truths : sequence of AxisModel
        What is true of each.
    clock : Clock
        Of the host.
    free : bool
        Move from the beginning on; else from the first exchange that finds the torque on.
    """

    def __init__(
        self,
        options: DynamixelOptions,
        bus: BusSpec,
        truths: Sequence[AxisModel],
        clock: Clock,
        free: bool = False,
    ) -> None:
        self.axes = [
            SimulatedAxis(spec.name, one) for spec, one in zip(bus.axes, truths, strict=True)
        ]
        self.line = SerialLine(options.baud, round((options.usb_latency_s or 0.0) * 1e9))
        self.servos = [
            _servo(options, spec, axis, truth)
            for spec, axis, truth in zip(bus.axes, self.axes, truths, strict=True)
        ]
        for servo, truth in zip(list(self.servos), truths, strict=True):
            given = next(one for one in options.servos if one.id == servo.memory.peek("ID"))
            if given.shadow is not None:
                self.servos.append(_shadow(options, given.shadow, servo, truth))
        faults = options.simulator.faults
        plan, events = planned(bus.name, faults)
        self.bus = ServoBus(
            self.line,
            self.servos,
            plan,
            events,
            slot_ns(truths),
            round(faults.late_s * 1e9),
            free,
        )
        self.transport = MemoryPort(self.line, clock, f"bus {bus.name}")
        self.bus.start(clock.now_ns())


def _servo(
    options: DynamixelOptions, spec: AxisSpec, axis: SimulatedAxis, truth: AxisModel
) -> Servo:
    given = next((one for one in options.servos if one.id == spec.device_id), None)
    if given is None:
        raise ConfigError(
            f"{spec.name}: there is no servo with id {spec.device_id}; add it to options.servos"
        )
    quirks = options.simulator.servos.get(given.id, ServoQuirks())
    model = find_model(quirks.model or given.model, quirks.firmware)
    registers = _registers(options, given, model, spec) | quirks.registers
    if quirks.firmware is not None:
        registers.setdefault("Firmware Version", quirks.firmware)
    joint = _joint(given, model)
    memory = Memory(model, registers)
    servo = Servo(model, memory, axis, truth, joint, round(quirks.reboot_s * 1e9))
    motor = servo.motor
    motor.heat = Heat(rise_k=quirks.rise_k, time_s=quirks.heating_s)
    motor.temperature_c = motor.heat.ambient_c
    if quirks.temperature_c is not None:
        motor.temperature_c = quirks.temperature_c
    if quirks.voltage is not None:
        motor.voltage = quirks.voltage
    motor.overload_share = quirks.overload_share
    motor.overload_s = quirks.overload_s
    return servo


def _shadow(
    options: DynamixelOptions, given: ShadowOptions, first: Servo, truth: AxisModel
) -> Shadow:
    """Return the second servo of a joint, set as the first but for its id and what turns it."""
    names = ("Baud Rate", "Return Delay Time", "Operating Mode", "Current Limit")
    memory = first.memory
    registers = {name: memory.peek(name) for name in names if memory.has(name)}
    registers |= {"ID": given.id, "Homing Offset": given.homing_offset}
    registers["Secondary(Shadow) ID"] = first.device_id
    if memory.has("Drive Mode"):
        registers["Drive Mode"] = memory.peek("Drive Mode") ^ int(given.opposite)
    quirks = options.simulator.servos.get(given.id, ServoQuirks())
    return Shadow(first, Memory(first.model, registers | quirks.registers), truth)


def _registers(
    options: DynamixelOptions, given: ServoOptions, model: Model, spec: AxisSpec
) -> dict[str, int]:
    """Return the settings made before: id and baud rate, and what the rig needs."""
    registers = {"ID": given.id}
    for code, baud in model.bauds:
        if abs(baud - options.baud) < 0.03 * options.baud:
            registers["Baud Rate"] = code
    if "Baud Rate" not in registers:
        fits = ", ".join(str(baud) for _, baud in model.bauds)
        raise ConfigError(f"{spec.name}: a {model.name} has no {options.baud} baud; it has {fits}")
    if options.simulator.factory:
        return registers
    registers["Return Delay Time"] = round(options.return_delay_s / DELAY_UNIT_S)
    if given.homing_offset:
        registers["Homing Offset"] = given.homing_offset
    if given.reverse_mode:
        registers["Drive Mode"] = 1
    if model.protocol >= 2.0:
        current = any(item.name == "Goal Current" for item in model.items)
        impedance = spec.causality == "impedance" and current
        registers["Operating Mode"] = 0 if impedance else 1
        if spec.takes_position:
            registers["Operating Mode"] = 5 if current else 3
        if given.current_limit is not None and current:
            registers["Current Limit"] = round(given.current_limit / model.current_unit_a)
    return registers


def _joint(given: ServoOptions, model: Model) -> Joint:
    gear = given.gear_ratio
    constant = given.torque_constant or model.torque_constant
    if model.current_unit_a:
        effort = model.current_unit_a * constant
    else:
        effort = LOAD_UNIT * model.stall_torque
    if given.shadow is not None:
        effort *= 2.0  # two motors with the same current
    zero = model.centre_counts if given.zero_counts is None else given.zero_counts
    return Joint(
        position=model.turn_rad / model.counts / gear,
        velocity=model.velocity_unit_rpm * REV_PER_MIN / gear,
        effort=effort * gear,
        direction=-given.direction if given.reverse_mode else given.direction,
        zero=zero - given.homing_offset,
    )


def simulate(
    options: DynamixelOptions, bus: BusSpec, physics: Sequence[Any], clock: Clock
) -> ServoWorld:
    """Return the servos of a bus in this process."""
    return ServoWorld(options, bus, physics, clock)


def serve(
    options: DynamixelOptions,
    bus: BusSpec,
    physics: Sequence[Any],
    announce: Callable[[Mapping[str, Any]], None],
    stopped: Callable[[], bool],
) -> None:
    """Serve the servos of a bus on a pseudo-terminal until `stopped()`."""
    serve_world(
        "dynamixel",
        lambda clock: ServoWorld(options, bus, physics, clock, free=not is_served(options)),
        options.simulator.link,
        announce,
        stopped,
    )


def bench(options: BenchOptions) -> Bench:
    """Return servos without a rig: factory settings but for id and baud rate, no hand, no wall.

    Raises
    ------
    ConfigError
        There is no such model, baud rate, id or fault.
    """
    try:
        model = find_model(options.model)
    except ValueError as err:
        raise ConfigError(f"sim dynamixel: {err}") from err
    require_distinct("--ids", options.ids, "servos")
    most = 252 if model.protocol >= 2.0 else 253
    if max(options.ids) > most:
        raise ConfigError(f"--ids {max(options.ids)}: a {model.name} has ids 0 to {most}")
    faults = bench_faults("dynamixel", FaultOptions, options.seed, options.faults)
    delay = {"Return Delay Time": options.return_delay_us // 2}
    quirks = {one: ServoQuirks(registers=delay) for one in options.ids}
    bus = DynamixelOptions(
        port="bench",
        servos=[ServoOptions(id=one, model=model.name) for one in options.ids],
        baud=options.baud,
        protocol=model.protocol,
        usb_latency_s=options.usb_latency_s,
        simulator=SimulatorOptions(factory=True, faults=faults, servos=quirks, link=options.link),
    )
    axes = tuple(
        AxisSpec(f"servo.{one}", one, "rotary", "impedance", model.stall_torque)
        for one in options.ids
    )
    truths = [_free_axis(model, one) for one in options.ids]
    return Bench(bus, BusSpec("bench", axes, 1.0 / BENCH_PERIOD_S), truths)


def _free_axis(model: Model, device_id: int) -> AxisModel:
    """Return a servo whose horn carries nothing: inertia and friction guessed from its size."""
    fastest = model.no_load_speed_rpm * REV_PER_MIN
    return free_axis(
        BENCH_PERIOD_S,
        inertia=0.002 * model.stall_torque,
        damping=0.05 * model.stall_torque / fastest,
        coulomb=0.02 * model.stall_torque,
        effort_limit=model.stall_torque,
        seed=(device_id,),
    )
