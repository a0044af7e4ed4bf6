"""`buses`, `master` and `slave`: the hardware, and the controller's model of it."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from tautwave.config.keys.arm import Arm
from tautwave.config.keys.common import (
    Autocorrelation,
    Block,
    Name,
    NonNegative,
    Positive,
    tuned,
)
from tautwave.config.keys.load import Load
from tautwave.models.noise_colour import LAGS


class Bus(Block):
    """One bus and the driver that speaks on it."""

    driver: str = Field(description="Name of an installed driver; `tautwave drivers` lists them.")
    options: dict[str, Any] = Field(
        default_factory=dict, description="Options of the driver, checked by the driver."
    )
    divisor: Annotated[int, Field(ge=1, le=50)] = Field(
        default=1,
        description="The bus is served every n-th cycle, 1 to 50; its axes are controlled at that "
        "slower rate, and waves are converted between the two.",
    )
    defaults: dict[str, Any] = Field(
        default_factory=dict,
        exclude=True,
        description="Default keys for every axis on this bus; an axis' own keys take precedence.",
    )


class Belief(Block):
    """A belief about a device: best estimate, safe lower bound, and where they come from."""

    value: float
    lower: float

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        if self.lower > self.value:
            raise PydanticCustomError(
                "order",
                "lower should not be greater than value: {lower} > {value}",
                {"lower": f"{self.lower:g}", "value": f"{self.value:g}"},
            )
        return self


class Inertia(Belief):
    """Belief about a device's inertia [kg m^2 | kg]."""

    value: Positive = Field(description="[kg m^2 | kg] Best estimate.")
    lower: Positive = Field(
        description="[kg m^2 | kg] Safe lower bound, 0.5 to 0.8 of `value`: the wave port predicts "
        "with it, and is passive only if the true inertia is at least this."
    )
    source: Annotated[str, Field(min_length=1)] = Field(
        description="Where the numbers come from: identified, data sheet, CAD, ..."
    )


class Damping(Belief):
    """Belief about a device's viscous damping [N m s/rad | N s/m]."""

    value: NonNegative = Field(description="[N m s/rad | N s/m] Best estimate.")
    lower: NonNegative = Field(
        description="[N m s/rad | N s/m] Safe lower bound; the certificate relies on it."
    )
    source: Annotated[str, Field(min_length=1)] = Field(
        description="Where the numbers come from: identified, data sheet, ..."
    )


class Coulomb(Belief):
    """Belief about a device's Coulomb friction [N m | N]."""

    value: NonNegative = Field(description="[N m | N] Best estimate.")
    lower: NonNegative = Field(
        description="[N m | N] Safe lower bound; `passive_quantised` relies on it."
    )
    source: Annotated[str, Field(min_length=1)] = Field(
        description="Where the numbers come from: identified, data sheet, ..."
    )


class Compensation(Block):
    """What the motor compensates for, as shares of what the device is guaranteed to have."""

    coulomb: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.0,
        description="Share of `coulomb.lower` to compensate; walls can no longer rely on it.",
    )
    viscous: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.0,
        description="Share of `damping.lower` to compensate; walls, ports and "
        "couplings can no longer rely on it.",
    )
    inertia: Annotated[float, Field(ge=0, le=0.9)] = Field(
        default=0.0,
        description="Share of `inertia.lower` to compensate, by observed acceleration and limited "
        "by an energy account; needs `velocity_limit`.",
    )
    inertia_hz: Positive = Field(
        default=10.0,
        description="[Hz] Bandwidth of its observer; well below the coupling's natural frequency.",
    )
    inertia_coulomb: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.0,
        description="Share of `coulomb.lower` that covers the observer's lag; used up like "
        "`coulomb`, so their sum is at most 1.",
    )
    inertia_reserve: Positive | None = Field(
        default=None,
        description="[J] Initial and maximum energy of the account. Default: kinetic energy of "
        "the compensated inertia at `velocity_limit`.",
    )

    @property
    def friction(self) -> bool:
        """Return whether friction is compensated."""
        return self.coulomb > 0.0 or self.viscous > 0.0


