"""A rig stepped by a program that simulates the devices of some axes itself."""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from typing import Any, Self, SupportsFloat

import numpy as np

from tautwave.config import Rig, axis_damper
from tautwave.errors import ConfigError, TautwaveError
from tautwave.rig import build_rig
from tautwave.runtime.loop import Loop, LoopResult
from tautwave.simulation.memory import KeptRows
from tautwave.simulation.rows import Simulation


class Stepper:
    """The control loop of a rig, one cycle per call; axes named `outside` are moved by the caller.

    Drives, encoders, delays and the controller are those of `tautwave run`: only the physics of an
    outside axis is left to the caller. Use it in a `with` block, which on exit leaves every axis
    without effort and closes the buses.

    Parameters
    ----------
    rig : Rig
        A checked rig with a `simulation` block.
    outside : str or sequence of str
        Axes, such as `slave.lever`, or sides, `slave`; impedance axes on simulated buses, without a
        damper in the motor.
    clock : str
        `fake`: a call takes as long as it takes. `real`: it waits for the next period, for example
        with a real master in a user's hand.
    duration_s : float, optional
        Length [s]; the rig's own if not given.

    Attributes
    ----------
    period_s : float
        Of a cycle [s].
    outside : tuple of str
        The axes, in the rig's order.

    Raises
    ------
    ConfigError
        The rig has no simulation, an axis cannot be outside, or clock or length are invalid.

    Examples
    --------
    >>> with Stepper(rig) as stepper:  # doctest: +SKIP
    ...     efforts = stepper.step({"slave.lever": 0.0})
    ...     while stepper.running:
    ...         position = my_world.advance(efforts["slave.lever"], stepper.period_s)
    ...         efforts = stepper.step({"slave.lever": position})
    """

    def __init__(
        self,
        rig: Rig,
        *,
        outside: str | Sequence[str] = ("slave",),
        clock: str = "fake",
        duration_s: float | None = None,
    ) -> None:
        if rig.simulation is None:
            raise ConfigError(
                f"{rig.name}: a stepped rig needs a simulation block, which may be empty"
            )
        # Simulated devices end with this process, watched or not.
        built = build_rig(rig, clock=clock, duration_s=duration_s, allow_unwatched=True)
        self.period_s = rig.period_s
        self._simulators = built.simulators
        axes = {axis.name: axis for world in built.simulators for axis in _axes(world)}
        wanted = (outside,) if isinstance(outside, str) else outside
        self.outside = _chosen(rig, wanted, list(axes))
        self._axes = {name: axes[name] for name in self.outside}
        self._worlds = {name: _given(name, axis) for name, axis in self._axes.items()}
        self._columns = tuple(built.columns)
        self._sink = KeptRows(len(self._columns))
        loop = Loop(built.clock, built.buses, built.control, built.sources, self._sink)
        self._steps: Generator[None, None, LoopResult] = loop.steps()
        self._begun = self._closed = False
        self._result: LoopResult | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.close()

    @property
    def running(self) -> bool:
        """Whether there are cycles left."""
        return self._result is None and not self._closed

    def step(
        self,
        positions: Mapping[str, SupportsFloat],
        velocities: Mapping[str, SupportsFloat] | None = None,
    ) -> dict[str, float]:
        """Run one cycle, and return the efforts that act until the next.

        Parameters
        ----------
        positions : mapping
            Where each axis outside is now [rad or m]. Its encoder sees it with its quantum and
            noise.
        velocities : mapping, optional
            How fast it moves [rad/s or m/s]: recorded as its truth, and not used otherwise.
            One-element arrays, as MuJoCo returns for a joint, are accepted too.

        Returns
        -------
        dict
            Mean effort of each motor until the next call [N m or N], positive along the position;
            0 once the run has ended.

        Raises
        ------
        ConfigError
            A position is missing or not a finite number, a name is not an outside axis, or the run
            has already ended.
        TautwaveError
            The cause of an early end, such as a limit.
        """
        if self._result is not None or self._closed:
            raise ConfigError("the run has ended; create a new Stepper")
        places = self._numbers(positions, "rad or m")
        rates = {} if velocities is None else self._numbers(velocities, "rad/s or m/s")
        for name, world in self._worlds.items():
            if name not in places:
                raise ConfigError(f"step: {name} needs a position, a finite number of rad or m")
            world.place(places[name], rates.get(name, 0.0))
            if not self._begun:
                world.step(0.0, 0.0, 0.0, 0.0)
        self._begun = True
        try:
            next(self._steps)
        except StopIteration as ended:
            self._end(ended.value)
            return dict.fromkeys(self.outside, 0.0)
        return {name: axis.acting() for name, axis in self._axes.items()}

    def _numbers(self, given: Mapping[str, SupportsFloat], unit: str) -> dict[str, float]:
        """Return what a program gives of axes outside as numbers; refuse what is none."""
        if not isinstance(given, Mapping):
            raise ConfigError(f"step: a mapping from axes to {unit} (got {type(given).__name__})")
        numbers = {}
        for name, value in given.items():
            if name not in self._worlds:
                raise ConfigError(
                    f"step: {name} is not an outside axis; axes: {', '.join(self.outside)}"
                )
            try:
                number = float(np.asarray(value, dtype=np.float64).item())
            except (TypeError, ValueError):
                number = np.nan
            if not np.isfinite(number):
                raise ConfigError(f"step: {name}: one finite number of {unit} (got {value!r})")
            numbers[name] = number
        return numbers

    @property
    def rows(self) -> Simulation:
        """The rows so far, as `simulate` returns them."""
        data = np.array(self._sink.kept, dtype=np.float64).reshape(-1, len(self._columns))
        error = None if self._result is None else self._result.error
        return Simulation(self._columns, data, error if isinstance(error, TautwaveError) else None)

    def close(self) -> None:
        """Leave every axis without effort; idempotent."""
        self._closed = True
        self._steps.close()
        for simulator in self._simulators:
            simulator.close()
        self._simulators = ()

    def _end(self, result: LoopResult) -> None:
        self._result = result
        if result.error is not None:
            raise result.error


