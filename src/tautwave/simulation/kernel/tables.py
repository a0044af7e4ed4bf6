"""The arguments of the kernel, fresh for each run: as NumPy records, or as Python objects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from tautwave.controller.records import (
    AxisParams,
    AxisState,
    PairParams,
    PairState,
    RunParams,
    RunState,
    RunView,
    Sample,
)
from tautwave.controller.slotted import all_slotted, with_views
from tautwave.simulation.kernel.pack import Array, Job
from tautwave.simulation.kernel.records import (
    DeviceParams,
    DeviceState,
    FakeParams,
    Tables,
    parts_of,
    record_type,
)


def record_tables(job: Job, out: Array | None = None) -> Tables:
    """Return tables of NumPy records, for the compiled engines; `out` if there is one already."""
    bodies = blank_records(DeviceState, len(job.axes))
    bodies["x"] = job.start
    return Tables(
        runs=records_of(RunParams, [job.run]),
        fakes=records_of(FakeParams, [job.fake]),
        outcomes=blank_records(RunState, 1),
        params=records_of(AxisParams, job.params),
        axes=blank_records(AxisState, len(job.axes), end=job.law.end),
        samples=blank_records(Sample, len(job.axes)),
        devices=records_of(DeviceParams, job.devices),
        bodies=bodies,
        pairs=records_of(PairParams, job.pairs),
        states=blank_records(PairState, len(job.pairs), link=job.law.link),
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
            self.tables.axes,
            self.tables.samples,
            self.tables.bodies,
            self.tables.states,
        )
        self._states = [(_bytes_of(table), _bytes_of(table).copy()) for table in states]
        params = (("device", self.tables.devices), ("axis", self.tables.params))
        self._records = {
            kind: (_bytes_of(table).data, table.itemsize)
            for kind, table in (*params, ("pair", self.tables.pairs))
        }

    def write(self, kind: str, number: int, image: bytes) -> None:
        """Replace the constants of a `device`, `axis` or `pair` by an `image_of` others."""
        view, size = self._records[kind]
        view[number * size : (number + 1) * size] = image

    def begin(self, table: Array, flags: Array) -> Tables:
        """Return the tables as they are before a run with these floats and flags."""
        for state, blank in self._states:
            np.copyto(state, blank)
        np.copyto(self.tables.table, table)
        np.copyto(self.tables.flags, flags)
        return self.tables


def image_of(value: DeviceParams | AxisParams | PairParams) -> bytes:
    """Return constants as they stand in their table."""
    return records_of(type(value), [value]).tobytes()


def _bytes_of(table: Array) -> Array:
    return table.view(np.uint8).reshape(-1)


def object_tables(job: Job, out: list[float] | None = None) -> Tables:
    """Return tables of Python objects and floats, for the kernel as plain Python."""
    view = RunView(
        params=all_slotted(job.params),
        axes=[AxisState(end=job.law.end()) for _ in job.axes],
        samples=[Sample() for _ in job.axes],
        pairs=all_slotted(job.pairs),
        states=[PairState(link=job.law.link()) for _ in job.pairs],
        table=job.table.tolist(),
    )
    return Tables(
        runs=[job.run],
        fakes=[job.fake],
        outcomes=[RunState()],
        **with_views(view)._asdict(),
        devices=all_slotted(job.devices),
        bodies=[DeviceState(x=x) for x in job.start],
        flags=job.flags.tolist(),
        out=[0.0] * (job.run.cycles * len(job.columns)) if out is None else out,
    )


def records_of(kind: type[Any], values: Sequence[Any]) -> Array:
    """Return objects of a record class as NumPy records."""
    kinds = record_type(kind, **parts_of(values))
    return np.array([_plain(value) for value in values], dtype=kinds)


def blank_records(kind: type[Any], count: int, **parts: Any) -> Array:
    """Return NumPy records of a record class, all numbers zero; `parts` as for `record_type`."""
    return np.zeros(count, dtype=record_type(kind, **parts))


class Fields:
    """A NumPy record as an object: its fields are read and written where they are."""

    __slots__ = ("_record",)

    def __init__(self, record: Any) -> None:
        object.__setattr__(self, "_record", record)

    def __getattr__(self, name: str) -> Any:
        """Return a field: a number, or the fields of a record in it."""
        value = self._record[name]
        return Fields(value) if isinstance(value, np.void) else value.item()

    def __setattr__(self, name: str, value: Any) -> None:
        """Write a field."""
        self._record[name] = value


def view_of(values: Any) -> memoryview[float]:
    """Return an array's memory: indexed at a third of an array's cost."""
    return memoryview(values)


def _plain(value: Any) -> Any:
    """Return a state as nested tuples, which NumPy takes as records; NamedTuples are some."""
    if is_dataclass(value):
        return tuple(_plain(getattr(value, field.name)) for field in fields(value))
    return value
