"""How a simulation ended, from the controller's state."""

from __future__ import annotations

from typing import Any

from tautwave.controller.records import RunState
from tautwave.controller.stops import stop_error
from tautwave.errors import TautwaveError
from tautwave.simulation.kernel.pack import Job


def error_of(job: Job, outcome: Any) -> TautwaveError | None:
    """Return what ended the run early, or None; `outcome` is a `RunState` of any engine."""
    state = RunState(*(getattr(outcome, name) for name in RunState.__slots__))
    return stop_error(job.run, state, job.names, job.params, job.pairs, job.law)
