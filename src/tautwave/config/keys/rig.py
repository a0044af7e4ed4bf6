"""The whole rig file, and what follows from it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, Self, TypeVar

from pydantic import Field, PrivateAttr

from tautwave import formats
from tautwave.config.keys.arm import Chain, SideArm, axes_of_arm
from tautwave.config.keys.calibration import AxisCalibration, Calibration
from tautwave.config.keys.common import Block, Name, Positive
from tautwave.config.keys.control import AnyControl
from tautwave.config.keys.coupling import AnyCoupling, Coupling, Loop
from tautwave.config.keys.devices import Axis, Bus, Camera, EffortSensor, Side
from tautwave.config.keys.link import Link
from tautwave.config.keys.load import TrueLoad
from tautwave.config.keys.operate import Operate
from tautwave.config.keys.simulation import (
    AxisSimulation,
    EnvironmentPart,
    Pointer,
    Policy,
    Simulation,
)
from tautwave.config.keys.sites import SideName, Sites
from tautwave.contracts import AxisSpec, BusSpec, DriverPlugin
from tautwave.registry import load_driver
from tautwave.types import Choice, Damper, Imposed

T = TypeVar("T")
STALL_S = 0.02
"""[s] For so long a host may stall where the rig states no `overrun_limit`."""

UNTIL_STOPPED_S = 86_400.0
"""[s] Duration of a rig that does not say."""

CLAIMED_S = 3600.0
"""[s] Time for which the claims of such a rig are stated."""

VELOCITY_TIME_CONSTANT_S = 0.002
"""[s] Default velocity loop time constant of a simulated admittance axis."""


Expected = Literal["at_limit", "position_error", "not_engaged"]
"""What a run may be warned of."""


def _no_slave() -> Side:
    return Side.model_construct(axes={})


def _no_coupling() -> Coupling:
    return Coupling(pairs={})


class Rig(Block):
    """A teleoperation rig: buses, the axes of both sides, their coupling, and a simulated truth.

    With a `scene` there is neither slave nor coupling: the master's axes touch a physical model.
    """

    format: Annotated[int, Field(ge=1, le=formats.RIG)] = Field(
        default=formats.RIG,
        description="Version of the rig file's keys; default: the newest.",
    )
    name: Annotated[str, Field(min_length=1)] = Field(description="Title of the report.")
    rate_hz: Annotated[float, Field(gt=0, le=1e6)] = Field(description="[Hz] Cycles per second.")
    duration_s: Positive = Field(
        description="[s] How long a run lasts. Required, except for an operated rig, which "
        "otherwise runs until it is stopped, for at most a day.",
    )
    require: Literal["passive", "passive_quantised", "coupled_stable"] = Field(
        default="passive",
        description="What must be certified before the rig may run: passive for any operator and "
        "environment; the same with encoder steps and Coulomb friction; or stable with the "
        "stated hand.",
    )
    expect: tuple[Expected, ...] = Field(
        default=(),
        description="Conditions that are intended and cause no warning after a run: `at_limit`, an "
        "axis is at its limit for more than a fifth of the coupled cycles; `position_error`, a "
        "pair is further apart than its coupling explains; `not_engaged`, an operated rig is "
        "engaged for less than half of its run.",
    )
    seed: int = Field(default=0, description="Seed of all random numbers in a simulated run.")
    buses: Annotated[dict[Name, Bus], Field(min_length=1)] = Field(description="Buses by name.")
    master: Side = Field(description="The devices in the operator's hand.")
    slave: Side = Field(
        default_factory=_no_slave, description="The devices at the task; required without a scene."
    )
    coupling: AnyCoupling = Field(
        default_factory=_no_coupling,
        description="The coupling between them; required without a scene.",
    )
    link: Link | None = Field(
        default=None,
        description="A network between both sides, instead of the line of constant delay.",
    )
    scene: AnyControl | None = Field(
        default=None, description="A network of masses and links to touch, instead of a slave."
    )
    operate: Operate | None = Field(
        default=None,
        description="Operated rig: commands engage, clutch, hold and stop it.",
    )
    calibration: Calibration | None = Field(
        default=None,
        description="Calibration data of the devices, written by `tautwave calibrate`.",
    )
    loop: Loop = Field(default_factory=Loop, description="Settings of the control loop.")
    sites: Sites | None = Field(
        default=None, description="Master and slave on two machines; omit if one runs both."
    )
    cameras: dict[Name, Camera] | None = Field(default=None, description="Pictures beside a run.")
    simulation: Simulation | None = Field(
        default=None, description="The simulated plant that replaces hardware; omit on a real rig."
    )

    _source: Path | None = PrivateAttr(default=None)
    _choices: Mapping[str, Choice] = PrivateAttr(default_factory=dict)
    _law: Choice | None = PrivateAttr(default=None)

    def __eq__(self, other: object) -> bool:
        """Rigs are equal if all keys are, wherever they were read from."""
        if not isinstance(other, Rig):
            return NotImplemented
        return all(getattr(self, key) == getattr(other, key) for key in Rig.model_fields)

    __hash__ = None  # type: ignore[assignment]

    @property
    def source(self) -> Path | None:
        """The file this rig was read from, None if there was none."""
        return self._source

    def read_from(self, path: Path) -> Self:
        """Return the same rig with `source` set."""
        rig = self.model_copy()
        rig._source = path  # noqa: SLF001 - its own kind
        return rig

    @property
    def choices(self) -> Mapping[str, Choice]:
        """What the law took for keys that the file left to it, by path in the coupling."""
        return self._choices

    @property
    def law(self) -> Choice | None:
        """The law taken for `coupling.law: auto`, and why; None if the file names one."""
        return self._law

    def with_law(self, law: Choice) -> Self:
        """Return the same rig with `law` set."""
        rig = self.model_copy()
        rig._law = law  # noqa: SLF001 - its own kind
        return rig

    def with_choices(self, choices: Mapping[str, Choice]) -> Self:
        """Return the rig with these values in its coupling."""
        updates: dict[str, dict[str, Any]] = {}
        for path, choice in choices.items():
            _, pair, key = path.split(".")
            updates.setdefault(pair, {})[key] = choice.value
        pairs = {
            name: pair.model_copy(update=updates.get(name))
            for name, pair in self.coupling.pairs.items()
        }
        rig = self.model_copy(
            update={"coupling": self.coupling.model_copy(update={"pairs": pairs})}
        )
        rig._choices = dict(choices)  # noqa: SLF001 - its own kind
        return rig

    @property
    def period_s(self) -> float:
        """[s] One cycle."""
        return 1.0 / self.rate_hz

    @property
    def period_ns(self) -> int:
        """[ns] One cycle, rounded."""
        return round(1e9 / self.rate_hz)

    def axis_divisor(self, axis_name: str) -> int:
        """Cycles between two exchanges with an axis: its bus' divisor."""
        return self.buses[self.axes[axis_name].bus].divisor

    def axis_period_s(self, axis_name: str) -> float:
        """[s] Time between two exchanges with an axis; `period_s` on a bus served every cycle."""
        return self.period_s * self.axis_divisor(axis_name)

    @property
    def claimed_s(self) -> float:
        """[s] Time for which claims are stated: a run's, or an hour of one that has no end."""
        return CLAIMED_S if self.duration_s == UNTIL_STOPPED_S else self.duration_s

    @property
    def cycles(self) -> int:
        """Cycles of a whole run."""
        return round(self.duration_s * self.rate_hz)

    @property
    def overrun_limit(self) -> int:
        """Consecutive skipped slots that end a run."""
        given = self.loop.overrun_limit
        return max(2, round(STALL_S * self.rate_hz)) if given is None else given

    @property
    def delay_samples(self) -> int:
        """One-way delay of the line in cycles."""
        return round(self.coupling.delay_s * self.rate_hz)

    @property
    def site(self) -> SideName | None:
        """The half that runs here, None where one machine runs both."""
        return None if self.sites is None else self.sites.here

    @property
    def own_sides(self) -> tuple[SideName, ...]:
        """The sides that run here."""
        return ("master", "slave") if self.site is None else (self.site,)

    @property
    def own_axes(self) -> dict[str, Axis]:
        """The axes that run here by full name, the master's first."""
        return {
            name: axis
            for name, axis in self.axes.items()
            if name.partition(".")[0] in self.own_sides
        }

    @property
    def own_buses(self) -> dict[str, Bus]:
        """The buses that run here."""
        if self.site is None:
            return self.buses
        used = {axis.bus for axis in self.own_axes.values()}
        return {name: bus for name, bus in self.buses.items() if name in used}

    def __copy__(self) -> Self:
        """Return a copy; of one with other sides (`model_copy`) the axes are put together anew."""
        made = super().__copy__()
        made.__dict__.pop("axes", None)
        return made

    @cached_property
    def axes(self) -> dict[str, Axis]:
        """All axes by full name, the master's first."""
        return {
            f"{side}.{name}": axis
            for side, block in (("master", self.master), ("slave", self.slave))
            for name, axis in block.axes.items()
        }

    def arms(self, side: str) -> tuple[SideArm, ...]:
        """The arms of a side, `master` or `slave`, as they are listed; () without any."""
        block = self.master if side == "master" else self.slave
        if block.arm is not None:
            return (SideArm(side, block.arm, tuple(f"{side}.{name}" for name in block.axes)),)
        return tuple(
            SideArm(
                f"{side}.{name}",
                keys,
                tuple(f"{side}.{axis}" for axis in axes_of_arm(name, block.axes)),
            )
            for name, keys in (block.arms or {}).items()
        )

    def arm_of(self, axis_name: str) -> SideArm | None:
        """The arm that an axis is a joint of, None without one."""
        arms = self.arms(axis_name.partition(".")[0])
        return next((arm for arm in arms if axis_name in arm.axes), None)


