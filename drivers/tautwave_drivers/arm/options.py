"""Options of the `arm` driver: joints, their bus and chain, and what holds and walls the tip."""

from __future__ import annotations

import json
import math
from typing import Annotated, Any, Self

from pydantic import Field, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from tautwave.config.inputs.chains import chain_constants, chain_links
from tautwave.config.keys.arm import Chain, Point
from tautwave.config.keys.common import Block, Name, NonNegative, Positive
from tautwave.contracts import AxisSpec, BusSpec
from tautwave.errors import ConfigError, TautwaveError
from tautwave.models.chain.build import roll_pitch_yaw
from tautwave.models.chain.params import ChainParams
from tautwave.models.chain.task import COORDINATES, TaskParams, at_home
from tautwave.registry import load_driver
from tautwave_drivers.arm.walls import ArmWall

NAMES = ("x", "y", "z", "rx", "ry", "rz")
"""The coordinates that the ids 1 to 6 stand for."""


class JointBus(Block):
    """The bus that the joints are on."""

    driver: str = Field(default="loopback", description="Its driver.")
    options: dict[str, Any] = Field(default_factory=dict, description="The driver's options.")


class ArmJoint(Block):
    """One joint: where it is, and what is assumed about it."""

    id: Annotated[int, Field(ge=0)] = Field(description="The device's number on the joints' bus.")
    effort_limit: Positive = Field(description="[N m | N] Maximum effort, weight included.")
    velocity_limit: Positive = Field(description="[rad/s | m/s] The run stops above it.")
    position_range: tuple[float, float] = Field(description="[rad | m] The run stops outside it.")
    inertia_lower: NonNegative = Field(
        default=0.0,
        description="[kg m^2 | kg] Lower bound of the motor's own inertia, without the links; for "
        "effort-controlled joints.",
    )
    damping_lower: NonNegative = Field(
        default=0.0, description="[N m s/rad | N s/m] Lower bound of the joint's damping."
    )
    encoder_quantum: NonNegative = Field(default=0.0, description="[rad | m] Encoder step.")
    position_noise: NonNegative = Field(
        default=0.0, description="[rad | m] Standard deviation of the white position noise."
    )


class JointTruth(Block):
    """True values of a simulated joint; default: the assumed ones."""

    inertia: Positive | None = Field(default=None, description="[kg m^2 | kg] Of its motor.")
    damping: NonNegative | None = Field(default=None, description="[N m s/rad | N s/m]")
    coulomb: NonNegative = Field(default=0.0, description="[N m | N]")
    start_position: float | None = Field(default=None, description="[rad | m] Default: home.")


class ArmTruth(Block):
    """The simulated arm."""

    joints: dict[Name, JointTruth] = Field(default_factory=dict, description="By name.")
    chain: Chain | None = Field(default=None, description="Default: as believed.")


