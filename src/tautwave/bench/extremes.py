"""A rig with one parameter at the end of its range, through `simulate`: finite, stopped or refused.

`tautwave bench extremes [RIG]`. Every number of every row is looked at; where the controller or
the scene keeps books, their residual and what they generated stand beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tautwave.bench.compiled import has_numba
from tautwave.bench.hooks import bench_hooks
from tautwave.bench.result import Goal, Group, Suite, Table, Value
from tautwave.config import Rig, load_rig
from tautwave.errors import ConfigError, SafetyStop
from tautwave.rig import command_delays, end_constants, pair_scale
from tautwave.simulation import simulate
from tautwave.simulation.rows import Simulation

MAX_CYCLES = 20_000
"""A case is cut there; the rates reach 100 kHz."""

DECADES = tuple(10.0**power for power in range(10))
SIZES = (0.0, 1e-6, 1e-3, 1.0, 100.0, 1e4)
FACTORS = (1e-3, 1e-1, 10.0, 1e3, 1e5)
TINY = (1e-300, 1e-308, 5e-324)


class Outcome(NamedTuple):
    """Result of one rig: `finished`, `stopped` or `refused`, why, and its worst figures."""

    end: str
    why: str
    not_finite: int
    residual: float
    generated: float


def groups(rig: Rig) -> Iterator[Group]:
    """Yield the cases of every range that the rig has, at its ends and between.

    Parameters
    ----------
    rig : Rig
        With a `simulation` block.
    """
    assert rig.simulation is not None
    if rig.scene is not None:
        yield from bench_hooks().extremes(rig)
    else:
        yield from _of_pairs(rig)
    moved = [name for name, axis in rig.axes.items() if axis.causality == "impedance"]
    truth = [f"simulation.axes.{name}" for name in moved]
    if truth:
        yield from _of_devices(rig, moved, truth)
    hands = [f"simulation.hand.{name}.reference" for name in rig.simulation.hand]
    smooth = tuple(f"{_keys(name)}.encoder_quantum=0" for name in moved)
    if hands:
        jump = "{{type: minimum_jerk, waypoints: [[0.0, 0.0], [0.5, {0!r}], [1.0, 0.0]]}}"
        yield Group(
            "denormals: motion of 1e-300 to 5e-324",
            tuple((*(f"{hand}={jump.format(x)}" for hand in hands), *smooth) for x in TINY),
        )
    yield Group(
        "encoder step, 1e-9 to 0.1",
        each((1e-9, 1e-3, 1e-2, 0.1), *(f"{_keys(name)}.encoder_quantum" for name in moved)),
    )
    yield Group(
        "effort limit, 1e-6 to 1e-1 (saturated)",
        each((1e-6, 1e-3, 1e-1), *(f"{_keys(name)}.effort_limit" for name in moved)),
    )


def _of_devices(rig: Rig, moved: Sequence[str], truth: Sequence[str]) -> Iterator[Group]:
    """Yield what devices may be: mass, damping, friction."""
    known = {name: axis.inertia for name in moved if (axis := rig.axes[name]).inertia is not None}
    yield Group(
        "inertia of all devices, times 1e-3 to 1e5, believed and true",
        tuple(
            tuple(
                text
                for name, inertia in known.items()
                if inertia is not None
                for text in (
                    f"{_keys(name)}.inertia={{value: {factor * inertia.value!r}, "
                    f"lower: {factor * inertia.lower!r}, source: assumed}}",
                    f"simulation.axes.{name}.inertia={factor * inertia.value!r}",
                )
            )
            for factor in FACTORS
        ),
    )
    slaves = [name for name in known if name.startswith("slave.")]
    if slaves:
        yield Group(
            "true inertia of slaves only, times 1e-6 to 1e6",
            tuple(
                tuple(
                    f"simulation.axes.{name}.inertia={factor * inertia.value!r}"
                    for name in slaves
                    if (inertia := known[name]) is not None
                )
                for factor in (1e-6, 1e-3, 1e3, 1e6)
            ),
        )
    yield Group("damping of devices, 0 to 1e4", each(SIZES, *(f"{key}.damping" for key in truth)))
    yield Group("Coulomb friction, 0 to 1e4", each(SIZES, *(f"{key}.coulomb" for key in truth)))
    yield Group(
        "denormals: parameters of 1e-310",
        each((1e-310,), *(f"{key}.coulomb" for key in truth))
        + each((1e-310,), *(f"{key}.inertia" for key in truth)),
    )


def _of_pairs(rig: Rig) -> Iterator[Group]:
    """Yield what surroundings, walls and coupling may be."""
    assert rig.simulation is not None
    pairs = rig.coupling.pairs
    around = rig.simulation.environment
    stiff = [f"simulation.environment.{name}" for name in around if has(around[name], "stiffness")]
    if stiff:
        yield Group(
            "stiffness of the surroundings, 1 to 1e9",
            each(DECADES, *(f"{key}.stiffness" for key in stiff)),
        )
    lossy = [f"simulation.environment.{name}" for name in around if has(around[name], "damping")]
    if lossy:
        yield Group(
            "damping of the surroundings, 0 to 1e4",
            each(SIZES, *(f"{key}.damping" for key in lossy)),
        )
    if around:
        places = {name: getattr(around[name], "position", 0.0) for name in around}
        foam = "{{type: foam, position: {place!r}, stiffness: {k!r}, exponent: {a!r}}}"
        yield Group(
            "foam, exponents 1 to 3, 1 to 1e9",
            tuple(
                tuple(
                    f"simulation.environment.{name}={foam.format(place=place, k=k, a=a)}"
                    for name, place in places.items()
                )
                for a in (1.0, 1.5, 2.0, 3.0)
                for k in DECADES[::3]
            ),
        )
    walls = [
        f"coupling.pairs.{name}.wall_{side}.stiffness"
        for name, pair in pairs.items()
        for side in ("master", "slave")
        if getattr(pair, f"wall_{side}") is not None
    ]
    if walls:
        yield Group("stiffness of local walls, 1 to 1e9", each(DECADES, *walls))
    waves = [
        f"coupling.pairs.{name}" for name, pair in pairs.items() if has(pair, "wave_impedance")
    ]
    springs = [f"coupling.pairs.{name}" for name, pair in pairs.items() if has(pair, "stiffness")]
    if waves:
        yield Group(
            "wave impedance, 1e-6 to 1e6",
            each((1e-6, 1e-3, 1.0, 1e3, 1e6), *(f"{key}.wave_impedance" for key in waves)),
        )
    elif springs:
        yield Group(
            "stiffness of the coupling, 1 to 1e9",
            each(DECADES, *(f"{key}.stiffness" for key in springs)),
        )
    if rig.link is None:
        periods = (0, 1, 20, 500, 5000)
        yield Group(
            "delay, 0 to 5000 samples",
            each([n * rig.period_s for n in periods], "coupling.delay_s"),
        )
        yield from rates(("coupling.delay_s=0.1", *(f"{key}.wave_filter_hz=null" for key in waves)))
    if waves and stiff:
        slaves = [
            f"simulation.axes.{name}.inertia=1e-6"
            for name, axis in rig.axes.items()
            if name.startswith("slave.") and axis.causality == "impedance"
        ]
        yield Group(
            "everything stiff together",
            tuple(
                (
                    *(f"{key}.stiffness={k!r}" for key in stiff),
                    *(f"{key}.damping={b!r}" for key in lossy),
                    *(f"{key}.wave_impedance={z!r}" for key in waves),
                    *slaves,
                )
                for k in (1e6, 1e9)
                for b in (0.0, 1e4)
                for z in (1e-4, 10.0)
            ),
        )


def rates(more: Sequence[str]) -> Iterator[Group]:
    """Yield rates over four decades, each for `MAX_CYCLES` at most."""
    yield Group(
        "rate, 10 Hz to 100 kHz",
        tuple(
            (f"rate_hz={rate}", f"duration_s={max(0.1, min(10.0, MAX_CYCLES / rate))!r}", *more)
            for rate in (10, 100, 500, 1000, 10_000, 100_000)
        ),
    )


def each(values: Sequence[float], *keys: str) -> tuple[tuple[str, ...], ...]:
    """Return an override of all keys for each value."""
    return tuple(tuple(f"{key}={value!r}" for key in keys) for value in values)


def _keys(axis: str) -> str:
    """Return where the keys of an axis stand in a rig file."""
    return axis.replace(".", ".axes.", 1)


def has(block: object, key: str) -> bool:
    """Return whether a block states a number under a key."""
    return isinstance(getattr(block, key, None), int | float)


def try_rig(
    path: Path, changes: Sequence[str], *, duration_s: float | None = None, engine: str
) -> Outcome:
    """Load and simulate a rig with changes, as for `--set`."""
    try:
        rig = load_rig(path, changes)
        span = duration_s
        if span is not None:
            span = min(span, MAX_CYCLES / rig.rate_hz, rig.duration_s)
        with np.errstate(all="ignore"):
            made = simulate(rig, duration_s=span, engine=engine)
    except (ConfigError, SafetyStop) as err:
        return Outcome("refused", str(err), 0, 0.0, 0.0)
    residual, generated = books(rig, made)
    bad = int(np.count_nonzero(~np.isfinite(made.data[:, _counted(made)])))
    if made.error is not None:
        return Outcome("stopped", str(made.error), bad, residual, generated)
    return Outcome("finished", "", bad, residual, generated)


def _counted(made: Simulation) -> list[int]:
    """Return the columns that are to be finite: all but a sensor's that is not there."""
    return [at for at, name in enumerate(made.columns) if not name.endswith(".measured_effort")]


