"""One closed-loop simulation of a rig as columns, by the same kernel as `simulate`, in memory.

Measures that need only a few columns of one pair get only those: writing the rows of a whole
recording costs a fifth of a compiled step, and reading them more.
"""

from __future__ import annotations

from contextlib import suppress
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np

from tautwave.analysis.felt import FELT
from tautwave.config import Rig
from tautwave.config.keys.rig import bus_spec
from tautwave.controller.records import FINISHED
from tautwave.errors import ConfigError, SafetyStop
from tautwave.simulation.kernel.pack import Array, Job, RigFacts, pack_rig, rig_facts
from tautwave.simulation.kernel.records import Tables
from tautwave.simulation.kernel.rows import measured_columns
from tautwave.simulation.kernel.tables import object_tables, record_tables
from tautwave.simulation.outcome import error_of
from tautwave.simulation.run import check_engine, engine_of
from tautwave.sweep.family import Family
from tautwave.sweep.measure import BOOKS, Columns, Scales, scales_of
from tautwave.sweep.points import Points
from tautwave.sweep.template import Instance, Template, Templates

WORTH_COMPILING = 1_000_000
"""Steps below which plain Python finishes before a compiler or its cache is loaded."""


def sweep_engine(steps: int) -> str:
    """Return the fastest available engine for a sweep of this many steps."""
    if steps < WORTH_COMPILING:
        return "python"
    return "compiled" if find_spec("numba") is not None else "python"


def takes_rows(wanted: tuple[str, ...]) -> bool:
    """Return whether measures need whole rows."""
    return any(name in BOOKS or name in FELT for name in wanted)


class Run(NamedTuple):
    """One simulation: its columns by name, its number of cycles, and how it ended.

    The end is `finished`, `safety_stop` (a limit was exceeded: columns up to there) or `fault`.
    """

    columns: Columns
    cycles: int
    outcome: str


class Simulator:
    """Simulates one point after the other, reusing the memory of the rows.

    Parameters
    ----------
    engine : str
        Of `simulate`.
    whole : bool
        Keep whole rows, not only those in `rows.measured_columns`.
    """

    def __init__(self, engine: str, *, whole: bool) -> None:
        check_engine(engine)
        self._engine = engine
        self._records = engine == "compiled"
        self._tables_of = record_tables if self._records else object_tables
        self._whole = whole
        self._out = np.empty(0)
        self._known: tuple[list[Any], RigFacts] | None = None
        self._templates: tuple[Points, Templates] | None = None

    def __call__(self, points: Points, number: int) -> tuple[Scales, Run]:
        """Simulate a point of a sweep; the columns hold until the next call.

        Raises
        ------
        ConfigError
            The rig is not valid, or cannot be simulated.
        """
        shared_family = None if self._whole else points.family(number)
        if shared_family is not None:
            family, values = shared_family
            pair = points.pair_of(family.base)
            template = self._templates_of(points).of(family)
            instance = None
            if template is not None:
                seed = points.seed_at(number, family.base.seed) if template.is_drawn else 0
                instance = template.instantiate(values, seed)
            if template is not None and instance is not None:
                return scales_of(family.base, pair), self._run_instance(template, instance)
        rig = points.rig(number)
        pair = points.pair_of(rig)
        return scales_of(rig, pair), self.simulate(rig, pair, points.duration_of(rig))

    def simulate(self, rig: Rig, pair: str, duration_s: float) -> Run:
        """Simulate a rig; see `__call__`."""
        if self._whole:
            job = pack_rig(rig, duration_s)
        else:
            job = self._measured(rig, pair, duration_s, self._facts(rig))
        return self._go(job, self._tables(job))

    def _measured(self, rig: Rig, pair: str, duration_s: float, facts: RigFacts) -> Job:
        """Return a job that keeps the few columns of one pair."""
        job = pack_rig(rig, duration_s, facts)
        fake = job.fake._replace(measured=list(rig.coupling.pairs).index(pair))
        return job._replace(fake=fake, columns=measured_columns(pair))

    def _templates_of(self, points: Points) -> Templates:
        """Return the templates of a sweep."""
        if self._templates is None or self._templates[0] is not points:

            def make(family: Family) -> Template | None:
                rig = family.base
                with suppress(
                    ConfigError
                ):  # fails for the family's own rig; another point may work
                    facts = self._facts(rig)
                    pair, duration_s = points.pair_of(rig), points.duration_of(rig)
                    return Template(family, self._measured(rig, pair, duration_s, facts), facts)
                return None

            self._templates = points, Templates(make)
        return self._templates[1]

    def _run_instance(self, template: Template, instance: Instance) -> Run:
        if self._records:
            return self._go(template.job, template.tables(instance, self._memory(template.job)))
        job = template.filled(instance)
        return self._go(job, self._tables_of(job))

    def _go(self, job: Job, tables: Tables) -> Run:
        """Run the kernel; return what it left in the tables."""
        count = engine_of(self._engine, job.law)[0](tables)
        width = len(job.columns)
        rows = np.asarray(tables.out[: count * width], dtype=np.float64).reshape(count, width)
        columns = dict(zip(job.columns, rows.T, strict=True))
        return Run(columns, count, _outcome(job, tables))

    def _facts(self, rig: Rig) -> RigFacts:
        """Return the facts of the last rig if its drivers would get the same inputs."""
        seen = [(bus.driver, bus.options, bus_spec(rig, name)) for name, bus in rig.buses.items()]
        if self._known is None or self._known[0] != seen:
            self._known = seen, rig_facts(rig)
        return self._known[1]

    def _memory(self, job: Job) -> Array:
        """Return memory for the rows of a job."""
        size = job.run.cycles * len(job.columns)
        if len(self._out) < size:
            self._out = np.empty(size)
        return self._out

    def _tables(self, job: Job) -> Tables:
        return record_tables(job, self._memory(job)) if self._records else self._tables_of(job)


def _outcome(job: Job, tables: Tables) -> str:
    """Return how a run ended; see `Run`."""
    outcomes = tables.outcomes
    if isinstance(outcomes, np.ndarray):
        if outcomes["kind"][0] == FINISHED:
            return "finished"
        outcomes = outcomes.view(np.recarray)
    error = error_of(job, outcomes[0])
    if error is None:
        return "finished"
    return "safety_stop" if isinstance(error, SafetyStop) else "fault"
