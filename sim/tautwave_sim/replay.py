"""Axes that move as recorded: a driver behind which there is no device, only a file.

Nothing that is commanded moves such an axis. It needs no simulation of its own, and may stand in
one rig beside hardware: a recorded master leads a real slave.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from tautwave.contracts import Budget, BusSpec, Clock, SimulatorPlugin
from tautwave.errors import ConfigError
from tautwave.types import Imposed
from tautwave_sim import loopback
from tautwave_sim.loopback import LoopbackDriver, LoopbackOptions, LoopbackSimulator


class ReplayDevice(BaseModel):
    """One axis, and the recording it moves by."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    id: Annotated[int, Field(ge=0)]
    """The axis' number on this bus."""

    file: Annotated[str, Field(min_length=1)]
    """Run, MCAP, CSV or MAT file; a relative path starts at the rig file's folder."""

    position: str
    """Heading of the column with the position."""

    time_column: str = "time_s"
    """Heading of the column with the time."""

    time_unit: Literal["s", "ms", "us", "ns"] | None = None
    """Unit of the time column; default: seconds; a file in another unit is refused."""

    rate_hz: Annotated[float, Field(gt=0)] | None = None
    """[Hz] Rows are evenly spaced at this rate; the file's own times, if any, are not read."""

    columns: list[str] = Field(default_factory=list)
    """Names of the columns of a text file without a heading."""

    episode: Annotated[int, Field(ge=0)] | None = None
    """Episode of a LeRobot dataset; default: its only one."""

    scale: float = 1.0
    """[rad | m per unit of the file]"""

    offset: float = 0.0
    """[rad | m] Added after scaling."""

    repeat: bool = True
    """Repeat it, the end blended into the beginning; otherwise stand at its last value."""


class ReplayOptions(BaseModel):
    """Options of a replay bus."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    devices: Annotated[list[ReplayDevice], Field(min_length=1)]
    """What each axis of the bus moves by."""


class ReplayDriver(LoopbackDriver):
    """Driver for axes that are forced along recordings."""

    def __init__(
        self,
        options: ReplayOptions,
        bus: BusSpec,
        clock: Clock,
        transport: LoopbackSimulator | None,
    ) -> None:
        super().__init__(LoopbackOptions(), bus, clock, transport)
        self.notes = [
            f"{axis.name} moves as recorded ({one.position} of "
            f"{one.file}{', again and again' if one.repeat else ', then it stands'}), regardless "
            "of its motor command: in the energy accounts, the hand does the work needed against "
            "its motor"
            for axis, one in zip(bus.axes, _imposed(options, bus), strict=True)
        ]


def _imposed(options: ReplayOptions, bus: BusSpec) -> list[Imposed]:
    known = {device.id: device for device in options.devices}
    motions = []
    for axis in bus.axes:
        if axis.causality != "impedance":
            raise ConfigError(
                f"{axis.name}: an axis that moves as recorded must be effort-controlled; set "
                "causality: impedance"
            )
        if axis.effort_sensor:
            raise ConfigError(
                f"{axis.name}.effort_sensor: not used by an axis that moves as recorded; remove it"
            )
        if axis.device_id not in known:
            raise ConfigError(
                f"buses.{bus.name}.options.devices: none has the id {axis.device_id} of "
                f"{axis.name}; it has {', '.join(map(str, known))}"
            )
        keys = known[axis.device_id].model_dump(exclude={"id"})
        motions.append(Imposed(**{**keys, "columns": tuple(keys["columns"])}))
    return motions


def _simulate(
    options: ReplayOptions, bus: BusSpec, physics: Sequence[Any], clock: Clock
) -> LoopbackSimulator:
    return LoopbackSimulator(bus.axes, physics)


def _budget(options: ReplayOptions, bus: BusSpec) -> Budget:
    return Budget(0.0, float("inf"), "no bus: a file is played")


plugin = loopback.plugin._replace(
    options=ReplayOptions,
    make=ReplayDriver,
    budget=_budget,
    summary="axes that move as recorded in a file",
    positions=False,
    files=(("devices", "*", "file"),),
    imposed=_imposed,
)
simulator = SimulatorPlugin(
    options=ReplayOptions, make=_simulate, summary="the axes behind the replay driver"
)
