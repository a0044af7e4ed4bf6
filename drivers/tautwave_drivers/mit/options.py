"""Options of a bus of MIT motors: the `options` block of a rig file, and what it means."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from math import ceil
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, Field

from tautwave.contracts import AxisFacts, AxisSpec, BusSpec
from tautwave.errors import ConfigError
from tautwave.types import Damper
from tautwave_drivers.can.ids import unlisted, unused
from tautwave_drivers.can.keys import CanKeys
from tautwave_drivers.mit import damiao

Positive = Annotated[float, Field(gt=0.0)]
StandardId = Annotated[int, Field(ge=1, le=0x7FF)]

MAX_ROBSTRIDE_ID, MAX_HOST = 127, 0xFD
"""Ids of RobStride's motors, and of their host: beyond it are broadcasts."""

MIN_PERIODS = 3
"""Of the bus, that a motor's own watchdog has to wait: one late frame is no fault."""


class Motor(BaseModel):
    """One motor: its ids, and the ranges that its codes stand for."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    id: StandardId
    """ESC_ID, register 8: what it listens to. RobStride: its id, up to 127."""
    feedback_id: StandardId
    """MST_ID, register 7: what it answers with; its own, and not 0. RobStride: the id of the host,
    such as 0xFD, the same for all."""
    p_max: Positive
    """[rad] PMAX, register 21; compared. RobStride: the model's, held against its position."""
    v_max: Positive
    """[rad/s] VMAX, register 22; compared. RobStride: the model's, of records only."""
    t_max: Positive
    """[N m] TMAX, register 23; compared. RobStride: the model's, held against its torque limit."""
    direction: Literal[1, -1] = 1
    """-1 where the motor turns against the axis."""
    zero: float = 0.0
    """[rad] Position of the motor where the axis is at 0."""
    damping: Annotated[float, Field(ge=0.0, le=5.0)] = 0.0
    """[N m s/rad] Damper in the motor (kd), felt in every motion; it acts at the motor's own rate,
    so the host's walls can be stiffer. Steps of 5/4095."""
    damped: Literal["always", "at_wall"] = "always"
    """When: always, or only near and in a local wall of its axis; then it is not felt elsewhere."""
    velocity_filter_hz: Positive | None = None
    """[Hz] V_BW, register 32: the low-pass of the velocity that the damper has; compared. Needed
    with `damping`."""

    @property
    def damping_code(self) -> int:
        """The code of kd."""
        return round(self.damping / damiao.DAMPING_STEP)


class MitOptions(CanKeys):
    """Options of a bus of MIT motors."""

    family: Literal["damiao", "robstride"] = "damiao"
    """Whose frames and registers: Damiao's MIT frames, or RobStride's private protocol."""
    watchdog_s: Annotated[float, Field(ge=0.001, le=10.0)] = 0.1
    """[s] TIMEOUT, register 9: a motor that hears nothing for that long switches its torque off.
    Written at every start, until its power is switched off. RobStride: its CAN timeout, 0x7028."""
    clear_errors: bool = False
    """Clear an error that a motor reports at the start."""
    reserve: Annotated[float, Field(ge=0.0, le=0.5)] = 0.0
    """Share of the bus kept for others in the budget."""
    motors: Annotated[tuple[Motor, ...], Field(min_length=1, strict=False)]
    simulator: dict[str, Any] = Field(default_factory=dict)
    """The simulator's own keys; a driver of hardware ignores them."""


