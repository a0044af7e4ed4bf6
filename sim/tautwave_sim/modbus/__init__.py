"""Simulated Modbus servo drives, on TCP or on an RTU line.

Registers, machines and limits by family (`tables/`); wire time by the baud rate; the motors move in
slots of the bus' period. Slot 0 of a drive is the first request that finds it on and writes a
command register (FC 6, 16 or 23): that request's sample is slot 0's, its command acts from slot 0
on. A later command belongs to the slot that its first byte's time since then is nearest to; what
only reads belongs to the slot of the last command, unless whole periods have passed. The first
request in a new slot, to whichever drive, lets all drives pass it and sample. So every drive may be
polled at a phase of its own, command first; host lateness below half a period moves nothing; and
what a loop writes in cycle k acts from slot k + 1 on: a command delay of one period of the bus.
Until slot 0 an axis is held where it is; switched off and on again it is held again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from tautwave.contracts import AxisSpec, Bench, BusSpec, Clock, Simulator, SimulatorPlugin
from tautwave.errors import ConfigError
from tautwave.models.servo import ServoParams
from tautwave_sim.bench import free_axis, require_distinct
from tautwave_sim.modbus.options import (
    DeviceKeys,
    ModbusBenchOptions,
    SimulatedModbusOptions,
    SimulatorKeys,
    host_port,
)

SERVO_LAG_S = 0.005
EFFORT_MOST = 1e6


def _make(
    options: SimulatedModbusOptions, bus: BusSpec, physics: Sequence[Any], clock: Clock
) -> Simulator:
    from tautwave_sim.modbus.world import ModbusSimulator

    return ModbusSimulator(options, bus, physics, clock)


def _served(options: SimulatedModbusOptions) -> bool:
    # There is one server for all: drives with connections of their own stay in the run's process.
    return options.endpoint == "sim" and all(one.endpoint is None for one in options.devices)


def _instead(options: SimulatedModbusOptions) -> Mapping[str, Any]:
    return {"endpoint": "sim"}


def _serve(
    options: SimulatedModbusOptions,
    bus: BusSpec,
    physics: Sequence[Any],
    announce: Callable[[Mapping[str, Any]], None],
    stopped: Callable[[], bool],
) -> None:
    from tautwave_sim.modbus.wire.serving import serve_bus

    serve_bus(options, bus, physics, announce, stopped)


def _bench(options: ModbusBenchOptions) -> Bench:
    from tautwave_sim.modbus.families import load_table

    if options.rtu and options.tcp is not None:
        raise ConfigError("sim modbus: either --rtu or --tcp, not both")
    if options.rtu and options.server != "own":
        raise ConfigError(f"sim modbus: --server {options.server} serves TCP only, not --rtu")
    require_distinct("--units", options.units, "drives")
    load_table(options.profile)
    tcp = options.tcp or "127.0.0.1:0"
    host_port(tcp)
    bus_options = SimulatedModbusOptions(
        link="rtu" if options.rtu else "tcp",
        endpoint="sim" if options.rtu else f"tcp://{tcp}",
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
    truths = [
        free_axis(
            1.0 / options.rate_hz,
            options.inertia,
            options.damping,
            servo=servo,
            effort_limit=EFFORT_MOST,
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
    instead=_instead,
)
