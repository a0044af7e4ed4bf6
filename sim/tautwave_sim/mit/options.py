"""Options of simulated MIT motors: the keys of the bus that they need, and their own."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from tautwave_sim.wire.can_faults import CanFaults

Positive = Annotated[float, Field(gt=0.0)]
AtSeconds = Annotated[float, Field(ge=0.0)]
LAST_REGISTER, FIRST_ERROR, LAST_STATE = 81, 8, 15
"""Of Damiao's motors: the last register, the first state that is an error, the last state."""
Listed = Field(strict=False)
"""A rig file is read as JSON: it has lists for tuples and text for the keys of a mapping."""


class _Keys(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class _Shared(BaseModel):
    """The driver's model of the same block is the strict one; here only what is needed is read."""

    model_config = ConfigDict(extra="ignore", strict=True, frozen=True, allow_inf_nan=False)


class Quirks(_Keys):
    """How one motor differs, or misbehaves. Times are [s] after the motors began to move."""

    registers: dict[Annotated[int, Field(ge=0, le=0xFFFF), Listed], float] = Field(
        default_factory=dict
    )
    """Saved values of registers by number, such as 9 for TIMEOUT; others follow the options.
    RobStride: of its parameters, such as 0x700B for its torque limit."""
    turns: Annotated[int, Field(ge=-3, le=3)] = 0
    """Whole turns by which its position is off after power-up."""
    starts_with: Annotated[int, Field(ge=0, le=0x3F)] = 0
    """Its state after power-up, such as 9 for under-voltage. RobStride: its faults, as bits."""
    drops_register_answers: Annotated[int, Field(ge=0)] = 0
    """It leaves out every n-th answer about a register; 0: none."""
    ignores_timeout: bool = False
    """A write to TIMEOUT is answered and has no effect."""
    silent_at_s: AtSeconds | None = None
    """From then on it sends and hears nothing, as without supply."""
    restarts_at_s: AtSeconds | None = None
    """Its supply dips then: it starts anew, with what was saved."""
    error_at_s: AtSeconds | None = None
    """It has the error `error` then, and switches its torque off."""
    error: Annotated[int, Field(ge=1, le=0x3F)] = 8
    """A state: 8 over-voltage, 9 under-voltage, 10 over-current, 11, 12 too hot, 14 overload.
    RobStride: bits, 1 under-voltage, 2 over-current, 4 too hot, 8 encoder, 16 overload."""
    derates_at_s: AtSeconds | None = None
    """From then on it gives no more torque than `derated_to`, without reporting it."""
    derated_to: Annotated[float, Field(ge=0.0)] = 0.0
    """[N m] See `derates_at_s`."""
    heat: Annotated[float, Field(ge=0.0)] = 1.0
    """Heating of its rotor, as a multiple of the usual."""


class SimulatorKeys(_Keys):
    """The `simulator` block in the options of a bus of MIT motors."""

    faults: CanFaults = CanFaults()
    motors: dict[Annotated[int, Listed], Quirks] = Field(default_factory=dict)
    """By motor id; one that is not listed behaves."""
    free: bool = False
    """Time runs from the first enabling on, in slots of the bus' period."""
    queue: Annotated[int, Field(ge=1)] = 32
    """Frames that the master's queue holds (txqueuelen)."""


class MotorKeys(_Shared):
    """One motor."""

    id: Annotated[int, Field(ge=1, le=0x7FF)]
    feedback_id: Annotated[int, Field(ge=0, le=0x7FF)]
    p_max: Positive
    v_max: Positive
    t_max: Positive
    direction: Literal[1, -1] = 1
    zero: float = 0.0
    velocity_filter_hz: Positive | None = None


class SimulatedMitOptions(_Shared):
    """Options of a bus of MIT motors, as far as its simulated motors need them."""

    interface: str = "socketcan"
    channel: str = "can0"
    bitrate: Annotated[int, Field(gt=0)] = 1_000_000
    data_bitrate: Annotated[int, Field(gt=0)] | None = None
    family: Literal["damiao", "robstride"] = "damiao"
    motors: Annotated[tuple[MotorKeys, ...], Listed]
    simulator: SimulatorKeys = SimulatorKeys()

    @model_validator(mode="after")
    def _motors_exist(self) -> SimulatedMitOptions:
        for number, quirks in self.simulator.motors.items():
            here = f"simulator.motors.{number}"
            states = LAST_STATE if self.family == "damiao" else 0x3F
            if self.family == "damiao" and max(quirks.registers, default=0) > LAST_REGISTER:
                raise ValueError(f"{here}: registers end at {LAST_REGISTER}")
            if max(quirks.starts_with, quirks.error) > states:
                raise ValueError(f"{here}: states end at {states}")
            if self.family == "damiao" and quirks.error < FIRST_ERROR:
                raise ValueError(f"{here}: error begins at {FIRST_ERROR}, over-voltage")
        unknown = sorted(set(self.simulator.motors) - {motor.id for motor in self.motors})
        if unknown:
            raise ValueError(f"simulator.motors names motor {unknown[0]}, not listed in motors")
        return self