class Scale(NamedTuple):
    """What one code of a motor is at the axis: [rad], [rad/s], [N m], each with its middle.

    `push`: codes of torque by which the damper pushes at rest, as no code of velocity is zero.
    """

    position: float
    velocity: float
    torque: float
    zero: float
    direction: int
    damping_code: int = 0
    push: float = 0.0

    def position_of(self, code: int) -> float:
        """Return the axis' position [rad]."""
        at_motor = (code - 0.5 * damiao.POSITION_TOP) * self.position
        return self.direction * (at_motor - self.zero)

    def velocity_of(self, code: int) -> float:
        """Return the axis' velocity [rad/s]."""
        return self.direction * (code - 0.5 * damiao.TOP) * self.velocity

    def torque_of(self, code: int) -> float:
        """Return the torque on the axis [N m]."""
        return self.direction * (code - 0.5 * damiao.TOP) * self.torque

    def coder(self, limit: float) -> Callable[[float, bool], int]:
        """Return what makes the code of an effort [N m] of at most `limit`, quick in every cycle.

        No code is zero: multiples of a step lie between two codes. Of these it is the `upper` one
        or the lower one, so that who alternates has the multiple as the mean.
        """
        direction, step, push, top = self.direction, self.torque, self.push, damiao.TOP
        middle = 0.5 * top

        def code_of(effort: float, upper: bool) -> int:
            if not -limit <= effort <= limit:  # NaN too
                effort = limit if effort > limit else -limit if effort < -limit else 0.0
            # A multiple of a step is half a code above one; the upper is taken from a quarter on.
            code = ceil(middle + direction * effort / step - push - (0.25 if upper else 0.75))
            return code if 0 <= code <= top else top if code > 0 else 0

        return code_of


def scale_of(motor: Motor) -> Scale:
    """Return the scale of a motor with the ranges that its block states."""
    code = motor.damping_code
    pace, force = 2.0 * motor.v_max / damiao.TOP, 2.0 * motor.t_max / damiao.TOP
    at_rest = (damiao.V_ZERO - 0.5 * damiao.TOP) * pace * code * damiao.DAMPING_STEP
    return Scale(
        2.0 * motor.p_max / damiao.POSITION_TOP,
        pace,
        force,
        motor.zero,
        motor.direction,
        code,
        at_rest / force,
    )


def damper_of(motor: Motor) -> Damper | None:
    """Return the damper in a motor as a certificate takes it, None without one."""
    damping = motor.damping_code * damiao.DAMPING_STEP
    if damping == 0.0 or motor.velocity_filter_hz is None:
        return None
    return Damper(
        damping,
        1.0 / (math.tau * motor.velocity_filter_hz),
        damiao.LOOP_S,
        damiao.LOOP_LATE,
        0.5 * scale_of(motor).torque,
        f"{damiao.V_BANDWIDTH} of motor {motor.id} is the low-pass of its damper's velocity, in Hz",
        motor.damped == "at_wall",
    )


def motors_of(options: MitOptions, bus: BusSpec) -> list[Motor]:
    """Return the motor of each axis, in the order of the axes.

    Raises
    ------
    ConfigError
        The block and the rig's axes do not match.
    """
    problems = [f"bus {bus.name}: {text}" for text in _ids_problems(options)]
    known = {motor.id: motor for motor in options.motors}
    least_s = MIN_PERIODS / bus.rate_hz
    if options.watchdog_s < least_s:
        problems.append(
            f"bus {bus.name}: watchdog_s {options.watchdog_s:g} is less than {MIN_PERIODS} "
            f"periods, so a late frame would switch the motors off; use at least {least_s:.3g}"
        )
    for axis in bus.axes:
        motor = known.get(axis.device_id)
        if motor is None:
            needed = "the ranges that `tautwave scan mit` shows"
            problems.append(unlisted(bus, axis, "motor", known, needed))
        elif problem := (
            _robstride_problem(motor) if options.family == "robstride" else ""
        ) or _axis_problem(axis, motor):
            problems.append(f"bus {bus.name}: {axis.name}{problem}")
    problems += unused(bus, "motor", known)
    if problems:
        raise ConfigError(problems)
    return [known[axis.device_id] for axis in bus.axes]


def _robstride_problem(motor: Motor) -> str:
    """Return what of a motor is not for RobStride's frames, '' if all is."""
    if motor.damping > 0.0:
        return (
            f": motor {motor.id} has damping, but RobStride's firmware may take it for 1.4167 "
            "times as much and does not say which it is; remove damping"
        )
    if motor.id > MAX_ROBSTRIDE_ID:
        return f": motor {motor.id}: RobStride's ids end at {MAX_ROBSTRIDE_ID}; use its own"
    return ""


