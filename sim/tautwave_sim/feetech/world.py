"""The servos of a bus, built from its options: in this process, or served on a pseudo-terminal."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from tautwave.contracts import AxisSpec, Bench, BusSpec, Clock
from tautwave.errors import ConfigError
from tautwave.truth import AxisModel
from tautwave_sim.axis import SimulatedAxis, join_arms
from tautwave_sim.bench import free_axis, require_distinct
from tautwave_sim.feetech import tables as t
from tautwave_sim.feetech.bus import ServoBus
from tautwave_sim.feetech.options import (
    FaultOptions,
    FeetechBench,
    Quirks,
    ServoKeys,
    SimulatedFeetechOptions,
    SimulatorOptions,
)
from tautwave_sim.feetech.servo import DELAY_NS, Servo
from tautwave_sim.feetech.tables import MODELS, magnitude
from tautwave_sim.wire.serial import MemoryPort, SerialLine
from tautwave_sim.wire.serial_world import (
    LineWorld,
    bench_faults,
    is_served,
    planned,
    serve_world,
    slot_ns,
)

BENCH_PERIOD_S = 1e-3
NO_SECOND_ID = 255


class ServoWorld(LineWorld):
    """The simulated servos of one bus, and the host's end of their line.

    Parameters
    ----------
    options : SimulatedFeetechOptions
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
        options: SimulatedFeetechOptions,
        bus: BusSpec,
        truths: Sequence[AxisModel],
        clock: Clock,
        free: bool = False,
    ) -> None:
        self.axes = [
            SimulatedAxis(spec.name, one, one.loop if spec.takes_position else None)
            for spec, one in zip(bus.axes, truths, strict=True)
        ]
        self.arms = join_arms(self.axes, truths)
        simulator = options.simulator
        latency_ns = round((options.usb_latency_s or 0.0) * 1e9)
        self.line = SerialLine(options.baud, latency_ns, echoes=simulator.echo)
        self.servos = [
            _servo(options, spec, axis, truth)
            for spec, axis, truth in zip(bus.axes, self.axes, truths, strict=True)
        ]
        faults = simulator.faults
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
    options: SimulatedFeetechOptions, spec: AxisSpec, axis: SimulatedAxis, truth: AxisModel
) -> Servo:
    given = next((one for one in options.servos if one.id == spec.device_id), None)
    if given is None:
        raise ConfigError(
            f"{spec.name}: there is no servo with id {spec.device_id}; add it to options.servos"
        )
    quirks = options.simulator.servos.get(given.id, Quirks())
    model = MODELS[quirks.model or given.model]
    keys = given.model_copy(update={"supply_v": options.supply_v})
    saved = {**t.FACTORY, **({} if model.hls else t.FACTORY_STS), t.ID: given.id}
    saved[t.BAUD] = next((code for code, baud in t.BAUDS.items() if baud == options.baud), 0)
    if model.hls:
        saved[t.DELAY] = NO_SECOND_ID
    elif not options.simulator.factory:
        saved[t.DELAY] = round(options.return_delay_s * 1e9 / DELAY_NS)
    offset = magnitude(given.offset, model.offset_sign)
    saved |= {t.OFFSET: offset & 0xFF, t.OFFSET + 1: offset >> 8, **quirks.registers}
    return Servo(model, keys, saved, axis, truth, quirks)


def simulate(
    options: SimulatedFeetechOptions, bus: BusSpec, physics: Sequence[Any], clock: Clock
) -> ServoWorld:
    """Return the servos of a bus in this process."""
    return ServoWorld(options, bus, physics, clock)


def serve(
    options: SimulatedFeetechOptions,
    bus: BusSpec,
    physics: Sequence[Any],
    announce: Callable[[Mapping[str, Any]], None],
    stopped: Callable[[], bool],
) -> None:
    """Serve the servos of a bus on a pseudo-terminal until `stopped()`."""
    serve_world(
        "feetech",
        lambda clock: ServoWorld(options, bus, physics, clock, free=not is_served(options)),
        options.simulator.link,
        announce,
        stopped,
    )


def bench(options: FeetechBench) -> Bench:
    """Return servos without a rig: factory settings but for id and baud rate, no hand, no wall.

    Raises
    ------
    ConfigError
        There is no such model, baud rate or fault, or an id is there twice.
    """
    model = MODELS.get(options.model)
    if model is None:
        known = ", ".join(MODELS)
        raise ConfigError(f"sim feetech: no model {options.model!r} is simulated; known: {known}")
    if options.baud not in t.BAUDS.values():
        known = ", ".join(map(str, t.BAUDS.values()))
        raise ConfigError(f"--baud {options.baud}: these servos have {known}")
    require_distinct("--ids", options.ids, "servos")
    faults = bench_faults("feetech", FaultOptions, options.seed, options.faults)
    delay = {} if model.hls else {t.DELAY: options.return_delay_us // 2}
    bus = SimulatedFeetechOptions(
        port="bench",
        servos=[ServoKeys(id=one, model=model.name, gear=options.gear) for one in options.ids],
        baud=options.baud,
        usb_latency_s=options.usb_latency_s,
        simulator=SimulatorOptions(
            factory=True,
            echo=options.echo,
            faults=faults,
            servos={one: Quirks(registers=delay) for one in options.ids},
            link=options.link,
        ),
    )
    stall = model.constant * model.voltage / model.resistance
    axes = tuple(AxisSpec(f"servo.{one}", one, "rotary", "impedance", stall) for one in options.ids)
    share = ((options.gear or model.gear) / model.gear) ** 2
    emf = 0.0 if model.hls else model.constant**2 / model.resistance
    truths = [
        free_axis(
            BENCH_PERIOD_S,
            inertia=share * model.inertia,
            damping=share * (model.friction + emf),
            coulomb=model.coulomb,
            effort_limit=stall,
            seed=(one,),
        )
        for one in options.ids
    ]
    return Bench(bus, BusSpec("bench", axes, 1.0 / BENCH_PERIOD_S), truths)
