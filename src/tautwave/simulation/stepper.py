"""A rig stepped by a program, which is the world of some of its axes: a simulator of its own."""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from typing import Any, Self, SupportsFloat

import numpy as np

from tautwave.config import Rig
from tautwave.errors import ConfigError, TautwaveError
from tautwave.rig import build_rig
from tautwave.runtime.loop import Loop, LoopResult
from tautwave.simulation.rows import Simulation
from tautwave.simulation.scene.live import KeptRows


class Stepper:
    """The control loop of a rig, one cycle a call; axes named `outside` are moved by the caller.

    Drives, encoders, delays and the controller are those of `tautwave run`: an axis outside has no
    physics of its own, that is all. Use it in a `with` block: its end leaves every axis without
    effort, and closes the buses.

    Parameters
    ----------
    rig : Rig
        A checked rig with a `simulation` block.
    outside : str or sequence of str
        Axes, such as `slave.lever`, or sides, `slave`; impedance axes on simulated buses.
    clock : str
        `fake`: a call takes as long as it takes. `real`: it waits for the next period, with a real
        master in somebody's hand, for instance.
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
        The rig has no simulation, an axis cannot be outside, or clock or length are none.

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
                f"{rig.name}: a rig that is stepped needs a simulation block, which may be empty"
            )
        built = build_rig(rig, clock=clock, duration_s=duration_s)
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
        """Whether there is a cycle to come."""
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
            How fast it moves [rad/s or m/s]: recorded as its truth, and seen by nobody. Arrays of
            one element, as MuJoCo gives of a joint, are numbers, too.

        Returns
        -------
        dict
            Mean effort of each motor until the next call [N m or N], positive along the position;
            0 once the run has ended.

        Raises
        ------
        ConfigError
            A position is missing or no finite number, a name is no axis outside, or the run has
            ended before.
        TautwaveError
            What ended the run early, such as a limit.
        """
        if self._result is not None or self._closed:
            raise ConfigError("the run has ended; make another Stepper")
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
        found = {}
        for name, value in given.items():
            if name not in self._worlds:
                raise ConfigError(f"step: {name} is not outside; axes: {', '.join(self.outside)}")
            try:
                number = float(np.asarray(value, dtype=np.float64).item())
            except (TypeError, ValueError):
                number = np.nan
            if not np.isfinite(number):
                raise ConfigError(f"step: {name}: one finite number of {unit} (got {value!r})")
            found[name] = number
        return found

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
            f"outside: {name} is a joint of a simulated arm, whose joints move together; leave out "
            f"the arm in simulation.{name.partition('.')[0]}"
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
        if name not in simulated:
            raise ConfigError(f"outside: the bus of {name} is not simulated here, but real")
    if not chosen:
        raise ConfigError("outside: name at least one axis")
    return tuple(chosen)
