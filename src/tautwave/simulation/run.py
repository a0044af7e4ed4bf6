"""`simulate`: a rig on the fake clock, with the same laws and models, compiled."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable, Iterator

import numpy as np
import numpy.typing as npt

from tautwave.config import Rig, has_plain_devices
from tautwave.controller.records import RunState
from tautwave.controller.slotted import slotted
from tautwave.controller.steps import Law
from tautwave.controller.stops import never_began
from tautwave.errors import ConfigError, TautwaveError
from tautwave.rig import build_rig, coupling_law
from tautwave.runtime.control import CoupledControl
from tautwave.simulation.hooks import simulation_hooks
from tautwave.simulation.kernel.pack import Job, pack_rig
from tautwave.simulation.kernel.records import Tables
from tautwave.simulation.kernel.run import run_rig
from tautwave.simulation.kernel.tables import object_tables, record_tables
from tautwave.simulation.memory import run_in_memory
from tautwave.simulation.outcome import error_of
from tautwave.simulation.rows import Simulation

Array = npt.NDArray[np.float64]
ENGINES = ("compiled", "python")


def simulate(rig: Rig, *, duration_s: float | None = None, engine: str = "compiled") -> Simulation:
    """Simulate a rig; every row equals, to the bit, that of a run with `--clock fake`.

    Whatever its driver, the devices of a bus move as the loopback's, with the driver's declared
    command delay. A rig with a scene runs the live loop in this process, with its drivers'
    simulators. Nothing is written to disk or opened: every bus is simulated in memory, whatever
    endpoint it names.

    Parameters
    ----------
    rig : Rig
        A checked rig with a `simulation` block.
    duration_s : float, optional
        Length [s]; the rig's own if not given.
    engine : str
        `compiled` (numba; the first call on a machine compiles for half a minute, later ones load
        the cache), or `python` (no compiler).

    Raises
    ------
    ConfigError
        The rig has no simulation, the engine is unknown, a library is not installed, or the rows do
        not fit into memory.
    SafetyStop
        The coupling never engaged.
    """
    try:
        return _simulate(rig, duration_s, engine)
    except MemoryError as err:
        span = rig.duration_s if duration_s is None else duration_s
        raise ConfigError(
            f"{rig.name}: {span:g} s at {rig.rate_hz:g} Hz are more rows than fit into memory; "
            "simulate a shorter duration"
        ) from err


def _simulate(rig: Rig, duration_s: float | None, engine: str) -> Simulation:
    if rig.scene is not None:
        return simulation_hooks().simulate(rig, duration_s, engine)
    if has_plain_devices(rig):
        return _simulate_live(rig, duration_s)
    check_engine(engine)
    job = pack_rig(rig, duration_s)
    run, tables_of = engine_of(engine, job.law)
    tables = tables_of(job)
    try:
        rows = run(tables)
    except Exception as err:
        reason = why_not_compiled(err) if engine == "compiled" else ""
        if not reason:
            raise
        warnings.warn(f"law {job.law.name} runs in Python: {reason}", stacklevel=2)
        run, tables_of = engine_of("python", job.law)
        tables = tables_of(job)
        rows = run(tables)
    return simulation_of_run(job, tables, rows)


def simulate_pieces(
    rig: Rig, rows: int, *, duration_s: float | None = None, engine: str = "compiled"
) -> Iterator[Simulation]:
    """Simulate as `simulate` does, in pieces of at most `rows` rows: hours in the memory of one.

    The pieces share their memory: each overwrites the rows of the one before.

    Parameters
    ----------
    rig : Rig
        A checked rig with a `simulation` block; no scene, arm or load.
    rows : int
        Rows of a piece.
    duration_s, engine : float, str
        As for `simulate`.

    Raises
    ------
    ConfigError, SafetyStop
        As for `simulate`.
    """
    job = pack_rig(rig, duration_s)
    run, tables_of = engine_of(engine, job.law)
    size = min(rows, job.run.cycles) * len(job.columns)
    tables = tables_of(job, np.empty(size) if engine == "compiled" else [0.0] * size)
    going_on = True
    while going_on:
        count = run(tables)
        yield simulation_of_run(job, tables, count)
        going_on = _outcome(tables).done > 0


def is_compiled(rig: Rig) -> bool:
    """Return whether what a compiled simulation of a rig runs is in the cache."""
    if rig.scene is not None:
        return simulation_hooks().is_compiled(rig)
    from tautwave.simulation.kernel.compiled import is_cached
    from tautwave.simulation.kernel.run import run_law

    return is_cached(run_law, coupling_law(rig))


def why_not_compiled(err: Exception) -> str:
    """Return what numba says of code that it cannot compile; nothing for any other error."""
    if not type(err).__module__.startswith("numba."):
        return ""
    lines = [line.strip() for line in str(err).splitlines() if line.strip()]
    return f"numba does not compile it: {lines[0] if lines else type(err).__name__}"


def _simulate_live(rig: Rig, duration_s: float | None) -> Simulation:
    """Return the rows of a rig whose devices stay in Python: the live loop in memory."""
    # No device outlives this process.
    built = build_rig(rig, clock="fake", duration_s=duration_s, allow_unwatched=True)
    if rig.loop.engine == "compiled" and isinstance(built.control, CoupledControl):
        from tautwave.simulation.live.control import CompiledControl

        built = built._replace(control=CompiledControl(built.control))
        built = built._replace(sources=[built.control, *built.sources[1:]])
    result, data = run_in_memory(built)
    error = result.error
    if error is not None and (len(data) == 0 or not isinstance(error, TautwaveError)):
        raise error
    return Simulation(tuple(built.columns), data, error)


def check_engine(name: str) -> None:
    """Refuse an engine that is none.

    Raises
    ------
    ConfigError
        Its name is unknown.
    """
    if name not in ENGINES:
        raise ConfigError(f"unknown engine {name!r}; engines: {', '.join(ENGINES)}")


def engine_of(name: str, law: Law) -> tuple[Callable[..., int], Callable[..., Tables]]:
    """Return the kernel of an engine for a coupling, and what makes its tables."""
    check_engine(name)
    if name == "compiled":
        from tautwave.simulation.kernel.compiled import compiled_kernel

        return compiled_kernel(law), record_tables
    return functools.partial(run_rig, steps=slotted(law.steps)), object_tables


def simulation_of_run(job: Job, tables: Tables, rows: int) -> Simulation:
    """Return the rows of a run from its tables; raise if the coupling never engaged."""
    outcome = _outcome(tables)
    error = error_of(job, outcome)
    if error is not None and never_began(outcome):
        raise error
    width = len(job.columns)
    data = np.asarray(tables.out, dtype=np.float64)[: rows * width].reshape(rows, width)
    return Simulation(job.columns, data, error)


def _outcome(tables: Tables) -> RunState:
    outcomes = tables.outcomes
    if isinstance(outcomes, np.ndarray):
        outcomes = outcomes.view(np.recarray)  # its records have attributes
    outcome: RunState = outcomes[0]
    return outcome
