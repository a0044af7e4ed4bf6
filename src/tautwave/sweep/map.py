"""Maps: a rig's wall over its stiffness and one more quantity; predicted and simulated limits.

A map file is a sweep file with `planes` instead of `figure`: not a run in time, but the simulator's
own one-period map at every point, which shows growth however slow. Over the encoder's step or
Coulomb friction it is an adversary's motion on the quantised wall. Read and checked like a rig.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from pydantic import Field

from tautwave.analysis.maps.quantised import quantised_plane
from tautwave.analysis.maps.stability import (
    GROWING,
    Column,
    StabilityPlane,
    stability_plane,
    vary,
)
from tautwave.analysis.ports.sampled_loop import Device
from tautwave.analysis.walls.sampled import SampledWall
from tautwave.config import Rig, load_rig
from tautwave.config.keys.common import AxisName, Block, Name, NonNegative, Positive
from tautwave.config.keys.rig import simulation_of
from tautwave.config.messages import validate
from tautwave.config.text.document import Document, nearest
from tautwave.errors import ConfigError, WritingError
from tautwave.files import make_directory
from tautwave.rig import axis_allowance, command_delays
from tautwave.sweep.file import read_sweep_file
from tautwave.sweep.predict import true_device

Floats = npt.NDArray[np.float64]
Variable = Literal[
    "wall_damping", "period_s", "delay_periods", "mass", "damping", "coulomb", "quantum"
]
Scale = Literal["linear", "log"]
QUANTISED = ("coulomb", "quantum")
"""Quantities varied on a quantised wall."""
BOUNDARIES, POINTS = "boundaries.csv", "points.csv"


class Range(Block):
    """Values of one axis of a plane."""

    low: float = Field(description="First value, SI.")
    high: float = Field(description="Last value, SI.")
    points: Annotated[int, Field(ge=2, le=1000)] = Field(default=100, description="How many.")
    scale: Scale = Field(default="log", description="Spacing and scale.")

    def values(self) -> Floats:
        """Return the values in increasing order."""
        if self.scale == "log":
            return np.geomspace(self.low, self.high, self.points)
        return np.linspace(self.low, self.high, self.points)


class Plane(Block):
    """One plane: stiffness over another quantity."""

    title: str = Field(default="", description="Heading of the panel.")
    x: Variable = Field(
        description="Quantity varied besides the stiffness. Over coulomb [N m | N] and quantum "
        "[rad | m] the limit is that of a quantised prompt spring."
    )
    label: str = Field(description="Label of the horizontal axis, with the unit in brackets.")
    factor: Positive = Field(default=1.0, description="Display factor of the value.")
    values: Range = Field(description="Values of that quantity.")
    stiffness: Range = Field(description="Stiffness of the wall [N m/rad | N/m].")
    wall_damping: float | None = Field(default=None, description="Default: that of the rig's wall.")
    delay_periods: NonNegative | None = Field(
        default=None, description="Delay until a command acts. Default: from the rig."
    )
    velocity_filter_s: NonNegative | None = Field(
        default=None, description="[s] Default: that of the axis."
    )
    keep_delay_s: bool = Field(
        default=False, description="Over the period: keep the delay in seconds, not in periods."
    )


class MapFile(Block):
    """A map file."""

    name: Annotated[str, Field(min_length=1)] = Field(description="Name of the map.")
    rig: str = Field(description="Rig file; a relative path starts at this file's folder.")
    set: dict[str, object] = Field(default_factory=dict, description="Keys of the rig and values.")
    axis: AxisName = Field(description="Axis of the wall, such as master.wrist.")
    title: str = Field(default="", description="Heading of the figure.")
    notes: tuple[str, ...] = Field(default=(), description="Lines of text below: assumptions.")
    planes: Annotated[dict[Name, Plane], Field(min_length=1)] = Field(
        description="From top to bottom."
    )


class MapPlan(NamedTuple):
    """A valid map file, its rig, and the base of each plane."""

    file: MapFile
    rig: Rig
    starts: dict[str, Column]


class MapResult(NamedTuple):
    """Planes by name, and their files."""

    planes: dict[str, StabilityPlane]
    boundaries: Path
    points: Path


def is_map(path: str | Path) -> bool:
    """Return whether a sweep file has planes; unreadable files are left to the reader."""
    try:
        document = read_sweep_file(Path(path))
    except ConfigError:
        return False
    return "planes" in document.value


def load_map(path: str | Path) -> MapPlan:
    """Read and check a map file and its rig.

    Raises
    ------
    ConfigError
        Anything is wrong; `problems` holds every mistake with its line.
    """
    path = Path(path)
    document = read_sweep_file(path)
    file: MapFile | None = validate(document, MapFile)
    if document.problems or file is None:
        raise ConfigError(document.sentences())
    _check(document, file)
    if document.problems:
        raise ConfigError(document.sentences())
    arguments = [f"{key}={json.dumps(value)}" for key, value in file.set.items()]
    rig = load_rig(path.parent / file.rig, arguments)
    axis = rig.axes.get(file.axis)
    if axis is None:
        hint = nearest(file.axis, list(rig.axes)) or "."
        document.report(("axis",), f"unknown axis {file.axis!r}{hint}")
    elif axis.causality != "impedance":
        document.report(("axis",), f"{file.axis} takes velocities; maps are for impedance axes")
    elif rig.simulation is None:
        document.report(("rig",), "a map requires a simulation, and this rig has none")
    if document.problems:
        raise ConfigError(document.sentences())
    starts = {name: _start(rig, file, p) for name, p in file.planes.items()}
    for name, plane in file.planes.items():
        if plane.x in QUANTISED:
            _check_quantised(document, name, plane, starts[name])
    if document.problems:
        raise ConfigError(document.sentences())
    return MapPlan(file, rig, starts)


def _check(document: Document, file: MapFile) -> None:
    for name, plane in file.planes.items():
        for key in ("values", "stiffness"):
            values: Range = getattr(plane, key)
            base = ("planes", name, key)
            if not values.high > values.low:
                document.report((*base, "high"), f"Input should be greater than low, {values.low}")
            if values.low <= 0.0 and (values.scale == "log" or key == "stiffness"):
                document.report((*base, "low"), "Input should be greater than 0 here")
        if plane.values.low < 0.0 and plane.x != "wall_damping":
            document.report(("planes", name, "values", "low"), "Input should not be negative")
        elif plane.values.low == 0.0 and plane.x in ("period_s", "mass", "quantum"):
            document.report(("planes", name, "values", "low"), "Input should be greater than 0")


def _check_quantised(document: Document, name: str, plane: Plane, start: Column) -> None:
    """Report settings that the limit of a quantised wall does not cover."""
    place = ("planes", name, "x")
    if start.wall.damping != 0.0:
        document.report(place, f"over {plane.x} the wall is a spring: set wall_damping: 0 here")
    if start.wall.delay != 0.0:
        document.report(place, f"over {plane.x} the wall is undelayed: set delay_periods: 0 here")
    if plane.x == "coulomb" and start.quantum == 0.0:
        document.report(place, "over coulomb the axis needs an encoder_quantum")


def _start(rig: Rig, file: MapFile, plane: Plane) -> Column:
    """Return the rig's wall on the rig's device, with the plane's own settings."""
    side, name = file.axis.split(".")
    axis = rig.axes[file.axis]
    keys = rig.coupling.pairs[name]
    wall = keys.wall_master if side == "master" else keys.wall_slave
    device, truth = true_device(rig, file.axis), simulation_of(rig, file.axis)
    damping = 0.0 if wall is None else wall.damping
    delay = device.command_delay if plane.delay_periods is None else plane.delay_periods
    lag = axis.velocity_filter_s if plane.velocity_filter_s is None else plane.velocity_filter_s
    return Column(
        0.0,
        SampledWall(
            0.0 if wall is None else wall.stiffness,
            damping if plane.wall_damping is None else plane.wall_damping,
            rig.axis_period_s(file.axis),
            delay,
            lag,
        ),
        Device(device.mass, device.damping, device.stiffness),
        axis_allowance(rig, file.axis, command_delays(rig)[file.axis]).sampled_damping,
        truth.coulomb,
        truth.encoder_quantum,
    )


