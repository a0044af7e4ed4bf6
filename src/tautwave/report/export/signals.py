"""Signals of a dataset: what each is called, its unit, and of which columns of a run it is made.

A slave's target is in its own coordinates: (master - offset) x position_scale x sign,
with the offset of that engagement and the live scale. A row has it as the slave's position plus
the pair's position error in the slave's units, so no offset has to be recorded beside it.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Mapping
from typing import Any, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from tautwave.runtime.operate.states import ENGAGED, STATES

STATE = "operation.state"
SCALE = "operation.scale"
INTERVENTION = "operation.intervention"
TARGET = "target"
"""Last part of the column that a table gets: `slave.AXIS.target`."""
LEADER = "leader"
"""Feature that no policy takes for an input or an action: neither `observation.` nor `action`."""
EFFORT = {"rotary": "torque", "linear": "force"}

Value = TypeVar("Value", float, npt.NDArray[np.float64])


class Signal(NamedTuple):
    """One number of a frame: `base` + `ratio` x `column`, the ratio times the live scale.

    `name` is what a dataset calls it, `unit` that of SI. A `ratio` of None takes the column as it
    is.
    """

    name: str
    unit: str
    column: str
    base: str = ""
    ratio: float | None = None

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns it needs; the live scale is optional."""
        return (self.base, self.column) if self.base else (self.column,)

    def of(self, row: Mapping[str, Value]) -> Value:
        """Return its value from columns by name, one row or many."""
        value = row[self.column]
        if self.ratio is not None:
            value = self.ratio * row[SCALE] * value if SCALE in row else self.ratio * value
        return row[self.base] + value if self.base else value

    @property
    def pair(self) -> str:
        """Name of the pair that an action is of."""
        return self.column.rpartition(".")[0]

    def master_of(self, value: float, row: Mapping[str, float]) -> float:
        """Return the master position for which an action is `value` [rad or m], by a row of now."""
        ratio = (self.ratio or 1.0) * row.get(SCALE, 1.0)
        return row[f"master.{self.pair}.position"] + (value - self.of(row)) / ratio

    def __str__(self) -> str:
        if self.ratio is None:
            return f"`{self.column}`"
        base = f"`{self.base}` + " if self.base else ""
        return f"{base}{self.ratio:g} x `{self.column}`"


class Signals(NamedTuple):
    """Signals of a dataset by feature, the columns that say whether a sample came, cameras.

    `valid` are columns that are 0 where an axis had no sample, and others keep what was before.
    `led`: by a policy, until a person takes over.
    """

    robot: str
    action: tuple[Signal, ...]
    state: tuple[Signal, ...]
    leader: tuple[Signal, ...]
    valid: tuple[str, ...]
    cameras: tuple[str, ...] = ()
    led: bool = False

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns that all of them need, each once."""
        each = itertools.chain.from_iterable(self.features.values())
        names = [column for one in each for column in one.columns]
        return tuple(dict.fromkeys([*names, *self.valid]))

    @property
    def features(self) -> dict[str, tuple[Signal, ...]]:
        """Signals by the name of their feature."""
        return {"action": self.action, "observation.state": self.state, LEADER: self.leader}

    def alike(self, other: Signals) -> bool:
        """Return whether runs can be one dataset: robot, names, units and cameras are the same."""
        mine, theirs = (
            [(key, one.name, one.unit) for key, each in dataset.features.items() for one in each]
            for dataset in (self, other)
        )
        return (self.robot, self.cameras, mine) == (other.robot, other.cameras, theirs)


def target(pair: str, ratio: float, name: str, unit: str) -> Signal:
    """Return where a pair wants its slave [slave's rad or m]."""
    return Signal(name, unit, f"{pair}.position_error", f"slave.{pair}.position", ratio)


def targets(
    axes: Mapping[str, Mapping[str, Any]], ratios: Mapping[str, float], present: Collection[str]
) -> list[Signal]:
    """Return the columns `slave.AXIS.target` that a table of these columns gets.

    Parameters
    ----------
    axes : mapping
        Keys of each axis by its full name, such as `slave.lever`.
    ratios : mapping
        Slave motion per master motion of each pair, with its sign.
    present : collection of str
        Columns of the recording.
    """
    columns = []
    for pair, ratio in ratios.items():
        unit = "m" if axes.get(f"slave.{pair}", {}).get("kind") == "linear" else "rad"
        one = target(pair, ratio, f"slave.{pair}.{TARGET}", unit)
        if all(column in present for column in one.columns):
            columns.append(one)
    return columns


def signals(
    robot: str,
    axes: Mapping[str, Mapping[str, Any]],
    ratios: Mapping[str, float],
    velocities: bool,
) -> Signals:
    """Return what the slave was asked to be, what it felt, and where its leader was: all axes.

    The action is the slave's position as the pairs want it (with `velocities` these too), in the
    slave's coordinates: a replay commands it. Position, velocity and effort of the slave's motors
    are the observation. Effort is what the slave was commanded, on an admittance axis what it
    measured; a follower's position is where it was measured, not its goal. `leader` is the
    master's own position, in its coordinates.

    Parameters
    ----------
    robot : str
        The rig's name.
    axes : mapping
        `kind`, `causality` and `follower` of each axis by its full name, such as `master.lever`.
    ratios : mapping
        Slave motion per master motion of each pair, with its sign.
    velocities : bool
        Whether velocities are part of the action.
    """
    action: list[Signal] = []
    state: list[Signal] = []
    leader: list[Signal] = []
    for axis, block in axes.items():
        side, _, name = axis.partition(".")
        linear = block.get("kind") == "linear"
        length = "m" if linear else "rad"
        if side == "master":
            leader.append(Signal(f"{name}.pos", length, f"{axis}.position"))
            continue
        if (ratio := ratios.get(name)) is not None:
            action.append(target(name, ratio, f"{name}.pos", length))
            if velocities:
                moved = f"master.{name}.velocity"
                action.append(Signal(f"{name}.vel", f"{length}/s", moved, ratio=ratio))
        place = "followed" if block.get("follower") else "position"
        effort = "measured_effort" if block.get("causality") == "admittance" else "commanded"
        state += [
            Signal(f"{name}.pos", length, f"{axis}.{place}"),
            Signal(f"{name}.vel", f"{length}/s", f"{axis}.velocity"),
            Signal(
                f"{name}.{EFFORT['linear' if linear else 'rotary']}",
                "N" if linear else "N m",
                f"{axis}.{effort}",
            ),
        ]
    valid = tuple(f"{axis}.valid" for axis in axes)
    return Signals(robot, tuple(action), tuple(state), tuple(leader), valid)


def engaged(states: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
    """Return which rows of the column `operation.state` are those of an engaged rig."""
    return np.equal(states, STATES.index(ENGAGED))