class AxisTruth(NamedTuple):
    """The complete truth about a simulated axis; units as in the keys of the same names."""

    inertia: float
    damping: float
    coulomb: float
    encoder_quantum: float
    position_noise: float
    position_noise_autocorrelation: tuple[float, ...]
    effort_quantum: float
    velocity_quantum: float
    effort_limit: float
    command_delay_s: float
    start_position: float
    velocity_time_constant_s: float
    load: TrueLoad | None = None
    effort_sensor: EffortSensor | None = None
    servo_stiffness: float = 0.0
    servo_damping: float = 0.0


def simulation_of(rig: Rig, axis_name: str) -> AxisTruth:
    """Return the truth of one axis, by default the rig's belief.

    Parameters
    ----------
    rig : Rig
        Any rig, with or without a `simulation` block.
    axis_name : str
        Full name, such as `master.wrist`.

    Raises
    ------
    KeyError
        The rig has no such axis.
    """
    axis = rig.axes[axis_name]
    given = AxisSimulation()
    if rig.simulation is not None:
        given = rig.simulation.axes.get(axis_name, given)
    declared: Any = rig.buses[axis.bus].options.get("command_delay_s", 0.0)
    believed = 0.0
    if axis.inertia is not None:
        arm = true_arm(rig, axis_name)
        believed = axis.inertia.value if arm is None else axis.inertia.lower
    damping = _first(given.damping, axis.damping.value)
    spring = _first(given.servo_stiffness, axis.outside_stiffness)
    lag = axis.follower.lag_s if axis.follower else 0.0
    load = axis.load and TrueLoad(**axis.load.model_dump(exclude={"compensate", "reflect_load"}))
    return AxisTruth(
        inertia=_first(given.inertia, believed),
        damping=damping,
        coulomb=_first(given.coulomb, axis.coulomb.value),
        encoder_quantum=_first(given.encoder_quantum, axis.encoder_quantum),
        position_noise=_first(given.position_noise, axis.position_noise),
        position_noise_autocorrelation=_first(
            given.position_noise_autocorrelation, axis.position_noise_autocorrelation or ()
        ),
        effort_quantum=_first(given.effort_quantum, axis.effort_quantum),
        velocity_quantum=_first(given.velocity_quantum, axis.velocity_quantum),
        effort_limit=_first(given.effort_limit, axis.effort_limit),
        command_delay_s=_first(given.command_delay_s, float(declared)),
        start_position=_first(given.start_position, 0.0),
        velocity_time_constant_s=_first(given.velocity_time_constant_s, VELOCITY_TIME_CONSTANT_S),
        load=_first(given.load, load),
        effort_sensor=_first(given.effort_sensor, axis.effort_sensor),
        servo_stiffness=spring,
        servo_damping=_first(given.servo_damping, max(spring * lag - damping, 0.0)),
    )


