"""`simulation`: the simulated plant that replaces hardware. Absent on a real rig."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field, SerializeAsAny, WrapValidator

from tautwave.config.keys.arm import Chain
from tautwave.config.keys.chosen import PART_HASH, PartHash, PartName, chosen_part
from tautwave.config.keys.common import (
    ArmName,
    Autocorrelation,
    AxisName,
    Block,
    Name,
    NonNegative,
    Positive,
    Probability,
)
from tautwave.config.keys.devices import EffortSensor
from tautwave.config.keys.load import TrueLoad
from tautwave.registry import ENVIRONMENTS, HANDS


class AxisSimulation(Block):
    """The truth about one axis; by default what the rig believes."""

    inertia: Positive | None = Field(
        default=None,
        description="[kg m^2 | kg] Impedance axes; for an arm joint, the motor alone without the "
        "chain; default: the lower bound.",
    )
    damping: NonNegative | None = Field(
        default=None, description="[N m s/rad | N s/m] Impedance axes."
    )
    coulomb: NonNegative | None = Field(
        default=None, description="[N m | N] Coulomb friction of an impedance axis; default 0."
    )
    encoder_quantum: NonNegative | None = Field(default=None, description="[rad | m]")
    position_noise: NonNegative | None = Field(
        default=None, description="[rad | m] Standard deviation."
    )
    position_noise_autocorrelation: Annotated[Autocorrelation, Field(max_length=128)] | None = (
        Field(
            default=None,
            description="Colour of that noise, as for the axis; default: that "
            "of the axis, else white.",
        )
    )
    effort_quantum: NonNegative | None = Field(default=None, description="[N m | N]")
    velocity_quantum: NonNegative | None = Field(default=None, description="[rad/s | m/s]")
    effort_limit: Positive | None = Field(
        default=None, description="[N m | N] Effort at which the motor itself saturates."
    )
    command_delay_s: NonNegative | None = Field(
        default=None,
        description="[s] Delay until a command acts; default: as declared by the driver.",
    )
    start_position: float | None = Field(
        default=None,
        description="[rad | m] Default: start of the recording that drives it or the other axis "
        "of its pair, else 0.",
    )
    velocity_time_constant_s: Positive | None = Field(
        default=None,
        description="[s] Time constant of the velocity loop of an admittance axis; default 0.002.",
    )
    servo_stiffness: Positive | None = Field(
        default=None,
        description="[N m/rad | N/m] Position loop of a follower on a loopback or feetech bus; "
        "default: its `follower.stiffness`.",
    )
    servo_damping: NonNegative | None = Field(
        default=None,
        description="[N m s/rad | N s/m] Damping of the same loop; default: such that it lags by "
        "`follower.lag_s`.",
    )
    effort_sensor: EffortSensor | None = Field(
        default=None, description="For axes with a sensor; default: as in the rig."
    )
    load: TrueLoad | None = Field(
        default=None,
        description="Gravity load of an impedance axis that is not a joint of an arm; default: as "
        "in the rig.",
    )


class MinimumJerk(Block):
    """Smooth moves from waypoint to waypoint, at rest in each."""

    type: Literal["minimum_jerk"] = Field(description="Kind of reference.")
    waypoints: Annotated[tuple[tuple[NonNegative, float], ...], Field(min_length=1)] = Field(
        description="[s], [rad | m] Increasing times, and positions; constant before and after."
    )


class Multisine(Block):
    """A sum of sines."""

    type: Literal["multisine"] = Field(description="Kind of reference.")
    offset: float = Field(default=0.0, description="[rad | m] Added to the sum.")
    components: Annotated[tuple[tuple[Positive, float, float], ...], Field(min_length=1)] = Field(
        description="[Hz], [rad | m], [rad] Frequency, amplitude and phase of each sine."
    )
    ramp_s: NonNegative = Field(default=0.5, description="[s] The sines fade in over this time.")


class Hold(Block):
    """The hand stays where it is."""

    type: Literal["hold"] = Field(description="Kind of reference.")
    position: float = Field(description="[rad | m]")


FILE = (
    "Run, CSV, text, Parquet, npz or MAT file, LeRobot dataset or ROS 2 bag; a relative path is "
    "resolved against the rig file's directory; with `--set`, against the current directory."
)


TimeUnit = Literal["s", "ms", "us", "ns"]
TIME_UNIT = "Unit of the time column; default: seconds; a file in another unit is refused."
RATE = "[Hz] Rows are evenly spaced at this rate; the file's own times, if any, are not read."
COLUMNS = "Names of the columns of a text file without a heading."
EPISODE = "Episode of a LeRobot dataset; default: its only one."


class Recording(Block):
    """A column of a recording, resampled from its own rate."""

    type: Literal["recording"] = Field(description="Kind of reference.")
    file: Annotated[str, Field(min_length=1)] = Field(description=FILE)
    column: str = Field(description="Name of the column with the position.")
    time_column: str = Field(default="time_s", description="Name of the column with the time.")
    time_unit: TimeUnit | None = Field(default=None, description=TIME_UNIT)
    rate_hz: Positive | None = Field(default=None, description=RATE)
    columns: tuple[str, ...] = Field(default=(), description=COLUMNS)
    episode: Annotated[int, Field(ge=0)] | None = Field(default=None, description=EPISODE)
    scale: float = Field(default=1.0, description="[rad | m per unit of the file]")
    offset: float = Field(default=0.0, description="[rad | m] Added after scaling.")
    repeat: bool = Field(default=True, description="Repeat it; otherwise hold its last value.")


class Intent(Block):
    """What a recorded hand wanted: from its motion, its effort, and the hand's own grip."""

    type: Literal["intent"] = Field(description="Kind of reference.")
    file: Annotated[str, Field(min_length=1)] = Field(description=FILE)
    position: str = Field(description="Name of the column with the position [rad | m].")
    effort: str = Field(
        description="Name of the column with the effort of the hand on the device [N m | N]."
    )
    time_column: str = Field(default="time_s", description="Name of the column with the time.")
    time_unit: TimeUnit | None = Field(default=None, description=TIME_UNIT)
    rate_hz: Positive | None = Field(default=None, description=RATE)
    columns: tuple[str, ...] = Field(default=(), description=COLUMNS)
    episode: Annotated[int, Field(ge=0)] | None = Field(default=None, description=EPISODE)
    effort_scale: float = Field(default=1.0, description="Scale of the sensor; -1 turns its sign.")
    effort_offset: float = Field(default=0.0, description="[N m | N] Added after scaling.")
    filter_hz: Positive = Field(
        default=20.0, description="[Hz] Smoothing of position and effort alike, without delay."
    )
    repeat: bool = Field(default=True, description="Repeat it; otherwise hold its last value.")


