"""Limit cycles of the walls that are not passive: predicted and simulated.

The bias is a hand that pushes with a constant force, without stiffness; amplitudes grow in
proportion to it, the frequency does not change.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from tautwave.analysis.ports.sampled_loop import Device
from tautwave.analysis.walls.limit_cycle import (
    REST,
    UNBOUNDED,
    VOLUNTARY_HZ,
    LimitCycle,
    predict_limit_cycle,
    simulate_limit_cycle,
)
from tautwave.analysis.walls.sampled import SampledWall
from tautwave.certificate.walls import wall_name, wall_verdict
from tautwave.config import Rig, local_wall
from tautwave.errors import ConfigError
from tautwave.rig import at_axis_rate, axis_allowance
from tautwave.types import CommandDelay

BIAS = 0.1
"""Share of the axis' effort limit that the hand pushes with."""

SAMPLES = 40_000


class WallCycle(NamedTuple):
    """One wall that fails, pressed by a constant force on its bare device; SI of the axis.

    `predicted` is None if the theory does not apply; `reason` says why. `fall`: start of
    the simulation, in resting depths from the wall.
    """

    name: str
    axis: str
    rotary: bool
    wall: SampledWall
    device: Device
    bias: float
    predicted: LimitCycle | None
    simulated: LimitCycle
    fall: float
    reason: str = ""

    def sentences(self) -> list[str]:
        """Return the predicted and simulated motion in sentences."""
        place, push = ("rad", "N m") if self.rotary else ("m", "N")
        head = f"{self.name}, pressed with {self.bias:.3g} {push}"
        if self.predicted is None:
            first = f"{head}: no prediction: {self.reason}."
        elif self.predicted == UNBOUNDED:
            return [f"{head}: without device damping the bounce is unbounded."]
        elif self.predicted == REST:
            first = (
                f"{head}: comes to rest; no limit cycle, though some passive hand can sustain one."
            )
        else:
            first = f"{head}: predicted limit cycle {_words(self.predicted, place, push)}"
            first += ", faster than deliberate hand motion." if self.predicted.involuntary else "."
        if self.simulated == REST:
            return [first, f"{self.name}, simulated: comes to rest."]
        return [first, f"{self.name}, simulated: {_words(self.simulated, place, push)}."]

    def as_dict(self) -> dict[str, Any]:
        """Return plain data; infinity is null."""
        return {
            "axis": self.axis,
            "bias": self.bias,
            "reason": self.reason or None,
            "predicted": None if self.predicted is None else _plain(self.predicted),
            "simulated": _plain(self.simulated),
            "voluntary_hz": VOLUNTARY_HZ,
        }


def wall_cycles(rig: Rig, delays: Mapping[str, CommandDelay]) -> tuple[WallCycle, ...]:
    """Return a limit cycle for each wall that is not passive and has no passivity control."""
    cycles = []
    for axis_name, axis in rig.axes.items():
        wall = local_wall(rig, axis_name)
        if wall is None or axis.causality != "impedance" or wall.passivity_control:
            continue
        own = at_axis_rate(rig, axis_name)
        verdict = wall_verdict(own, axis_name, wall, delays, {})
        if verdict.passive:
            continue
        body = verdict.device
        # The wall's law includes the delay: the device gets none.
        device = Device(body.mass, body.damping)
        name, rotary = wall_name(rig, axis_name), axis.kind == "rotary"
        bias = BIAS * axis_allowance(own, axis_name, delays[axis_name]).shared_effort
        cycles.append(limit_cycle(name, axis_name, rotary, verdict.wall, device, bias))
    return tuple(cycles)


def limit_cycle(
    name: str, axis: str, rotary: bool, wall: SampledWall, device: Device, bias: float
) -> WallCycle:
    """Return one wall's limit cycle under a bias force [N or N m]."""
    predicted: LimitCycle | None = None
    reason, fall = "", 1.0
    try:
        predicted = predict_limit_cycle(wall, device, bias)
    except ConfigError as err:
        reason = str(err).removeprefix("limit cycle: ")
    if predicted == UNBOUNDED:
        return WallCycle(name, axis, rotary, wall, device, bias, predicted, UNBOUNDED, fall)
    if predicted is not None and predicted != REST:
        fall = 1.3 * predicted.height * wall.stiffness / bias  # from above: many bounces to settle
    simulated = simulate_limit_cycle(wall, device, bias, samples=SAMPLES, fall=fall)
    return WallCycle(name, axis, rotary, wall, device, bias, predicted, simulated, fall, reason)


def _words(cycle: LimitCycle, place: str, push: str) -> str:
    return (
        f"{cycle.depth:.3g} {place} deep, {cycle.height:.3g} {place} off the wall, at "
        f"{cycle.frequency:.3g} Hz, up to {cycle.peak_effort:.3g} {push}"
    )


def _plain(cycle: LimitCycle) -> dict[str, float | None]:
    return {key: value if math.isfinite(value) else None for key, value in cycle._asdict().items()}
