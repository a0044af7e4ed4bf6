"""The arguments of the kernel, fresh for each run: as NumPy records, or as Python objects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from tautwave.offline.pack import Array, Job
from tautwave.offline.records import (
    Body,
    Couple,
    DeviceParams,
    Outcome,
    PairParams,
    RunParams,
    Side,
    SideParams,
    empty,
    record_type,
)


class Tables(NamedTuple):
    """The arguments of `kernel.run_rig`, in its order."""

    runs: Any
    outcomes: Any
    params: Any
    sides: Any
    devices: Any
    bodies: Any
    pairs: Any
    couples: Any
    table: Any
    flags: Any
    out: Any


def record_tables(job: Job) -> Tables:
    """Return tables of NumPy records, for the compiled engines."""
    bodies = _blank(Body, len(job.axes))
    bodies["x"] = job.start
    return Tables(
        runs=_records(RunParams, [job.run]),
        outcomes=_blank(Outcome, 1),
        params=_records(SideParams, job.sides),
        sides=_blank(Side, len(job.axes)),
        devices=_records(DeviceParams, job.devices),
        bodies=bodies,
        pairs=_records(PairParams, job.pairs),
        couples=_blank(Couple, len(job.pairs)),
        table=job.table.copy(),
        flags=job.flags,
        out=np.empty(job.run.cycles * len(job.columns)),
    )


def object_tables(job: Job) -> Tables:
    """Return tables of Python objects and floats, for the kernel as plain Python."""
    bodies = [empty(Body) for _ in job.axes]
    for body, x in zip(bodies, job.start, strict=True):
        body.x = x
    return Tables(
        runs=[job.run],
        outcomes=[empty(Outcome)],
        params=job.sides,
        sides=[empty(Side) for _ in job.axes],
        devices=job.devices,
        bodies=bodies,
        pairs=job.pairs,
        couples=[empty(Couple) for _ in job.pairs],
        table=job.table.tolist(),
        flags=job.flags.tolist(),
        out=[0.0] * (job.run.cycles * len(job.columns)),
    )


def _records(kind: type[Any], values: Sequence[Any]) -> Array:
    return np.array([_plain(value) for value in values], dtype=record_type(kind))


def _blank(kind: type[Any], count: int) -> Array:
    return np.zeros(count, dtype=record_type(kind))


def _plain(value: Any) -> Any:
    """Return nested NamedTuples as nested plain tuples, which NumPy takes as records."""
    return tuple(_plain(part) for part in value) if isinstance(value, tuple) else value