class EffortSensor(Block):
    """A sensor of the effort between an impedance axis and what is outside it."""

    quantum: NonNegative = Field(default=0.0, description="[N m | N] Its step.")
    noise: NonNegative = Field(default=0.0, description="[N m | N] Standard deviation.")
    bandwidth_hz: Positive | None = Field(
        default=None, description="[Hz] Cut-off of its own first-order filter; default: none."
    )
    delay_s: NonNegative = Field(default=0.0, description="[s] Its delay, in whole periods.")
    offset: float = Field(default=0.0, description="[N m | N] Reading at zero effort; subtracted.")
    scale: Positive = Field(
        default=1.0, description="Reading per unit of effort; the reading is divided by it."
    )


def _expand_number(value: Any) -> Any:
    """`damping: 0.001` is short for value and lower bound alike."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return {"value": value, "lower": value, "source": "given"}
    return value


def _check_range(ends: tuple[float, float]) -> tuple[float, float]:
    if ends[0] >= ends[1]:
        raise PydanticCustomError(
            "order",
            "write the lower end first: {lowest} is not below {highest}",
            {"lowest": f"{ends[0]:g}", "highest": f"{ends[1]:g}"},
        )
    return ends


class Follower(Block):
    """A device that takes positions only: a goal, and a spring from it to the device."""

    stiffness: Positive = Field(
        description="[N m/rad | N/m] Felt effort per lag of the device behind its goal; up to "
        "`effort_limit`, where the goal waits for the device."
    )
    lag_s: NonNegative = Field(
        description="[s] Maximum mean lag of the device behind a goal moving at constant "
        "velocity; it must not overshoot."
    )


class Axis(Block):
    """One axis of a device: its bus, causality, believed parameters and limits."""

    bus: str = Field(description="Name of the bus in `buses`; here or in `defaults`.")
    id: Annotated[int, Field(ge=0)] = Field(description="The device's number on that bus.")
    kind: Literal["rotary", "linear"] = Field(
        description="Determines the units: rad, N m, kg m^2 or m, N, kg; here or in `defaults`."
    )
    joint: Annotated[str, Field(min_length=1)] | None = Field(
        default=None,
        description="Joint of the arm that the axis is; default: that of the same name, which for "
        "one of several arms may lack the arm's, as `j1` for axis `left_j1`.",
    )
    causality: Literal["impedance", "admittance"] = Field(
        default="impedance",
        description="impedance: commanded by effort; admittance: commanded by velocity, measures "
        "effort.",
    )
    inertia: Inertia | None = Field(
        default=None,
        description="[kg m^2 | kg] Required for impedance axes; not for admittance axes.",
    )
    damping: Annotated[Damping, BeforeValidator(_expand_number)] = Field(
        default=Damping(value=0.0, lower=0.0, source="given"),
        description="[N m s/rad | N s/m] A number, or value, lower and source.",
    )
    coulomb: Annotated[Coulomb, BeforeValidator(_expand_number)] = Field(
        default=Coulomb(value=0.0, lower=0.0, source="given"),
        description="[N m | N] Coulomb friction: a number, or value, lower and source. Required "
        "for a wall to pass `passive_quantised` with an encoder.",
    )
    compensation: Compensation | None = Field(
        default=None,
        description="Friction and inertia of an impedance axis that its motor compensates for.",
    )
    effort_sensor: EffortSensor | None = Field(
        default=None,
        description="Sensor for external effort on an impedance axis; recorded, and available to "
        "the coupling.",
    )
    effort_limit: Positive = Field(
        json_schema_extra=tuned("engaged"),
        description="[N m | N] Maximum effort commanded (or, for admittance, expected); here or "
        "in `defaults`.",
    )
    effort_rate_limit: Positive | None = Field(
        default=None,
        description="[N m/s | N/s] Maximum rate of change of effort. Hardware: required.",
    )
    velocity_limit: Positive | None = Field(
        default=None,
        description="[rad/s | m/s] The run stops above it. Hardware, admittance: required.",
    )
    position_range: Annotated[tuple[float, float], AfterValidator(_check_range)] | None = Field(
        default=None,
        description="[rad | m] Minimum and maximum position; outside, the axis is damped and the "
        "run stops. Hardware: required.",
    )
    mechanical_range: Annotated[tuple[float, float], AfterValidator(_check_range)] | None = Field(
        default=None,
        description="[rad | m] Positions of the device's end stops, which stop it whatever its "
        "motor does: an effort held without samples does work over their distance at most.",
    )
    stall_energy_j: Literal["auto"] | Positive | None = Field(
        default=None,
        description="[J] What the device may gain while the host stalls, if it is let go then: "
        "bounds the effort. auto: its kinetic energy at `velocity_limit`. Default: the same, where "
        "that leaves the whole effort at rest; else no bound.",
    )
    encoder_quantum: NonNegative = Field(default=0.0, description="[rad | m] Encoder step.")
    position_noise: NonNegative = Field(
        default=0.0, description="[rad | m] Standard deviation of the position noise."
    )
    position_noise_autocorrelation: Annotated[Autocorrelation, Field(max_length=LAGS)] | None = (
        Field(
            default=None,
            description="Colour of that noise: its autocorrelation from lag 1 on, in samples, as "
            "shares of the variance; beyond the last lag 0, [] is white. Default: "
            "unknown, so the worst case is assumed. `tautwave identify RECORDING "
            "--noise` measures it.",
        )
    )
    encoder_nonlinearity: Annotated[float, Field(ge=0, lt=1)] = Field(
        default=0.0,
        description="Maximum relative error of a small displacement reported by the encoder; a "
        "run cannot detect it, so its share of a port's energy output is stated "
        "separately.",
    )
    effort_quantum: NonNegative = Field(
        default=0.0, description="[N m | N] Resolution of the commanded or measured effort."
    )
    velocity_quantum: NonNegative = Field(
        default=0.0, description="[rad/s | m/s] Resolution of the commanded or measured velocity."
    )
    velocity_filter_s: NonNegative = Field(
        default=0.0, description="[s] Time constant of the velocity estimate's low-pass; 0: none."
    )
    load: Load | None = Field(
        default=None,
        description="Gravity load of an impedance axis that is not a joint of an `arm`.",
    )
    environment_stiffness_upper: NonNegative | None = Field(
        default=None,
        description="[N m/rad | N/m] Stiffest environment an admittance axis will touch; bounds "
        "its wave impedance from below.",
    )

    follower: Follower | None = Field(
        default=None,
        description="For an admittance axis whose device takes positions, such as a gripper or a "
        "hobby servo. No claim covers its effect on what it touches.",
    )

    @property
    def outside_stiffness(self) -> float:
        """Stiffest spring that an admittance port may meet [N m/rad | N/m], 0: none is stated."""
        if self.follower is not None:
            return self.follower.stiffness
        return self.environment_stiffness_upper or 0.0

    @property
    def held_bias(self) -> float:
        """Velocity [rad/s | m/s] that the tracker of a held axis estimates per unit of effort."""
        return 0.0 if self.inertia is None else self.velocity_filter_s / self.inertia.lower


class Side(Block):
    """`master` or `slave`."""

    axes: Annotated[dict[Name, Axis], Field(min_length=1)] = Field(
        description="The axes of this side by name."
    )
    defaults: dict[str, Any] = Field(
        default_factory=dict,
        exclude=True,
        description="Default keys for every axis of this side; an axis' own keys take precedence.",
    )
    arm: Arm | None = Field(
        default=None,
        description="The axes are the joints of a serial chain.",
    )
    arms: Annotated[dict[Name, Arm], Field(min_length=1)] | None = Field(
        default=None,
        description="Several arms by name, instead of `arm`: the axes whose names begin with "
        "`left_` are the joints of arm `left`.",
    )

    @model_validator(mode="after")
    def _check_arms(self) -> Self:
        if self.arm is not None and self.arms is not None:
            raise PydanticCustomError("order", "give either arm, or arms by name")
        return self


Pixels = Annotated[int, Field(ge=16, le=8192, multiple_of=2)]


class Camera(Block):
    """A camera, read by a process of its own into `camera-NAME.mcap` of the run directory."""

    driver: Literal["v4l2", "synthetic"] = Field(
        default="v4l2",
        description="A camera of this machine (Video4Linux), or synthetic pictures of a moving "
        "bar.",
    )
    device: Annotated[str, Field(pattern="^/dev/")] = Field(
        default="/dev/video0", description="Device of a camera; not used by `synthetic`."
    )
    width: Pixels = Field(default=640, description="Width in pixels; even.")
    height: Pixels = Field(default=480, description="Height in pixels; even.")
    fps: Annotated[Positive, Field(le=1000)] = Field(
        default=30.0, description="[Hz] Requested frame rate."
    )