def _axes(world: Any) -> Sequence[Any]:
    return [axis for axis in getattr(world, "axes", ()) if hasattr(axis, "give_over")]


def _given(name: str, axis: Any) -> Any:
    world = axis.give_over()
    if world is None:
        raise ConfigError(
            f"outside: {name} is a joint of a simulated arm, whose joints move together; remove "
            f"the arm from simulation.{name.partition('.')[0]}"
        )
    return world


def _chosen(rig: Rig, outside: Sequence[str], simulated: Sequence[str]) -> tuple[str, ...]:
    """Return the axes that are outside, in the rig's order."""
    known = [f"{side}.{name}" for side in ("master", "slave") for name in getattr(rig, side).axes]
    for one in outside:
        if one not in known and one not in ("master", "slave"):
            raise ConfigError(f"outside: {one} is no axis of {rig.name}; axes: {', '.join(known)}")
    chosen = [name for name in known if name in outside or name.partition(".")[0] in outside]
    for name in chosen:
        side, _, axis = name.partition(".")
        if getattr(rig, side).axes[axis].causality != "impedance":
            raise ConfigError(
                f"outside: {name} is an admittance axis, which needs a force to measure; only "
                "impedance axes can be outside"
            )
        bus = getattr(rig, side).axes[axis].bus
        if rig.buses[bus].divisor != 1:
            raise ConfigError(
                f"outside: {name} is on bus {bus}, which is served every {rig.buses[bus].divisor} "
                "cycles; an axis outside is served every cycle (divisor: 1)"
            )
        if axis_damper(rig, name) is not None:
            # At a call only motion that is over is known: a damper of that is a period late, which
            # is not the one that the certificate counts on.
            raise ConfigError(
                f"outside: {name} has a damper in its motor, which acts between two steps, so no "
                f"effort of a step has it; remove damping from the options of bus {bus!r}, or "
                "leave the axis to the rig's simulation"
            )
        if name not in simulated:
            raise ConfigError(f"outside: the bus of {name} is real, not simulated here")
    if not chosen:
        raise ConfigError("outside: name at least one axis")
    return tuple(chosen)