def true_arm(rig: Rig, axis_name: str) -> tuple[str, Chain] | None:
    """Return name and chain of the arm that a simulated axis is a joint of, None without one."""
    if rig.simulation is None:
        return None
    believed = rig.arm_of(axis_name)
    name = axis_name.partition(".")[0] if believed is None else believed.name
    keys = rig.simulation.arms.get(name, None if believed is None else believed.keys)
    return None if keys is None else (name, keys)


def count_velocity(rig: Rig, axis_name: str, quantum: float) -> float:
    """Return the velocity [rad/s or m/s] that one encoder count of `quantum` [rad or m] reads as.

    An impedance axis sees it behind its velocity filter t_f, quantum / (T + t_f), in its bus'
    period T; an admittance axis has no filter.
    """
    axis = rig.axes[axis_name]
    filtered = axis.velocity_filter_s if axis.causality == "impedance" else 0.0
    return quantum / (rig.axis_period_s(axis_name) + filtered)


def axis_damper(rig: Rig, axis_name: str) -> Damper | None:
    """Return the damper that an axis' motor always has, by the options of its bus."""
    bus = rig.axes[axis_name].bus
    plugin = load_driver(rig.buses[bus].driver)
    spec = bus_spec(rig, bus)
    facts = plugin.facts(plugin.options.model_validate(rig.buses[bus].options), spec)
    (damper,) = (
        one.damper for axis, one in zip(spec.axes, facts, strict=True) if axis.name == axis_name
    )
    return damper


