"""`simulate`: a rig on the fake clock, as fast as the same laws and models run compiled."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from difflib import get_close_matches

import numpy as np
import numpy.typing as npt

from tautwave.config import Rig
from tautwave.errors import ConfigError, TautwaveError
from tautwave.offline.kernel import run_rig
from tautwave.offline.outcome import error_of, never_began
from tautwave.offline.pack import Job, pack_rig
from tautwave.offline.tables import Tables, object_tables, record_tables

Array = npt.NDArray[np.float64]
ENGINES = ("compiled", "python", "c")


@dataclass(frozen=True, slots=True)
class Simulation:
    """Rows of a simulation.

    Attributes
    ----------
    columns : tuple of str
        Names of the columns, those of a recording.
    data : ndarray
        One row per executed cycle, one column per name; SI.
    error : TautwaveError or None
        What ended it early: a limit that was passed, samples or slots that were missing.
    """

    columns: tuple[str, ...]
    data: Array
    error: TautwaveError | None

    def __getitem__(self, name: str) -> Array:
        """Return one column by name."""
        try:
            return self.data[:, self.columns.index(name)]
        except ValueError as err:
            near = get_close_matches(name, self.columns, 1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise KeyError(f"there is no column {name!r}{hint}") from err

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.data)


def simulate(rig: Rig, *, duration_s: float | None = None, engine: str = "compiled") -> Simulation:
    """Simulate a rig; every row equals, to the bit, that of a run with `--clock fake`.

    Whatever driver a bus names, its devices move as the loopback's do, with the command delay
    that the driver declares. A rig with a scene takes the live loop itself, in this process, and
    its drivers' simulators. Nothing is written to disk.

    Parameters
    ----------
    rig : Rig
        A checked rig with a `simulation` block.
    duration_s : float, optional
        Length [s]; the rig's own if not given.
    engine : str
        `compiled` (numba; the first call on a machine compiles for some 15 s, later ones load
        that), `python` (no compiler), or `c` (gcc; for checks and benchmarks).

    Raises
    ------
    ConfigError
        The rig simulates nothing, the engine is unknown, or what it needs is not installed.
    SafetyStop
        The coupling never engaged.
    """
    if rig.scene is not None:
        from tautwave.offline.scene_simulation import simulate_scene

        return simulate_scene(rig, duration_s, engine)
    run, tables_of = engine_of(engine)
    job = pack_rig(rig, duration_s)
    tables = tables_of(job)
    rows = run(*tables)
    return simulation_of_run(job, tables, rows)


def engine_of(name: str) -> tuple[Callable[..., int], Callable[[Job], Tables]]:
    """Return the kernel of an engine and what makes its tables."""
    if name == "compiled":
        from tautwave.offline.compiled import compiled_kernel

        return compiled_kernel(), record_tables
    if name == "python":
        return run_rig, object_tables
    if name == "c":
        from tautwave.offline.cbuild import c_kernel

        return c_kernel(), record_tables
    raise ConfigError(f"unknown engine {name!r}; engines: {', '.join(ENGINES)}")


def simulation_of_run(job: Job, tables: Tables, rows: int) -> Simulation:
    """Return what a run left in its tables; raise if the coupling never engaged."""
    outcomes = tables.outcomes
    if isinstance(outcomes, np.ndarray):
        outcomes = outcomes.view(np.recarray)  # its records have attributes
    outcome = outcomes[0]
    error = error_of(job, outcome)
    if error is not None and never_began(outcome):
        raise error
    width = len(job.columns)
    data = np.asarray(tables.out, dtype=np.float64)[: rows * width].reshape(rows, width)
    return Simulation(job.columns, data, error)