def books(rig: Rig, made: Simulation) -> tuple[float, float]:
    """Return residual and energy generated by controller or scene, as shares of the gross flow.

    Tanks count from their reserve, so the residual is a share of flow and reserves: where hardly
    anything moves it is their rounding.
    """
    flow = generated = 0.0
    with np.errstate(all="ignore"):
        for name in rig.axes:
            flow += float(made[f"{name}.gross_flow"][-1])
        if rig.scene is not None:
            residual, generated = bench_hooks().books(made)
            return (residual / flow, generated / flow) if flow > 1e-290 else (0.0, 0.0)
        balance: Any = np.zeros(len(made))
        for name in rig.axes:
            entered = made[f"{name}.port_energy"]
            balance = balance + _weight(rig, name) * (entered - entered[0])
        for name in made.columns:
            pair, _, rest = name.partition(".")
            if pair not in rig.coupling.pairs or "." not in rest:
                continue
            values = made[name]
            if name.endswith((".stored", ".dissipated")):
                balance = balance - (values - values[0])
            elif name.endswith(".absorbed"):
                generated += max(0.0, -float(values.min()))
        residual = float(np.abs(balance).max())
    if not flow > 1e-290:
        return 0.0, 0.0
    return residual / (flow + reserves(rig)), generated / flow