class Policy(Block):
    """Actions that a program sends while the rig runs lead the hand."""

    type: Literal["policy"] = Field(description="Kind of reference.")
    fps: Positive = Field(
        default=30.0,
        description="[Hz] Actions per second; the rig holds after three missing in a row.",
    )
    velocity_limit: Positive = Field(description="[rad/s | m/s] Maximum speed of the hand.")
    effort_limit: Positive = Field(description="[N m | N] Maximum effort of its spring.")


class Pointer(Block):
    """The mouse or finger on a run's page leads the hand; without it the hand lets go."""

    type: Literal["pointer"] = Field(description="Kind of reference.")
    range: tuple[float, float] | None = Field(
        default=None,
        description="[rad | m] Where the page's picture ends; default: the axis' position_range.",
    )
    velocity_limit: Positive = Field(description="[rad/s | m/s] Maximum speed of the hand.")
    effort_limit: Positive = Field(description="[N m | N] Maximum effort of its spring.")
    timeout_s: Positive = Field(
        default=0.3, description="[s] Without the pointer for so long the hand lets go."
    )


Reference = Annotated[
    MinimumJerk | Multisine | Hold | Recording | Intent | Policy | Pointer,
    Field(discriminator="type"),
]


class Grip(Block):
    """The grip of a hand: a mass on the device, spring and damper to its wanted position.

    The defaults are a light grip, in N and m; on a rotary axis the `lever_arm` turns them into
    rotary ones (times its square).
    """

    mass: NonNegative = Field(default=0.143, description="[kg] Moves with the device.")
    damping: NonNegative = Field(default=5.0, description="[N s/m]")
    stiffness: Positive = Field(default=538.0, description="[N/m]")
    lever_arm: Positive | None = Field(
        default=None,
        description="[m] Rotary axes only, and required there; 1 if the values above are rotary.",
    )


class Hand(Grip):
    """An operator's hand with a reference of the rig file."""

    reference: Reference = Field(description="[rad | m] Reference position of the hand.")


class HandPart(Grip):
    """Base of the keys of a hand that is a part: the grip, the part, and the hash of its text."""

    part_group: ClassVar[str] = HANDS

    part: PartName
    part_sha256: PartHash | None = PART_HASH


class EnvironmentPart(Block):
    """Base of the keys of an environment that is a part: the part, and the hash of its text."""

    part_group: ClassVar[str] = ENVIRONMENTS

    part: PartName
    part_sha256: PartHash | None = PART_HASH


class Free(Block):
    """No environment."""

    type: Literal["free"] = Field(description="Kind of environment.")


class Spring(Block):
    """A spring that acts both ways."""

    type: Literal["spring"] = Field(description="Kind of environment.")
    stiffness: Positive = Field(description="[N m/rad | N/m]")
    position: float = Field(description="[rad | m] Rest position.")