def _robstride_bus(options: MitOptions) -> list[str]:
    """Return what is wrong with a bus of RobStride motors."""
    problems = []
    if options.data_bitrate is not None:
        problems.append("RobStride's motors speak classic CAN only; remove data_bitrate")
    hosts = sorted({motor.feedback_id for motor in options.motors})
    if len(hosts) > 1 or not hosts[0] <= MAX_HOST:
        problems.append(
            "feedback_id of RobStride's motors is the host's id, one for all of them and at most "
            f"{MAX_HOST:#x}; use 0xFD (got {', '.join(map(hex, hosts))})"
        )
    return problems


def _ids_problems(options: MitOptions) -> list[str]:
    """Return what is wrong with the ids of a bus."""
    ids = [motor.id for motor in options.motors]
    if options.family == "robstride":
        return [
            *(f"motor {n} is listed twice in options.motors" for n in {*ids} if ids.count(n) > 1),
            *_robstride_bus(options),
        ]
    feedback = [motor.feedback_id for motor in options.motors]
    heard = {offset + number: number for number in ids for offset in damiao.OFFSETS}
    problems = [
        f"motor {number} is listed twice in options.motors"
        for number in sorted({one for one in ids if ids.count(one) > 1})
    ]
    problems += [
        f"two motors have feedback_id {number:#x}; give each its own (MST_ID, register 7, in the "
        "maker's tool), such as its id + 16"
        for number in sorted({one for one in feedback if feedback.count(one) > 1})
    ]
    for motor in options.motors:
        if motor.feedback_id == damiao.PARAMETERS or motor.feedback_id in heard:
            to = heard.get(motor.feedback_id)
            why = "is that of register frames" if to is None else f"is a command to motor {to}"
            problems.append(
                f"motor {motor.id} answers with {motor.feedback_id:#x}, which {why}; give it "
                "another MST_ID (register 7) in the maker's tool, such as its id + 16"
            )
    return problems


def _axis_problem(axis: AxisSpec, motor: Motor) -> str:
    """Return what of an axis does not go with its motor, '' if all does."""
    if axis.kind != "rotary" or axis.causality != "impedance":
        return (
            f" is {axis.kind}, {axis.causality}; these motors take effort: use kind: rotary, "
            "causality: impedance"
        )
    if axis.effort_sensor:
        return " has an effort_sensor, but these motors read none; remove it"
    if motor.damping > 0.0 and motor.velocity_filter_hz is None:
        return (
            f": motor {motor.id} has damping {motor.damping:g}, but no velocity_filter_hz; write "
            "what its register V_BW(32) reads, as `tautwave scan mit` shows it"
        )
    most = axis.effort_limit + motor.damping * axis.velocity_limit
    if motor.damping > 0.0 and not most <= motor.t_max:
        return (
            f": effort_limit and damping {motor.damping:g} at velocity_limit "
            f"{axis.velocity_limit:g} make {most:.4g} N m, more than motor {motor.id} gives, t_max "
            f"{motor.t_max:g}, where its damper would fail; lower one of them"
        )
    if axis.effort_limit > motor.t_max and math.isfinite(axis.effort_limit):
        return (
            f": effort_limit {axis.effort_limit:g} is more than motor {motor.id} accepts, "
            f"t_max {motor.t_max:g}; lower effort_limit"
        )
    ends = [motor.zero + motor.direction * end for end in axis.position_range]
    if all(math.isfinite(end) for end in ends) and max(map(abs, ends)) >= motor.p_max:
        return (
            f": position_range reaches {max(ends, key=abs):.4g} rad of motor {motor.id}, whose "
            f"positions end at p_max {motor.p_max:g}; narrow position_range, or correct zero"
        )
    return ""


def facts(options: MitOptions, bus: BusSpec) -> Sequence[AxisFacts]:
    """Return the steps of each axis' position and effort [rad], [N m], and its motor's damper."""
    by_axis = []
    for motor in motors_of(options, bus):
        scale = scale_of(motor)
        torque = scale.torque
        if options.family == "robstride":
            torque = 2.0 * motor.t_max / damiao.POSITION_TOP  # 16 bits as well
        by_axis.append(AxisFacts(scale.position, torque, 0.0, damper_of(motor)))
    return by_axis
