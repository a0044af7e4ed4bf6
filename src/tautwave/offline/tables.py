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


def record_tables(job: Job, out: Array | None = None) -> Tables:
    """Return tables of NumPy records, for the compiled engines; `out` if there is one already."""
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
        out=np.empty(job.run.cycles * len(job.columns)) if out is None else out,
    )


class Form:
    """Tables of NumPy records that serve run after run; only what differs is written again.

    Parameters
    ----------
    job : Job
        Any of the runs: the others have tables of the same sizes.
    out : ndarray
        Memory for the rows.
    """

    def __init__(self, job: Job, out: Array) -> None:
        self.tables = record_tables(job, out)
        self.tables = self.tables._replace(flags=job.flags.copy())
        states = (
            self.tables.outcomes,
            self.tables.sides,
            self.tables.bodies,
            self.tables.couples,
        )
        self._states = [(_bytes_of(table), _bytes_of(table).copy()) for table in states]
        params = (("device", self.tables.devices), ("side", self.tables.params))
        self._records = {
            kind: (_bytes_of(table).data, table.itemsize)
            for kind, table in (*params, ("pair", self.tables.pairs))
        }

    def write(self, kind: str, number: int, image: bytes) -> None:
        """Replace the constants of a `device`, `side` or `pair` by an `image_of` others."""
        view, size = self._records[kind]
        view[number * size : (number + 1) * size] = image

    def begin(self, table: Array, flags: Array) -> Tables:
        """Return the tables as they are before a run with these floats and flags."""
        for state, blank in self._states:
            np.copyto(state, blank)
        np.copyto(self.tables.table, table)
        np.copyto(self.tables.flags, flags)
        return self.tables


def image_of(value: DeviceParams | SideParams | PairParams) -> bytes:
    """Return constants as they stand in their table."""
    return _records(type(value), [value]).tobytes()


def _bytes_of(table: Array) -> Array:
    return table.view(np.uint8).reshape(-1)


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
