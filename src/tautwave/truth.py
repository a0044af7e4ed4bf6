"""The truth about a simulated axis, as data: passed to a simulator when a rig is built."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol

from tautwave.columns import Column, names, under
from tautwave.models.chain.params import ChainParams
from tautwave.models.foam import FoamParams
from tautwave.models.load import LoadParams
from tautwave.models.part_contact import PartContact
from tautwave.models.plant_params import PlantParams
from tautwave.models.sensors.effort import SensorParams
from tautwave.models.servo import ServoParams

Grasp = Callable[[float, float, float], float]

TRUE = (
    Column("position", "rad, m", "where it really is"),
    Column("velocity", "rad/s, m/s", ""),
)
OF_HAND = (
    Column("reference", "rad, m", "intended position of the hand"),
    Column("hand_effort", "N m, N", "effort of the hand on the device"),
)
OF_PLACE = (Column("environment_effort", "N m, N", "effort of the environment on it"),)
PLANT = (
    Column("hand_work", "J", "work of the hand's intent"),
    Column("motor_work", "J", "work of the motor"),
    Column("kinetic", "J", "now in the moving mass; an arm's joint: given to it"),
    Column("grip_stored", "J", "now in the spring of the grip"),
    Column("environment_stored", "J", "now in what it touches"),
    Column("grip_loss", "J", "dissipated in the grip"),
    Column("viscous_loss", "J", "dissipated in the device's damping"),
    Column("coulomb_loss", "J", "dissipated in its Coulomb friction"),
    Column("environment_loss", "J", "dissipated in what it touches"),
)
"""Columns of a simulated axis in their order: its motion, its hand's if one holds it, the rest."""


def truth_columns(name: str, *, hand: bool) -> list[str]:
    """Return the names of the columns of a simulated axis; `hand`: one holds it."""
    true = (*TRUE, *(OF_HAND if hand else ()), *OF_PLACE)
    return names((*under(f"true.{name}", true), *under(f"plant.{name}", PLANT)))


ARM = (
    Column("kinetic", "J", "now in its moving links and motors"),
    Column("potential", "J", "its height, from that at the start"),
    Column("work", "J", "given to it by all joints: `plant.SIDE.AXIS.kinetic`, added"),
)
"""Columns of a simulated arm: `arm.ARM.name`."""


class ArmModel(NamedTuple):
    """The chain whose joints are the axes that name it, in their order; `name` is its side."""

    name: str
    chain: ChainParams


class PositionLoop(NamedTuple):
    """Position loop of a drive: stiffness [N m/rad or N/m], damping [N m s/rad or N s/m]."""

    stiffness: float
    damping: float


class Led(Protocol):
    """A hand's reference that is known slot by slot only."""

    def aim(self, place: float) -> tuple[float, float]:
        """Return it at this slot and its rate until the next; the device is at `place`."""
        ...


class AxisModel(NamedTuple):
    """The true device, hand and environment of one axis; SI, rotary N m and rad for N and m.

    Exactly one physics applies: `servo` for an admittance axis, `foam` (with `plant`) for a power-
    law contact, `part` (with `plant`) for an environment that is a part, else `plant`. `reference`
    is the hand's position at every loop slot, empty without a hand. `command_delay` is in periods,
    with a fraction. `seed` seeds the axis' random streams: noise and missing samples. `colour` is
    the noise's autocorrelation from lag 1 on, empty where it is white. `load` weighs on the axis;
    `arm` couples it to others, and `plant` has then its motor's inertia alone. `imposed`: the axis
    is where `reference` is, whatever its motor does. `push` is an effort on it at every slot, empty
    without one. `sensor` measures the effort from outside. `grasp(x, v, T)`, asked once a slot of T
    seconds, is the effort of a hand that follows no plan.
    `loop`: its drive takes positions. `lead`: where a hand that a program leads wants to be.
    """

    period: float
    plant: PlantParams
    foam: FoamParams | None
    servo: ServoParams | None
    reference: Sequence[float]
    start_position: float
    encoder_quantum: float
    position_noise: float
    effort_quantum: float
    velocity_quantum: float
    effort_limit: float
    command_delay: float
    missing_probability: float
    seed: tuple[int, ...]
    part: PartContact | None = None
    colour: tuple[float, ...] = ()
    load: LoadParams | None = None
    arm: ArmModel | None = None
    imposed: bool = False
    push: Sequence[float] = ()
    sensor: SensorParams | None = None
    grasp: Grasp | None = None
    loop: PositionLoop | None = None
    lead: Led | None = None


class HandPlugin(NamedTuple):
    """What a `tautwave.hands` entry point names: the motion an operator wants, and the grip.

    `keys` is the pydantic block, a `tautwave.config.HandPart`: its own keys, and the grip (mass,
    damping, stiffness, lever arm). `motion(keys, times, seed)` returns the wanted position [rad or
    m] at each of the times [s]; `seed` is a tuple of integers that seeds its random numbers. Both
    may be `module:attribute`, loaded on demand.
    """

    summary: str
    keys: Any
    motion: Any


class EnvironmentPlugin(NamedTuple):
    """What a `tautwave.environments` entry point names: what a slave touches.

    `keys` is the pydantic block, a `tautwave.config.EnvironmentPart`; `params(keys)` a tuple of
    floats p. `stored(p, x)` is the energy [J] held at a position x [rad or m], `force(p, x, v)` the
    effort on the device [N m or N] at x and a velocity v [rad/s or m/s]; at rest it is the negative
    slope of `stored`, and its velocity-dependent part opposes motion. `kinks(p)` are the positions
    of kinks and jumps in either: steps end there. Each may be `module:attribute`, loaded on demand.
    """

    summary: str
    keys: Any
    params: Any
    force: Any
    stored: Any
    kinks: Any = None
