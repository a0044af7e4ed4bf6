"""`scene`: a network of masses and links that the master's axes touch, in place of a slave.

A block with `count: n` stands for n parts of the same kind: mass `grain` with count 10 is grain1 to
grain10, and a link between `grain` and `floor` is ten links. Lengths are in the scene's own metres
(rad on a rotary axis), positions are positive upwards.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from tautwave.config.keys.common import Block, Name, NonNegative, Positive
from tautwave.config.keys.control import ControlKeys

Exponent = Annotated[float, Field(ge=1, le=10)]
Ends = Annotated[
    tuple[Name, Name],
    Field(
        description="The two nodes; stretch is the position of the first minus that of the second."
    ),
]


class SceneMass(Block):
    """A mass, or several of a kind."""

    mass: Positive = Field(description="[kg | kg m^2] Mass of each.")
    count: Annotated[int, Field(ge=1, le=100_000)] = Field(
        default=1, description="Number of masses, named NAME1, NAME2, ... if more than one."
    )
    position: float = Field(default=0.0, description="[m | rad] Start position of the first.")
    spacing: float = Field(default=0.0, description="[m | rad] Distance from each to the next.")
    velocity: float = Field(default=0.0, description="[m/s | rad/s] Start velocity.")
    damping: NonNegative = Field(
        default=0.0, description="[N s/m | N m s/rad] Damping of each to ground."
    )


class Chain(Block):
    """Keys of all links."""

    between: Ends
    chain: bool = Field(
        default=False, description="Both ends are the same group: link each member to the next."
    )


class SpringLink(Chain):
    """A spring and a damper in parallel, acting both ways."""

    type: Literal["spring"] = Field(description="Kind of link.")
    stiffness: Positive = Field(description="[N/m | N m/rad]")
    damping: NonNegative = Field(default=0.0, description="[N s/m | N m s/rad]")
    rest: float = Field(default=0.0, description="[m | rad] Stretch at which the force is 0.")


class DamperLink(Chain):
    """A damper."""

    type: Literal["damper"] = Field(description="Kind of link.")
    damping: Positive = Field(description="[N s/m | N m s/rad]")


class ContactLink(Chain):
    """A contact that only pushes: stiffness * depth**exponent * (1 + loss * speed)."""

    type: Literal["contact"] = Field(description="Kind of link.")
    stiffness: Positive = Field(description="[N/m**exponent]")
    exponent: Exponent = Field(default=1.0, description="1: linear; 1.5: Hertz; 2: squared.")
    loss: NonNegative = Field(default=0.0, description="[s/m] Hunt and Crossley's loss factor.")
    gap: float = Field(
        default=0.0,
        description="[m | rad] Contact begins when the first is closer than this above the second.",
    )


class NonlinearLink(Chain):
    """A spring that stiffens both ways: stiffness * stretch**exponent."""

    type: Literal["nonlinear"] = Field(description="Kind of link.")
    stiffness: Positive = Field(description="[N/m**exponent]")
    exponent: Exponent = Field(description="3: cubic.")
    rest: float = Field(default=0.0, description="[m | rad] Stretch at which the force is 0.")


class PlasticLink(Chain):
    """A spring that yields above a force and keeps its set: clay, or a plectrum."""

    type: Literal["plastic"] = Field(description="Kind of link.")
    stiffness: Positive = Field(description="[N/m | N m/rad]")
    yield_force: Positive = Field(description="[N | N m]")
    damping: NonNegative = Field(default=0.0, description="[N s/m | N m s/rad]")


class FrictionLink(Chain):
    """Dry friction, rounded off below a speed."""

    type: Literal["friction"] = Field(description="Kind of link.")
    force: Positive = Field(description="[N | N m]")
    speed: Positive = Field(default=1e-3, description="[m/s | rad/s]")


class BowLink(Chain):
    """Friction that falls with speed, as under a bow: greatest at `speed`."""

    type: Literal["bow"] = Field(description="Kind of link.")
    force: Positive = Field(description="[N | N m]")
    speed: Positive = Field(default=0.05, description="[m/s | rad/s]")


class NegativeDamperLink(Chain):
    """A damper that feeds energy. No rig with one is certified."""

    type: Literal["negative_damper"] = Field(description="Kind of link.")
    damping: Positive = Field(description="[N s/m | N m s/rad] Negative damping.")


class EnergySourceLink(Chain):
    """A motor that delivers its power at any speed. No rig with one is certified."""

    type: Literal["energy_source"] = Field(description="Kind of link.")
    power: Positive = Field(description="[W]")
    speed: Positive = Field(
        default=0.01, description="[m/s | rad/s] Below this speed it delivers less."
    )


OtherLink = (
    NonlinearLink | PlasticLink | FrictionLink | BowLink | NegativeDamperLink | EnergySourceLink
)
"""Links that are alike in one dimension and in three."""

SceneLink = Annotated[
    SpringLink | DamperLink | ContactLink | OtherLink, Field(discriminator="type")
]


class ScenePort(Block):
    """An axis as a node of the scene, named as the axis; `to` couples it by a spring."""

    to: Name | None = Field(default=None, description="Node the coupling spring ends at.")
    stiffness: Positive | None = Field(
        default=None, description="[N/m | N m/rad] Coupling spring k_c; required with `to`."
    )
    damping: NonNegative = Field(default=0.0, description="[N s/m | N m s/rad] Beside k_c.")
    position_scale: Positive = Field(
        default=1.0, description="Motion in the scene per motion of the axis; power is kept."
    )
    offset: float = Field(
        default=0.0,
        description="[m | rad] Position in the scene that corresponds to axis position 0.",
    )


class SceneString(Block):
    """A string at the point where it is touched; a node without mass."""

    impedance: Positive = Field(description="[N s/m] sqrt(tension * mass per length).")
    frequency_hz: Positive = Field(description="[Hz] Pitch; made a whole number of samples.")
    position: Annotated[float, Field(gt=0, lt=1)] = Field(
        default=0.1, description="Where it is touched, as a share of its length."
    )
    reflection: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.995, description="Reflection of a wave at either end."
    )
    brightness_hz: Positive | None = Field(
        default=None, description="[Hz] Corner of a low-pass at either end; none: lossless there."
    )


class SineForce(Block):
    """A tone."""

    type: Literal["sine"] = Field(description="Kind of force.")
    on: Name = Field(description="Mass, or group of masses.")
    amplitude: Positive = Field(description="[N | N m]")
    frequency_hz: Positive = Field(description="[Hz]")


class NoiseForce(Block):
    """Noise from the rig's seed, independent for each mass of a group."""

    type: Literal["noise"] = Field(description="Kind of force.")
    on: Name = Field(description="Mass, or group of masses.")
    amplitude: Positive = Field(description="[N | N m] Standard deviation.")
    low_hz: Positive = Field(default=20.0, description="[Hz] Lower corner.")
    high_hz: Positive = Field(default=2000.0, description="[Hz] Upper corner.")