class SolidWall(Block):
    """A spring and damper that only pushes."""

    type: Literal["wall"] = Field(description="Kind of environment.")
    stiffness: Positive = Field(description="[N m/rad | N/m]")
    damping: NonNegative = Field(default=0.0, description="[N m s/rad | N s/m]")
    position: float = Field(description="[rad | m] Its surface.")
    side: Literal["above", "below"] = Field(
        default="above", description="above: it fills everything above `position`."
    )


class Foam(Block):
    """Hunt-Crossley contact: effort = stiffness * depth**exponent * (1 + loss * speed), >= 0."""

    type: Literal["foam"] = Field(description="Kind of environment.")
    stiffness: Positive = Field(description="[N m/rad**exponent | N/m**exponent]")
    exponent: Annotated[float, Field(ge=1, le=10)] = Field(default=1.5, description="1: linear.")
    loss: NonNegative = Field(default=0.0, description="[s/rad | s/m]")
    position: float = Field(description="[rad | m] Its surface.")
    side: Literal["above", "below"] = Field(
        default="above", description="above: it fills everything above `position`."
    )


class Recorded(Block):
    """An environment that pushes as it was recorded, wherever the device is."""

    type: Literal["recorded"] = Field(description="Kind of environment.")
    file: Annotated[str, Field(min_length=1)] = Field(description=FILE)
    effort: str = Field(description="Name of the column with the effort on the device [N m | N].")
    position: str | None = Field(
        default=None,
        description="Name of the column with the device's position, for the start position.",
    )
    time_column: str = Field(default="time_s", description="Name of the column with the time.")
    time_unit: TimeUnit | None = Field(default=None, description=TIME_UNIT)
    rate_hz: Positive | None = Field(default=None, description=RATE)
    columns: tuple[str, ...] = Field(default=(), description=COLUMNS)
    episode: Annotated[int, Field(ge=0)] | None = Field(default=None, description=EPISODE)
    scale: float = Field(default=1.0, description="Scale of the sensor; -1 turns its sign.")
    offset: float = Field(default=0.0, description="[N m | N] Added after scaling.")
    repeat: bool = Field(
        default=True, description="Repeat it; otherwise afterwards the effort is 0."
    )


Environment = Annotated[Free | Spring | SolidWall | Foam | Recorded, Field(discriminator="type")]
AnyEnvironment = Annotated[
    SerializeAsAny[Free | Spring | SolidWall | Foam | Recorded | EnvironmentPart],
    WrapValidator(chosen_part(EnvironmentPart, Environment)),
]
AnyHand = Annotated[
    SerializeAsAny[Hand | HandPart],
    WrapValidator(chosen_part(HandPart, Hand)),
]


class Faults(Block):
    """Random faults drawn from the rig's seed."""

    missing_probability: Probability = Field(
        default=0.0, description="Probability of a missing sample, per axis and cycle."
    )
    overrun_probability: Probability = Field(
        default=0.0, description="Probability of a loop overrun, per cycle."
    )
    overrun_slots: Annotated[int, Field(ge=1)] = Field(
        default=3, description="Slots an overrun skips."
    )


class Integrator(Block):
    """How the motion of simulated devices is integrated; see `tautwave.models.integrators`."""

    scheme: Literal[
        "auto",
        "exact",
        "discrete_gradient",
        "symplectic_euler",
        "implicit_midpoint",
        "rk4",
        "dormand_prince",
    ] = Field(
        default="auto",
        description="auto: the cheapest that meets `max_error`. exact: walls and springs only.",
    )
    max_error: Annotated[float, Field(gt=0, le=0.1)] | None = Field(
        default=None,
        description="Worst error of a bounce at the greatest speed, as a share of that speed; "
        "determines the sub-steps. Default: 1e-4 for auto and dormand_prince, else one step a "
        "cycle.",
    )


class Simulation(Block):
    """The truth of a simulated rig."""

    axes: dict[AxisName, AxisSimulation] = Field(
        default_factory=dict, description="By full name, such as `master.wrist`."
    )
    hand: dict[Name, AnyHand] = Field(
        default_factory=dict, description="Hand on the master, by pair; default: none."
    )
    environment: dict[Name, AnyEnvironment] = Field(
        default_factory=dict, description="Environment of the slave, by pair; default: free."
    )
    arms: dict[ArmName, Chain] = Field(
        default_factory=dict,
        description="Arms by side or, of several, by full name, such as `master.left`; default: "
        "as in the rig.",
    )
    integrator: Integrator | None = Field(
        default=None,
        description="Of impedance axes; default: exact at walls and springs, discrete_gradient "
        "in foam.",
    )
    faults: Faults = Field(default_factory=Faults, description="Random faults; default: none.")
