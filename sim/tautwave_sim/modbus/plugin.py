"""The plugin of the simulated Modbus drives."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from tautwave.contracts import AxisSpec, Bench, BusSpec, Clock, Simulator, SimulatorPlugin
from tautwave.errors import ConfigError
from tautwave.models.plant_params import PlantParams
from tautwave.models.servo import ServoParams
from tautwave.truth import AxisModel
from tautwave_sim.modbus.options import (
    DeviceKeys,
    ModbusBenchOptions,
    SimulatedModbusOptions,
    SimulatorKeys,
)

SERVO_LAG_S = 0.005
EFFORT_MOST = 1e6


def _make(
    options: SimulatedModbusOptions, bus: BusSpec, physics: Sequence[Any], clock: Clock
) -> Simulator:
    from tautwave_sim.modbus.world import ModbusSimulator

    return ModbusSimulator(options, bus, physics, clock)


def _served(options: SimulatedModbusOptions) -> bool:
    return options.endpoint == "sim"


def _serve(
    options: SimulatedModbusOptions,
    bus: BusSpec,
    physics: Sequence[Any],
    announce: Callable[[Mapping[str, Any]], None],
    stopped: Callable[[], bool],
) -> None:
    from tautwave_sim.modbus.serving import serve_bus

    serve_bus(options, bus, physics, announce, stopped)


def _bench(options: ModbusBenchOptions) -> Bench:
    from tautwave_sim.modbus.table import load_table

    if options.rtu and options.tcp is not None:
        raise ConfigError("sim modbus: either --rtu or --tcp, not both")
    load_table(options.profile)
    bus_options = SimulatedModbusOptions(
        link="rtu" if options.rtu else "tcp",
        endpoint="sim" if options.rtu else f"tcp://{options.tcp or '127.0.0.1:0'}",
        baud=options.baud,
        parity=options.parity,
        stop_bits=options.stop_bits,
        turnaround_s=options.turnaround_s,
        devices=tuple(DeviceKeys(unit=unit, profile=options.profile) for unit in options.units),
        simulator=SimulatorKeys(server=options.server, silent_s=options.silent_s),
    )
    axes = tuple(
        AxisSpec(f"unit{unit}", unit, "rotary", options.causality, EFFORT_MOST)
        for unit in options.units
    )
    servo = None
    if options.causality == "admittance":
        servo = ServoParams(SERVO_LAG_S, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    plant = PlantParams(options.inertia, options.damping, *(0.0,) * 8, 1.0)
    truths = [
        AxisModel(
            period=1.0 / options.rate_hz,
            plant=plant,
            foam=None,
            servo=servo,
            reference=(),
            start_position=0.0,
            encoder_quantum=0.0,
            position_noise=0.0,
            effort_quantum=0.0,
            velocity_quantum=0.0,
            effort_limit=EFFORT_MOST,
            command_delay=0.0,
            missing_probability=0.0,
            seed=(unit,),
        )
        for unit in options.units
    ]
    return Bench(bus_options, BusSpec("modbus", axes, options.rate_hz), truths)


simulator = SimulatorPlugin(
    options=SimulatedModbusOptions,
    make=_make,
    summary="Modbus servo drives on TCP or on an RTU line",
    served=_served,
    serve=_serve,
    bench_options=ModbusBenchOptions,
    bench=_bench,
)