class TapForce(Block):
    """Short random taps from the rig's seed, independent for each mass of a group."""

    type: Literal["taps"] = Field(description="Kind of force.")
    on: Name = Field(description="Mass, or group of masses.")
    amplitude: Positive = Field(description="[N | N m] Greatest.")
    per_second: Positive = Field(description="[1/s] Mean rate.")
    length_s: Positive = Field(default=0.002, description="[s] Length of each, half a sine.")


class SoundForce(Block):
    """A sound from a WAV file, the same on each mass of a group; resampled to the rig's rate."""

    type: Literal["sound"] = Field(description="Kind of force.")
    on: Name = Field(description="Mass, or group of masses.")
    file: Annotated[str, Field(min_length=1)] = Field(
        description="WAV file, PCM of 8 to 32 bits or float; relative to the rig file."
    )
    amplitude: Positive = Field(description="[N | N m] Force at full scale.")
    channel: Literal["mono"] | Annotated[int, Field(ge=1)] = Field(
        default="mono", description="Channel, from 1; mono: mean of all channels."
    )
    loop: bool = Field(
        default=False, description="Loop the file; otherwise play it once, then silence."
    )
    start_s: NonNegative = Field(default=0.0, description="[s] When it begins.")
    sha256: str | None = Field(
        default=None,
        description="SHA-256 of the file; a different file is refused. Filled in by a run.",
    )