def _weight(rig: Rig, axis: str) -> float:
    """Return what a joule at an axis counts in the pair's books, which are in master's units."""
    side, pair = axis.split(".")
    return 1.0 if side == "master" else 1.0 / pair_scale(rig.coupling.pairs[pair]).power


def reserves(rig: Rig) -> float:
    """Return the reserves of all ports [J], 0 for a law without tanks."""
    delays = command_delays(rig)
    ends = [end_constants(rig, name, delays[name]) for name in rig.axes if name in delays]
    return float(sum(end.port.reserve for end in ends if hasattr(end, "port")))


def extremes(
    path: Path,
    *,
    changes: Sequence[str] = (),
    duration_s: float = 9.0,
    tell: Callable[[str], None] = lambda _: None,
) -> Suite:
    """Run a rig at the ends of every range.

    Parameters
    ----------
    path : Path
        The rig file, with a `simulation` block.
    changes : sequence of str
        As for `--set`.
    duration_s : float
        Simulated time of each case at most [s]; `MAX_CYCLES` at most.
    tell : callable
        Called with the name of each group as it starts.

    Raises
    ------
    ConfigError
        The rig cannot be read, or simulates nothing.
    """
    rig = load_rig(path, changes)
    if rig.simulation is None:
        raise ConfigError(f"{path}: has no simulation block, so there is nothing to simulate")
    engine = "compiled" if has_numba() else "python"
    tables, broken = rig_table(path, changes, duration_s=duration_s, engine=engine, tell=tell)
    goal = Goal("figures that are not finite, anywhere", 0.0, "", float(broken))
    return Suite("extremes", tables, [goal])


def rig_table(
    path: Path,
    changes: Sequence[str] = (),
    *,
    duration_s: float,
    engine: str,
    tell: Callable[[str], None] = lambda _: None,
) -> tuple[list[Table], int]:
    """Run every group; return the tables and the number of figures that were not finite."""
    rig = load_rig(path, changes)
    rows: list[list[Value]] = []
    reasons: list[list[Value]] = []
    broken = 0
    for group in groups(rig):
        tell(group.name)
        figures = [
            try_rig(path, (*changes, *case), duration_s=duration_s, engine=engine)
            for case in group.rigs
        ]
        ends = [one.end for one in figures]
        broken += sum(one.not_finite for one in figures)
        failures = [one.why for one in figures if one.why]
        rows.append(
            [
                group.name,
                ends.count("finished"),
                ends.count("stopped"),
                ends.count("refused"),
                max(one.residual for one in figures),
                max(one.generated for one in figures),
                sum(one.not_finite for one in figures),
            ]
        )
        if failures:
            reasons.append([group.name, len(failures), failures[-1].splitlines()[0]])
    columns = (
        "rigs",
        "finished",
        "stopped",
        "refused",
        "residual",
        "generated",
        "not_finite",
    )
    what = (
        f"{rig.name} with one parameter at its extremes, {duration_s:g} s ({MAX_CYCLES} cycles at "
        "most) "
        "through simulate; residual of the books and energy generated as shares of "
        "the gross flow; every number of every row is looked at. No certificate is required here."
    )
    why = "group, how many of its rigs, and the sentence for the last"
    return [
        Table("Whole rigs", what, columns, rows),
        Table("Rigs that were refused or stopped", why, ("rigs", "count", "because"), reasons),
    ], broken
