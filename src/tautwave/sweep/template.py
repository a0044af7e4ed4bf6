"""Packing the points of a family from a template: only records that their values affect change.

Changed records are built by the same functions from the same rig, and cached for the next point
with the same values: on a 100 by 100 grid every device and every side is packed 100 times.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from tautwave.config import Rig
from tautwave.errors import ConfigError
from tautwave.rig import axis_params, pair_params
from tautwave.simulation.kernel.pack import (
    Array,
    Job,
    Pieces,
    RigFacts,
    draw_missing,
    draw_noise,
    draw_overruns,
    draw_sensor_noise,
    pack_device,
    true_model,
)
from tautwave.simulation.kernel.records import DeviceParams, Tables
from tautwave.simulation.kernel.tables import Form, image_of
from tautwave.streams import SEED_WORD
from tautwave.sweep.family import KEPT as FAMILIES
from tautwave.sweep.family import Family, Values
from tautwave.sweep.local_keys import AXIS, DEVICE, PAIR, Part

KEPT = 4096
"""Cache size per part, about 5 kB a record: enough for two axes of 60 values."""


MEMORY = 64_000_000
"""Bytes that the templates of several families may occupy; a single one may be larger."""


class Made(NamedTuple):
    """The constants of one part, and their bytes in a table."""

    params: Any
    image: bytes


class _Reached(NamedTuple):
    """A part affected by some values: its index among its kind, and the indices of those values."""

    part: Part
    number: int
    values: tuple[int, ...]
    kept: dict[tuple[float, ...], Made]


class Instance(NamedTuple):
    """One point of a family: the records that replace the template's, and its random draws."""

    made: list[Made]
    table: Array
    flags: Array