def operating_value(start: Column, plane: Plane) -> float:
    """Return where on the horizontal axis the rig itself is, SI."""
    return {
        "wall_damping": start.wall.damping,
        "period_s": start.wall.period,
        "delay_periods": start.wall.delay,
        "mass": start.device.mass,
        "damping": start.own_damping,
        "coulomb": start.coulomb,
        "quantum": start.quantum,
    }[plane.x]


def run_map(
    plan: MapPlan, out: Path, progress: Callable[[float, str], None] | None = None
) -> MapResult:
    """Compute all planes and write them into `out`: limits per column, verdicts per point.

    Raises
    ------
    WritingError
        The directory cannot be written.
    """
    make_directory(out)
    planes: dict[str, StabilityPlane] = {}
    total = len(plan.file.planes)
    for at, (name, plane) in enumerate(plan.file.planes.items()):
        columns = [
            vary(plan.starts[name], plane.x, float(value), keep_delay_s=plane.keep_delay_s)
            for value in plane.values.values()
        ]

        def tell(share: float, at: int = at, name: str = name) -> None:
            if progress is not None:
                progress((at + share) / total, name)

        compute = quantised_plane if plane.x in QUANTISED else stability_plane
        planes[name] = compute(columns, plane.stiffness.values(), tell)
    try:
        boundaries, points = out / BOUNDARIES, out / POINTS
        _write(boundaries, ("plane", "x", "passive", "stable", "simulated"), _limits(planes))
        _write(
            points,
            (
                *("plane", "x", "stiffness", "growth_per_period", "stable", "predicted_stable"),
                "gain_per_cycle",
            ),
            _verdicts(plan, planes),
        )
    except OSError as err:
        raise WritingError(f"{out}: the map cannot be written: {err.strerror}") from err
    return MapResult(planes, boundaries, points)


Rows = list[tuple[object, ...]]


def _limits(planes: dict[str, StabilityPlane]) -> Rows:
    return [
        (name, *map(float, row))
        for name, plane in planes.items()
        for row in zip(plane.x, plane.passive, plane.stable, plane.simulated, strict=True)
    ]


def _verdicts(plan: MapPlan, planes: dict[str, StabilityPlane]) -> Rows:
    """Return a row per point: growth of a map, or ln of the gain of an adversary's cycle."""
    quantised = {name: plan.file.planes[name].x in QUANTISED for name in planes}
    return [
        (
            *(name, float(x), float(k), "" if quantised[name] else float(g)),
            *(int(g <= GROWING), int(stable), math.exp(g) if quantised[name] else ""),
        )
        for name, plane in planes.items()
        for column, x in enumerate(plane.x)
        for k, g, stable in zip(
            plane.stiffness, plane.growth[:, column], plane.predicted[:, column], strict=True
        )
    ]


def _write(path: Path, header: tuple[str, ...], rows: Rows) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)


def agreement_sentence(plane: StabilityPlane) -> str:
    """Return a sentence on how far prediction and simulation differ."""
    return (
        f"predicted and simulated verdicts differ at {plane.mismatched} of {plane.growth.size} "
        f"points; {len(plane.edges)} simulated boundaries are off by "
        f"{100.0 * plane.disagreement:.1g} % at most"
    )