class ArmOptions(Block):
    """An arm, whose tip's coordinates are the axes of its bus.

    Axis ids: 1 to 3 are x, y, z of the tip from home, 4 to 6 its rotation vector from there.
    """

    bus: JointBus = Field(default_factory=JointBus, description="The bus of the joints.")
    joints: dict[Name, ArmJoint] = Field(description="The joints by name, from base to tip.")
    chain: Chain = Field(description="The chain: `dh` rows or a `urdf`, payload, gravity.")
    frame: Point = Field(
        default=(0.0, 0.0, 0.0),
        description="[rad] Roll, pitch, yaw of the coordinates' axes in the base.",
    )
    home: tuple[float, ...] | None = Field(
        default=None,
        description="[rad | m] Joint positions at which all coordinates are 0; default 0.",
    )
    carry: bool = Field(
        default=True,
        description="Compensate for the arm's weight with the joint efforts; on "
        "velocity-controlled joints, subtract it from the measured efforts.",
    )
    posture: NonNegative = Field(
        default=0.0,
        description="[N m/rad | N/m] Spring that pulls every joint towards home, for the motion "
        "that no coordinate controls.",
    )
    walls: dict[Name, ArmWall] = Field(
        default_factory=dict,
        description="Walls in space for the tip, along the frame's axes and "
        "relative to the base's origin.",
    )
    least_lever: Annotated[float, Field(ge=1e-3)] = Field(
        default=0.05,
        description="[m] For velocity-controlled joints: in directions with a shorter lever arm, "
        "as near a singular pose, the tip lags. A rotation counts as 0.2 m per rad.",
    )
    reserve: Positive = Field(
        default=0.01,
        description="[J] For velocity-controlled joints: energy that a lagging tip may supply "
        "beyond what its ports account for.",
    )
    truth: ArmTruth = Field(default_factory=ArmTruth, description="What is simulated.")

    @model_validator(mode="after")
    def _check_chain(self) -> Self:
        kinds = self._moving("chain", self.chain)
        if self.truth.chain is not None:
            true = self._moving("truth.chain", self.truth.chain)
            for name, believed, kind in zip(self.joints, kinds, true, strict=True):
                if believed != kind:
                    raise PydanticCustomError(
                        "chain",
                        "joint {name}: in truth.chain it {true}, in chain it {believed}",
                        {"name": name, "true": kind, "believed": believed},
                    )
        if self.home is not None and len(self.home) != len(self.joints):
            raise PydanticCustomError("chain", "home needs a position for each joint")
        unknown = [name for name in self.truth.joints if name not in self.joints]
        if unknown:
            raise PydanticCustomError(
                "chain", "truth names no joint of the arm: {names}", {"names": ", ".join(unknown)}
            )
        for (name, joint), at in zip(self.joints.items(), self.at_home, strict=True):
            low, high = joint.position_range
            if not low < high or not low <= at <= high:
                raise PydanticCustomError(
                    "chain", "joint {name}: home is not in its position_range", {"name": name}
                )
        return self

    def _moving(self, place: str, keys: Chain) -> list[str]:
        """Return the kinds of the joints of a chain, which have to be as many as are named."""
        try:
            links, _ = chain_links(keys)
        except ConfigError as err:
            raise PydanticCustomError("chain", "{text}", {"text": str(err)}) from err
        kinds = [link.kind for link in links if link.kind != "fixed"]
        if len(kinds) != len(self.joints):
            raise PydanticCustomError(
                "chain",
                "the {place} has {rows} joints, `joints` names {names}",
                {"place": place, "rows": len(kinds), "names": len(self.joints)},
            )
        known = [link.name for link in links if link.kind != "fixed"]
        if sorted(known) == sorted(self.joints) and known != list(self.joints):
            raise PydanticCustomError(
                "chain",
                "the joints of the {place} are in another order; list them from base to tip: "
                "{names}",
                {"place": place, "names": ", ".join(known)},
            )
        return kinds

    @model_validator(mode="after")
    def _check_bus(self) -> Self:
        ids = [joint.id for joint in self.joints.values()]
        twice = [name for name, joint in self.joints.items() if ids.count(joint.id) > 1]
        if twice:
            raise PydanticCustomError(
                "bus", "joints {names} have the same id", {"names": " and ".join(twice)}
            )
        driver = self.bus.driver
        if driver == "arm":
            raise PydanticCustomError(
                "bus", "the joints of an arm are on a bus of their own driver"
            )
        try:
            load_driver(driver).options.model_validate(self.bus.options)
        except ValidationError as err:
            first = err.errors()[0]
            place = ".".join(("bus.options", *(str(key) for key in first["loc"])))
            raise PydanticCustomError(
                "bus", "{place}: {text}", {"place": place, "text": first["msg"]}
            ) from err
        except TautwaveError as err:
            raise PydanticCustomError("bus", "bus.driver: {text}", {"text": str(err)}) from err
        return self

    @classmethod
    def model_validate(cls, obj: Any, **more: Any) -> Self:
        """Read options as they are in a rig, which has lists for tuples."""
        return obj if isinstance(obj, cls) else cls.model_validate_json(json.dumps(obj), **more)

    @property
    def at_home(self) -> tuple[float, ...]:
        """Joint positions at home."""
        return (0.0,) * len(self.joints) if self.home is None else self.home

    def kinds(self) -> list[str]:
        """Return `rotary` or `linear` of each joint."""
        links, _ = chain_links(self.chain)
        return ["rotary" if a.kind == "turns" else "linear" for a in links if a.kind != "fixed"]

    def task(self) -> TaskParams:
        """Return the constants of the tip's coordinates as believed."""
        turn = roll_pitch_yaw(*self.frame)
        axes = tuple(row[column] for column in range(3) for row in turn)
        return at_home(self.believed(), axes, self.at_home)

    def believed(self) -> ChainParams:
        """Return the believed chain."""
        return chain_constants(self.chain)