SceneForce = Annotated[SineForce | NoiseForce | TapForce | SoundForce, Field(discriminator="type")]


HoldLimit = Annotated[
    Positive | None,
    Field(
        description="[J] Energy that the effort hold may create before the "
        "run stops. Default: that "
        "of the devices at a tenth of their velocity limits, at most 10 mJ an axis."
    ),
]
FadeIn = Annotated[NonNegative, Field(description="[s] Fade-in time of the scene's efforts.")]
FadeOut = Annotated[NonNegative, Field(description="[s] Fade-out time of the scene's efforts.")]


class SceneOutput(Block):
    """Audio output: the force on a port, high-passed, as output.wav of a run."""

    port: Name | None = Field(default=None, description="Default: the first.")
    highpass_hz: Positive = Field(default=20.0, description="[Hz] Corner.")


class Scene(ControlKeys):
    """A mass-interaction network under the hand."""

    dimension: Literal[1] = Field(
        default=1, exclude=True, description="1, or 3: points in space, with separate keys."
    )
    scheme: Literal["auto", "exact", "symplectic", "rk4", "discrete_gradient"] = Field(
        default="discrete_gradient",
        description="auto: the scheme with the least error at the rig's rate, found by trial; "
        "`check` shows which. "
        "exact: linear networks, any rate; symplectic: the standard one, w T < 2; "
        "rk4: fourth order, w T < 2.8, no plastic links; "
        "discrete_gradient: keeps the energy at any stiffness.",
    )
    discretise: Literal["alone", "with_device"] = Field(
        default="alone",
        description="with_device: springs and dampers get the numbers with which the sampled loop "
        "of hand, device and network has the modes meant; for one port, a spring to each mass. "
        "`check` prints them, and how much of the device's damping they use.",
    )
    engine: Literal["auto", "python", "compiled"] = Field(
        default="auto",
        description="Execution engine; results are bit-identical. auto: compiled (numba) on the "
        "real clock where plain Python would take more than half of a period.",
    )
    gravity: float = Field(default=0.0, description="[m/s^2] Downwards.")
    masses: dict[Name, SceneMass] = Field(default_factory=dict, description="By name.")
    grounds: dict[Name, float] = Field(
        default_factory=dict, description="[m | rad] Fixed nodes by name; `ground` is at 0."
    )
    strings: dict[Name, SceneString] = Field(default_factory=dict, description="By name.")
    links: dict[Name, SceneLink] = Field(default_factory=dict, description="By name.")
    ports: Annotated[dict[Name, ScenePort], Field(min_length=1)] = Field(
        description="One per axis of the master, by the axis' name."
    )
    forces: dict[Name, SceneForce] = Field(
        default_factory=dict, description="External forces on masses, by name."
    )
    record: list[Name] = Field(
        default_factory=list,
        description="Masses to keep and record even if they affect no port.",
    )
    output: SceneOutput = Field(default_factory=SceneOutput, description="Audio output.")
    hold_limit_j: HoldLimit = None
    engage_ramp_s: FadeIn = 0.2
    release_ramp_s: FadeOut = 0.2

    def size_of(self, name: str) -> int:
        """Return how many nodes a name stands for."""
        mass = self.masses.get(name)
        return 1 if mass is None else mass.count

    def nodes_of(self, name: str) -> list[str]:
        """Return the nodes a name stands for."""
        count = self.size_of(name)
        return [name] if count == 1 else [f"{name}{at + 1}" for at in range(count)]