class Template:
    """The packed tables of a family; records in which its points differ are replaced per point.

    Parameters
    ----------
    family : Family
        The points.
    job : Job
        Tables of the family's own rig.
    facts : RigFacts
        With which it was packed.
    """

    def __init__(self, family: Family, job: Job, facts: RigFacts) -> None:
        self.job = job
        self._family = family
        self._facts = facts
        reached: dict[Part, list[int]] = {}
        for at, local in enumerate(family.keys):
            for part in local.parts:
                reached.setdefault(part, []).append(at)
        names = {DEVICE: job.axes, AXIS: job.axes, PAIR: tuple(job.rig.coupling.pairs)}
        self._reached = [
            _Reached(part, names[part.kind].index(part.name), tuple(values), {})
            for part, values in reached.items()
        ]
        cycles = job.run.cycles
        models = [true_model(job.rig, name, facts.delays[name], cycles) for name in job.axes]
        self._drawn = [
            (model, device)
            for model, device in zip(models, job.devices, strict=True)
            if device.loses or device.position_noise > 0.0 or device.sensor.noise > 0.0
        ]
        link = job.rig.link
        self._seeded = [
            end.seed
            for q in job.pairs
            if link is not None and link.seed is None
            for end in (q.link.master, q.link.slave)
        ]
        self._form: Form | None = None
        self._written: list[Made | None] = [None] * len(self._reached)

    def instantiate(self, values: Values, seed: int) -> Instance | None:
        """Return a point of the family as an instance, None if it must be packed as a whole."""
        read = self._family.read(values)
        if read is None:
            return None
        rig: Rig | None = None
        numbers = []
        for reached in self._reached:
            key = tuple([read[at] for at in reached.values])
            made = reached.kept.get(key)
            if made is None:
                try:
                    rig = self._family.rig(read) if rig is None else rig
                    params = self._pack(reached, rig)
                except ConfigError:
                    return None  # packing the whole point reports the error
                if params is None:
                    return None
                if len(reached.kept) >= KEPT:
                    reached.kept.clear()
                made = reached.kept[key] = Made(params, image_of(params))
            numbers.append(made)
        return Instance(numbers, *self._draw(seed))

    @property
    def size(self) -> int:
        """Size of its tables in bytes, counted twice: before a run, and after."""
        return 2 * int(self.job.table.nbytes + self.job.flags.nbytes)

    @property
    def is_drawn(self) -> bool:
        """Whether there is noise or a fault, drawn from each point's own seed."""
        return self.job.fake.overruns or bool(self._drawn or self._seeded)

    def _draw(self, seed: int) -> tuple[Array, Array]:
        """Return floats and flags with the noise and faults of a seed."""
        job, cycles = self.job, self.job.run.cycles
        if not self.is_drawn:
            return job.table, job.flags
        table, flags = job.table.copy(), job.flags.copy()
        table[self._seeded] = seed % SEED_WORD
        assert job.rig.simulation is not None
        overruns = draw_overruns(seed, job.rig.simulation.faults.overrun_probability, cycles)
        flags[: len(overruns)] = overruns
        for model, device in self._drawn:
            own = model._replace(seed=(seed % SEED_WORD, *model.seed[1:]))
            noise, missing = draw_noise(own, cycles), draw_missing(own, cycles)
            table[device.noise : device.noise + len(noise)] = noise
            loud = draw_sensor_noise(own, cycles)
            table[device.sensor_noise : device.sensor_noise + len(loud)] = loud
            flags[device.missing : device.missing + len(missing)] = missing
        return table, flags

    def _pack(self, reached: _Reached, rig: Rig) -> Any:
        """Return the constants of one part, None if they need tables of a different size."""
        job, (kind, name), number = self.job, reached.part, reached.number
        if kind == PAIR:
            return pair_params(rig, name, job.axes, job.pairs[number].line)
        delay = self._facts.delays[name]
        if kind == AXIS:
            return axis_params(rig, name, delay, job.params[number].pipe)
        cycles = job.run.cycles
        model = true_model(rig, name, delay, cycles)
        own: DeviceParams = job.devices[number]
        made = pack_device(model, Pieces(np.float64), Pieces(np.bool_), cycles)
        same = (made.delay, made.last, made.pushes, model.start_position)
        if same != (own.delay, own.last, own.pushes, job.start[number]):
            return None
        return made._replace(
            pipe=own.pipe, reference=own.reference, noise=own.noise, missing=own.missing,
            push=own.push, sensed=own.sensed, sensor_noise=own.sensor_noise,
        )  # fmt: skip

    def filled(self, instance: Instance) -> Job:
        """Return the whole job of a point."""
        parts: dict[str, list[Any]] = {
            DEVICE: list(self.job.devices),
            AXIS: list(self.job.params),
            PAIR: list(self.job.pairs),
        }
        for reached, made in zip(self._reached, instance.made, strict=True):
            parts[reached.part.kind][reached.number] = made.params
        return self.job._replace(
            devices=tuple(parts[DEVICE]),
            params=tuple(parts[AXIS]),
            pairs=tuple(parts[PAIR]),
            table=instance.table,
            flags=instance.flags,
        )

    def tables(self, instance: Instance, out: Array) -> Tables:
        """Return the tables of a point as NumPy records, valid until the next call."""
        if self._form is None or self._form.tables.out is not out:
            self._form = Form(self.job, out)
            self._written = [None] * len(self._reached)
        for at, (reached, made) in enumerate(zip(self._reached, instance.made, strict=True)):
            if self._written[at] is not made:
                self._form.write(reached.part.kind, reached.number, made.image)
                self._written[at] = made
        return self._form.begin(instance.table, instance.flags)


class Templates:
    """A bounded cache of the templates of the most recent families.

    Parameters
    ----------
    make : callable
        Returns the template of a family, None where each point is packed alone.
    """

    def __init__(self, make: Callable[[Family], Template | None]) -> None:
        self._make = make
        self._found: OrderedDict[Family, Template | None] = OrderedDict()
        self._size = 0

    def of(self, family: Family) -> Template | None:
        """Return the template of a family, building it if it is not cached."""
        if family in self._found:
            self._found.move_to_end(family)
            return self._found[family]
        template = self._found[family] = self._make(family)
        self._size += template.size if template is not None else 0
        while len(self._found) > 1 and (self._size > MEMORY or len(self._found) > FAMILIES):
            _, oldest = self._found.popitem(last=False)
            self._size -= oldest.size if oldest is not None else 0
        return template
