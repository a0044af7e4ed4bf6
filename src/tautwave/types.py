"""Values that cross the contract edges. SI units; rotary axes read N m for N and rad for m."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

VOLUNTARY_HZ = 8.0
"""Hands move by will below this [Hz]."""

UNDO_PAYLOAD = "back"
"""What the command `payload` takes beside names: it undoes the last change."""


class JointState(NamedTuple):
    """What a driver measured on one axis.

    `position` [rad or m]; `velocity` [rad/s or m/s] and `effort` [N m or N] are NaN where the
    device does not measure them. No law takes the velocity: they rest on differences of positions.
    `effort` is the external force (hand, environment) on the device, positive along `position`.
    `valid` is False when no fresh sample came in this cycle; the numbers are then not to be used.
    `age_ns` is the time since the sample.
    """

    position: float
    velocity: float
    effort: float
    valid: bool
    age_ns: int


class AxisCommand(NamedTuple):
    """Command of one axis until the next one.

    `effort` [N m or N] is used by impedance axes, `velocity` [rad/s or m/s] by admittance axes,
    both positive along `position`; the other one is 0. A device that takes positions goes to
    `position` [rad or m]; NaN: it stays where it is. `damping` [N m s/rad or N s/m] is that of a
    damper in the motor whose `Damper` is `commanded`, until the next command: its own or 0.
    """

    effort: float
    velocity: float
    position: float = math.nan
    damping: float = 0.0


class CommandDelay(NamedTuple):
    """Time until a written command acts: whole bus periods and a remainder [s] below one."""

    periods: int
    remainder_s: float


class Fault(NamedTuple):
    """A fault that a device or a bus reported, as text. `axis` is '' for the whole bus."""

    axis: str
    text: str
    fatal: bool


SAFE_COMMAND = AxisCommand(0.0, 0.0)
"""Zero effort for an impedance axis, zero velocity for an admittance axis."""


class Damper(NamedTuple):
    """A damper in a device's motor, which acts between the host's samples; SI of its axis.

    It resists with `damping` times the velocity as the motor has it: sampled every `loop_s`, behind
    a low-pass of time constant `filter_s`, and acting `late` loops after the sample. `bias` is the
    greatest effort that it makes at rest, `assumed` what of this no device confirms: a clause.
    `commanded`: it acts only while commands say so; else always.
    """

    damping: float
    filter_s: float
    loop_s: float
    late: float
    bias: float
    assumed: str = ""
    commanded: bool = False


class BusElement(NamedTuple):
    """A verdict of a driver on what its own laws do with an axis: `passed`, why, conditions.

    `kind` is a word for tables, `axis` a full name, `numbers` what was computed.
    """

    name: str
    kind: str
    axis: str
    passed: bool
    sentence: str
    conditions: tuple[str, ...]
    numbers: Mapping[str, float]
    margin: float | None = None


class Imposed(NamedTuple):
    """A recorded motion that an axis is forced along; the columns of `file` by name.

    `scale` and `offset` turn the column into rad or m.
    """

    file: str
    position: str
    time_column: str = "time_s"
    scale: float = 1.0
    offset: float = 0.0
    repeat: bool = True
    time_unit: str | None = None
    rate_hz: float | None = None
    columns: tuple[str, ...] = ()
    episode: int | None = None


class Choice(NamedTuple):
    """What a law takes for a key that a rig leaves to it, and why, without a full stop."""

    value: Any
    reason: str


class Setting(NamedTuple):
    """A value for a rig file, and what is written beside it; `TODO` where only a person knows."""

    value: Any
    comment: str = ""


class Hexadecimal(int):
    """A whole number that people know in hexadecimal, and that a rig file has as such."""

    def __repr__(self) -> str:
        return f"0x{self:X}"


class FoundDevice(NamedTuple):
    """A device that answered: its entry in the options of its bus, and keys of an axis on it."""

    id: int
    name: str
    options: Mapping[str, Any]
    axis: Mapping[str, Setting]


class FoundBus(NamedTuple):
    """A bus for a rig file; the `devices` are listed in its options under `listed_as`."""

    name: str
    driver: str
    options: Mapping[str, Setting]
    listed_as: str
    devices: Sequence[FoundDevice]
    notes: Sequence[str] = ()


class Survey(NamedTuple):
    """How a driver makes parts of a rig file.

    `places()` returns options of its scan, one mapping a bus that this machine could reach;
    `propose(scan_options, rows)`, pure, turns what a scan found into buses; `describe(path, ids)`
    makes one of a file of the kind `file`, such as `eds`, without any device.
    """

    places: Callable[[], Sequence[Mapping[str, Any]]]
    propose: Callable[[Any, Sequence[Mapping[str, Any]]], Sequence[FoundBus]]
    describe: Callable[[Path, Sequence[int]], FoundBus] | None = None
    file: str = ""
