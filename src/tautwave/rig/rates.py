"""Effects of a slow bus: the rig seen at an axis' own rate, and total delays."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from tautwave.config import Rig, simulation_of
from tautwave.registry import coupling_messages
from tautwave.rig.network import line_delay
from tautwave.types import CommandDelay, Damper

SETTLED = 3.0
"""Time constants of a motor's velocity filter in which it follows an axis that comes near."""


def at_axis_rate(rig: Rig, axis_name: str) -> Rig:
    """Return a rig whose every cycle is an exchange with this axis; the rig itself on a fast bus.

    A simulated command waits for the next exchange, as on the slow bus. Only this axis is valid in
    the result.
    """
    divisor = rig.axis_divisor(axis_name)
    if divisor == 1:
        return rig
    period = rig.axis_period_s(axis_name)
    bus_name = rig.axes[axis_name].bus
    bus = rig.buses[bus_name]
    options: dict[str, Any] = dict(bus.options)
    simulation = rig.simulation
    if "command_delay_s" in options:
        options["command_delay_s"] = max(float(options["command_delay_s"]), period)
        given = None if simulation is None else simulation.axes.get(axis_name)
        if simulation is not None and given is not None and given.command_delay_s is not None:
            later = given.model_copy(update={"command_delay_s": max(given.command_delay_s, period)})
            simulation = simulation.model_copy(
                update={"axes": {**simulation.axes, axis_name: later}}
            )
    slow = bus.model_copy(update={"divisor": 1, "options": options})
    return rig.model_copy(
        update={
            "rate_hz": rig.rate_hz / divisor,
            "buses": {**rig.buses, bus_name: slow},
            "simulation": simulation,
        }
    )


def at_full_rate(rig: Rig) -> Rig:
    """Return the rig with every bus served in every cycle."""
    buses = {name: bus.model_copy(update={"divisor": 1}) for name, bus in rig.buses.items()}
    return rig.model_copy(update={"buses": buses})


def one_way_delay(rig: Rig, name: str, delays: Mapping[str, CommandDelay]) -> float:
    """Return the mean one-way delay tau [s] of a pair as it acts, all samples counted.

    A wave describes the previous period, spends `delay_s` on the line, or on a network what is to
    be expected there, and acts one command delay after it arrives. On a bus with divisor n that
    period is n T, and the sample waits n - 1 periods T for its slot; the command delay is in
    periods of the bus. The converters themselves delay no integral.
    """
    period = rig.period_s
    mean = 0.0
    for side in ("master", "slave"):
        axis_name = f"{side}.{name}"
        delay, divisor = delays[axis_name], rig.axis_divisor(axis_name)
        mean += 0.5 * (delay.periods * rig.axis_period_s(axis_name) + delay.remainder_s)
        mean += (divisor - 1) * period
    return line_delay(rig).samples * period + period + mean


def standing_offset(rig: Rig, name: str, delays: Mapping[str, CommandDelay]) -> float:
    """Return the steady-state offset of a pair per unit of effort held at its master.

    In rad per N m or m per N, master units, both devices held still; from the law's part.
    """
    messages = coupling_messages(rig.coupling.law)
    return messages.standing(rig, name, delays, one_way_delay(rig, name, delays)).offset


def load_offset(rig: Rig, axis_name: str, delays: Mapping[str, CommandDelay]) -> float:
    """Return how far a load sets its pair apart where the coupling carries it.

    Per effort of the load [rad per N m or m per N], in the axis' own units.
    """
    side, _, pair = axis_name.partition(".")
    offset = standing_offset(rig, pair, delays)
    if side == "master":
        return offset
    scale = rig.coupling.pairs[pair]
    return offset * scale.position_scale / scale.effective_force_scale


def damper_reach(rig: Rig, axis_name: str, damper: Damper, delay: CommandDelay) -> float:
    """Return from how far before its wall on an axis is damped [rad or m]; inf: everywhere.

    At its velocity limit it takes so long that the command acts and the motor's filter follows.
    """
    limit = rig.axes[axis_name].velocity_limit
    period = rig.axis_period_s(axis_name)
    late_s = (1.0 + delay.periods) * period + delay.remainder_s + SETTLED * damper.filter_s
    return math.inf if limit is None else limit * late_s


def true_delay_s(rig: Rig, axis_name: str, declared: CommandDelay) -> float:
    """Return the true delay of a command in a simulation [s].

    On a bus whose delay is an option, the truth gives all of it. On a bus with a protocol, the bus
    itself causes the `declared` delay, and the truth is what the drive adds.
    """
    truth = simulation_of(rig, axis_name).command_delay_s
    period = rig.axis_period_s(axis_name)
    if "command_delay_s" in rig.buses[rig.axes[axis_name].bus].options:
        # With a divisor a command first waits for the next exchange.
        return max(truth, period) if rig.axis_divisor(axis_name) > 1 else truth
    return truth + declared.periods * period + declared.remainder_s