def joint_bus(options: ArmOptions, bus: BusSpec) -> BusSpec:
    """Return the bus of the joints, whose names are `SIDE.JOINT`."""
    side = bus.axes[0].name.partition(".")[0] if bus.axes else "arm"
    causality = bus.axes[0].causality if bus.axes else "impedance"
    axes = tuple(
        AxisSpec(
            f"{side}.{name}", joint.id, kind, causality, joint.effort_limit,
            joint.velocity_limit, joint.position_range,
        )
        for (name, joint), kind in zip(options.joints.items(), options.kinds(), strict=True)
    )  # fmt: skip
    return bus._replace(axes=axes)


def coordinates(bus: BusSpec) -> list[int]:
    """Return which of the six coordinates each axis of the bus is, from 0.

    Raises
    ------
    ConfigError
        An axis is none.
    """
    for axis in bus.axes:
        side, _, name = axis.name.partition(".")
        place = f"{side}.axes.{name}"
        if not 1 <= axis.device_id <= COORDINATES:
            raise ConfigError(
                f"{place}.id: an axis of an arm is 1, 2, 3 (x, y, z of its tip) or 4, 5, 6 (its "
                f"rotation vector), got {axis.device_id}"
            )
        kind = "linear" if axis.device_id <= 3 else "rotary"
        if axis.kind != kind:
            raise ConfigError(
                f"{place}.kind: coordinate {NAMES[axis.device_id - 1]} of an arm is {kind}, got "
                f"{axis.kind}"
            )
    if len({axis.causality for axis in bus.axes}) > 1:
        raise ConfigError(
            f"bus {bus.name}: its joints are either effort- or velocity-controlled; give all "
            "coordinates the same causality"
        )
    if len({axis.name.partition(".")[0] for axis in bus.axes}) > 1:
        raise ConfigError(f"bus {bus.name}: an arm is on one side; give the other a bus of its own")
    turns = [a.position_range for a in bus.axes if a.device_id > 3]
    reach = math.sqrt(sum(max(abs(low), abs(high)) ** 2 for low, high in turns))
    if turns and reach > TURN:
        raise ConfigError(
            f"bus {bus.name}: position_range of its rotations allows rotations of {reach:.3g} rad "
            f"from home, but a rotation vector is near-singular beyond {TURN:g}; narrow them"
        )
    return [axis.device_id - 1 for axis in bus.axes]


def accept(options: ArmOptions, bus: BusSpec) -> None:
    """Refuse what joints of the bus' causality have no use for, or lack.

    Raises
    ------
    ConfigError
        Naming the key.
    """
    coordinates(bus)
    place = f"buses.{bus.name}.options"
    if not follows(bus):
        for name, joint in options.joints.items():
            if joint.inertia_lower == 0.0:
                raise ConfigError(
                    f"{place}.joints.{name}.inertia_lower: required for an effort-controlled "
                    "joint; give a safe lower bound for its motor [kg m^2 | kg]"
                )
    elif options.walls:
        raise ConfigError(
            f"{place}.walls: walls in space need effort-controlled joints, and these are "
            "velocity-controlled; put the wall on the other side, or remove it"
        )
    elif options.posture > 0.0:
        raise ConfigError(
            f"{place}.posture: a joint spring needs effort-controlled joints, and these are "
            "velocity-controlled; remove it"
        )


def follows(bus: BusSpec) -> bool:
    """Return whether the joints of an arm follow velocities."""
    return any(axis.causality == "admittance" for axis in bus.axes)


TURN = 2.5
"""[rad] Greatest turn from home that is accepted."""