def has_plain_devices(rig: Rig) -> bool:
    """Return whether simulated devices stay in Python: parts, loads, followers, dampers."""
    if rig.simulation is None:
        return False
    if any(load_driver(bus.driver).plain for bus in rig.buses.values()):
        return True
    if any(axis_damper(rig, name) is not None for name in rig.axes):
        return True
    hands = (getattr(hand, "reference", None) for hand in rig.simulation.hand.values())
    outside = (*rig.simulation.environment.values(), *hands)
    parts = any(isinstance(keys, EnvironmentPart | Policy | Pointer) for keys in outside)
    return parts or has_loads(rig) or any(axis.follower for axis in rig.axes.values())


def imposed_motions(rig: Rig, plugins: Mapping[str, DriverPlugin | None]) -> dict[str, Imposed]:
    """Return the recorded motion of each axis whose bus forces it along one, by full name.

    Raises
    ------
    ConfigError
        The options of a bus name none for an axis of it.
    """
    by_axis = {}
    for name, bus in rig.buses.items():
        plugin = plugins[name]
        if plugin is None or plugin.imposed is None:
            continue
        spec = bus_spec(rig, name)
        motions = plugin.imposed(plugin.options.model_validate(bus.options), spec)
        by_axis.update({axis.name: one for axis, one in zip(spec.axes, motions, strict=True)})
    return by_axis


def has_loads(rig: Rig) -> bool:
    """Return whether an axis carries a load, believed or simulated, which is not compiled."""
    believed = any(rig.arms(side) for side in ("master", "slave"))
    believed = believed or any(axis.load is not None for axis in rig.axes.values())
    if believed or rig.simulation is None:
        return believed
    simulated = rig.simulation.axes.values()
    return bool(rig.simulation.arms) or any(axis.load is not None for axis in simulated)


def bus_spec(rig: Rig, bus_name: str) -> BusSpec:
    """Return what the driver of a bus has to know about it; the master's axes come first."""
    axes = tuple(
        _axis_spec(name, axis, calibration_of(rig, name))
        for name, axis in rig.axes.items()
        if axis.bus == bus_name
    )
    divisor = rig.buses[bus_name].divisor
    return BusSpec(bus_name, axes, rig.rate_hz / divisor, divisor=divisor)


def calibration_of(rig: Rig, axis_name: str) -> AxisCalibration:
    """Return what was found on the device of an axis; as it comes if nothing was."""
    calibrations = {} if rig.calibration is None else rig.calibration.axes
    return calibrations.get(axis_name, AxisCalibration())


def _axis_spec(name: str, axis: Axis, calibration: AxisCalibration) -> AxisSpec:
    low, high = (-math.inf, math.inf) if axis.position_range is None else axis.position_range
    ends = (
        calibration.zero + calibration.direction * low,
        calibration.zero + calibration.direction * high,
    )
    return AxisSpec(
        name,
        axis.id,
        axis.kind,
        axis.causality,
        axis.effort_limit,
        math.inf if axis.velocity_limit is None else axis.velocity_limit,
        (min(ends), max(ends)),
        axis.effort_sensor is not None,
        axis.follower is not None,
    )


def _first(given: T | None, otherwise: T) -> T:
    return otherwise if given is None else given
