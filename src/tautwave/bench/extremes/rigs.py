"""Whole rigs at the ends of every range, through `simulate`: finite, or refused with a reason."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from tautwave.bench.result import Table, Value
from tautwave.bench.rigs import ONE_PAIR
from tautwave.config import Rig
from tautwave.errors import ConfigError, SafetyStop
from tautwave.rig import command_delays, end_constants
from tautwave.simulation import simulate
from tautwave.simulation.rows import Simulation

PAIR = "lever"
TRUTHS = ("master.lever", "slave.lever")


class Group(NamedTuple):
    """Rigs that differ in one thing; each has its overrides."""

    name: str
    rigs: tuple[tuple[str, ...], ...]


class Outcome(NamedTuple):
    """Result of one rig: `finished`, `stopped` or `refused`, why, and its worst figures."""

    end: str
    why: str
    not_finite: int
    residual: float
    generated: float


def _each(values: Sequence[float], *keys: str) -> tuple[tuple[str, ...], ...]:
    return tuple(tuple(f"{key}={value!r}" for key in keys) for value in values)


def groups() -> Iterator[Group]:
    """Return the cases of every range, at its ends and between."""
    decades = [10.0**power for power in range(10)]
    truth = [f"simulation.axes.{name}" for name in TRUTHS]
    belief = [f"{name.replace('.', '.axes.')}.inertia" for name in TRUTHS]
    masses = [1e-6, 1e-4, 1e-2, 1.0, 100.0]
    heavy = tuple(
        (
            *(f"{key}={{value: {m!r}, lower: {m!r}, source: assumed}}" for key in belief),
            *(f"{key}.inertia={m!r}" for key in truth),
        )
        for m in masses
    )
    yield Group(
        "stiffness of the surroundings, 1 to 1e9",
        _each(decades, "simulation.environment.lever.stiffness"),
    )
    yield Group(
        "stiffness of local walls, 1 to 1e9",
        _each(
            decades,
            "coupling.pairs.lever.wall_master.stiffness",
            "coupling.pairs.lever.wall_slave.stiffness",
        ),
    )
    yield Group(
        "stiffness of a position coupling, 1 to 1e9",
        tuple(
            (f"coupling={{law: position, pairs: {{lever: {{stiffness: {k!r}, damping: 0.01}}}}}}",)
            for k in decades
        ),
    )
    yield Group("inertia of both devices, 1e-6 to 100", heavy)
    yield Group(
        "inertia ratio 1e-6 to 1e6",
        tuple(
            (
                f"{truth[0]}.inertia={1e-3 / math.sqrt(r)!r}",
                f"{truth[1]}.inertia={1e-3 * math.sqrt(r)!r}",
            )
            for r in (1e-6, 1e-3, 1e3, 1e6)
        ),
    )
    yield Group(
        "foam, exponents 1 to 3, 1 to 1e9",
        tuple(
            (
                "simulation.environment.lever="
                f"{{type: foam, position: 0.15, stiffness: {k!r}, exponent: {a!r}}}",
            )
            for a in (1.0, 1.5, 2.0, 3.0)
            for k in decades[::3]
        ),
    )
    damping = [0.0, 1e-6, 1e-3, 1.0, 100.0, 1e4]
    yield Group(
        "damping of devices, 0 to 1e4", _each(damping, *(f"{key}.damping" for key in truth))
    )
    yield Group(
        "damping of the surroundings, 0 to 1e4",
        _each(damping, "simulation.environment.lever.damping"),
    )
    yield Group("Coulomb friction, 0 to 1e4", _each(damping, *(f"{key}.coulomb" for key in truth)))
    yield Group(
        "wave impedance, 1e-6 to 1e6",
        _each([1e-6, 1e-3, 1.0, 1e3, 1e6], "coupling.pairs.lever.wave_impedance"),
    )
    yield Group("delay, 0 to 5 s", _each([0.0, 0.001, 0.02, 0.5, 5.0], "coupling.delay_s"))
    rates = [10, 100, 500, 1000, 10_000, 100_000]
    yield Group(
        "rate, 10 Hz to 100 kHz",
        tuple(
            (
                f"rate_hz={rate}",
                f"duration_s={max(0.1, min(10.0, 2e4 / rate))!r}",
                "coupling.pairs.lever.wave_filter_hz=null",
                "coupling.delay_s=0.1",
            )
            for rate in rates
        ),
    )
    yield Group(
        "effort limit, 1e-6 to 1e-1 (saturated)",
        _each(
            [1e-6, 1e-3, 1e-1], "master.axes.lever.effort_limit", "slave.axes.lever.effort_limit"
        ),
    )
    yield Group(
        "encoder step, 1e-9 to 0.1",
        _each(
            [1e-9, 1e-3, 1e-2, 0.1],
            "master.axes.lever.encoder_quantum",
            "slave.axes.lever.encoder_quantum",
        ),
    )
    tiny = [1e-300, 1e-308, 5e-324]
    yield Group(
        "denormals: motion of 1e-300 to 5e-324",
        tuple(
            (
                "simulation.hand.lever.reference="
                f"{{type: minimum_jerk, waypoints: [[0.0, 0.0], [0.5, {x!r}], [1.0, 0.0]]}}",
                "master.axes.lever.encoder_quantum=0",
                "slave.axes.lever.encoder_quantum=0",
            )
            for x in tiny
        ),
    )
    yield Group(
        "denormals: parameters of 1e-310",
        _each(
            [1e-310], *(f"{key}.coulomb" for key in truth), "simulation.environment.lever.stiffness"
        )
        + _each([1e-310], *(f"{key}.inertia" for key in truth))
        + _each([1e-310], "coupling.pairs.lever.wave_impedance"),
    )
    yield Group(
        "everything stiff together",
        tuple(
            (
                "simulation.environment.lever="
                f"{{type: wall, position: 0.0, stiffness: {k!r}, damping: {b!r}}}",
                f"{truth[1]}.inertia=1e-6",
                f"coupling.pairs.lever.wave_impedance={z!r}",
            )
            for k in (1e6, 1e9)
            for b in (0.0, 1e4)
            for z in (1e-4, 10.0)
        ),
    )


def try_rig(overrides: Sequence[str], *, duration_s: float | None = None, engine: str) -> Outcome:
    """Load and simulate the one-pair rig with overrides."""
    try:
        rig = ONE_PAIR.load(overrides)
        span = duration_s
        if span is not None:
            span = min(span, 2e4 / rig.rate_hz, rig.duration_s)
        with np.errstate(all="ignore"):
            made = simulate(rig, duration_s=span, engine=engine)
    except (ConfigError, SafetyStop) as err:
        return Outcome("refused", str(err), 0, 0.0, 0.0)
    residual, generated = books(rig, made)
    bad = int(np.count_nonzero(~np.isfinite(made.data)))
    if made.error is not None:
        return Outcome("stopped", str(made.error), bad, residual, generated)
    return Outcome("finished", "", bad, residual, generated)


def books(rig: Rig, made: Simulation) -> tuple[float, float]:
    """Return residual and energy generated by the controller, as shares of the gross flow.

    Tanks count from their reserve, so the residual is a share of flow and reserves: where hardly
    anything moves it is their rounding.
    """
    balance: Any = np.zeros(len(made))
    flow = generated = 0.0
    with np.errstate(all="ignore"):
        for side in ("master", "slave"):
            entered = made[f"{side}.{PAIR}.port_energy"]
            balance = balance + (entered - entered[0])
            flow += float(made[f"{side}.{PAIR}.gross_flow"][-1])
        for name in made.columns:
            parts = name.split(".")
            if parts[0] != PAIR or len(parts) != 3:
                continue
            values = made[name]
            if parts[2] in ("stored", "dissipated"):
                balance = balance - (values - values[0])
            elif parts[2] == "absorbed":
                generated += max(0.0, -float(values.min()))
        residual = float(np.abs(balance).max())
    if not flow > 1e-290:
        return 0.0, 0.0
    return residual / (flow + reserves(rig)), generated / flow


def reserves(rig: Rig) -> float:
    """Return the reserves of both ports [J], 0 for a law without tanks."""
    delays = command_delays(rig)
    names = [f"{side}.{PAIR}" for side in ("master", "slave")]
    ends = [end_constants(rig, name, delays[name]) for name in names]
    return float(sum(end.port.reserve for end in ends if hasattr(end, "port")))


def rig_table(*, duration_s: float, engine: str) -> tuple[list[Table], int]:
    """Run every group; return the tables and the number of figures that were not finite."""
    rows: list[list[Value]] = []
    reasons: list[list[Value]] = []
    broken = 0
    for group in groups():
        found = [try_rig(rig, duration_s=duration_s, engine=engine) for rig in group.rigs]
        ends = [one.end for one in found]
        broken += sum(one.not_finite for one in found)
        failures = [one.why for one in found if one.why]
        rows.append(
            [
                group.name,
                ends.count("finished"),
                ends.count("stopped"),
                ends.count("refused"),
                max(one.residual for one in found),
                max(one.generated for one in found),
                sum(one.not_finite for one in found),
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
        f"{ONE_PAIR.name} with one parameter at its extremes, {duration_s:g} s (20 000 cycles at "
        "most) "
        "through simulate; residual of the controller's books and energy it generated as shares of "
        "the gross flow; every number of every row is looked at. No certificate is required here."
    )
    why = "group, how many of its rigs, and the sentence for the last"
    return [
        Table("Whole rigs", what, columns, rows),
        Table("Rigs that were refused or stopped", why, ("rigs", "count", "because"), reasons),
    ], broken
