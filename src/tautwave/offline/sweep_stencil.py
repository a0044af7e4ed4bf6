"""Points of a family packed from the first of them: only what their values reach is made anew.

What is made anew is made by the same functions from the same rig, and kept for the next point with
the same values: on a grid of 100 by 100 every device and every side is packed 100 times.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from tautwave.config import Rig
from tautwave.errors import ConfigError
from tautwave.offline.pack import (
    Array,
    Job,
    Pieces,
    RigFacts,
    draw_missing,
    draw_noise,
    draw_overruns,
    pack_device,
    pack_pair,
    pack_side,
    true_model,
)
from tautwave.offline.records import DeviceParams
from tautwave.offline.sweep_family import KEPT as FAMILIES
from tautwave.offline.sweep_family import Family, Values
from tautwave.offline.sweep_near import DEVICE, PAIR, SIDE, Part
from tautwave.offline.tables import Form, Tables, image_of
from tautwave.rig import SEED_WORD

KEPT = 4096
"""Records of one part that are kept, some 5 kB each: those of two axes of 60 values."""


MEMORY = 64_000_000
"""Bytes of tables that the stencils of several families may hold; a single one may hold more."""


class Made(NamedTuple):
    """The constants of one part, and the bytes of them in a table."""

    params: Any
    image: bytes


class _Reached(NamedTuple):
    """A part that some values reach: its place among its kind, and those values' places."""

    part: Part
    number: int
    values: tuple[int, ...]
    kept: dict[tuple[float, ...], Made]


class Pressed(NamedTuple):
    """A point that differs from its family: what goes into the holes, and what is drawn for it."""

    made: list[Made]
    table: Array
    flags: Array


class Stencil:
    """The packed tables of a family, with holes where its points differ.

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
        for at, near in enumerate(family.nears):
            for part in near.parts:
                reached.setdefault(part, []).append(at)
        names = {DEVICE: job.axes, SIDE: job.axes, PAIR: tuple(job.rig.coupling.pairs)}
        self._reached = [
            _Reached(part, names[part.kind].index(part.name), tuple(values), {})
            for part, values in reached.items()
        ]
        cycles = job.run.cycles
        models = [true_model(job.rig, name, facts.delays[name], cycles) for name in job.axes]
        self._drawn = [
            (model, device)
            for model, device in zip(models, job.devices, strict=True)
            if device.loses or device.position_noise > 0.0
        ]
        self._form: Form | None = None
        self._written: list[Made | None] = [None] * len(self._reached)

    def press(self, values: Values, seed: int) -> Pressed | None:
        """Return what makes a point of the family, None if it has to be packed as a whole."""
        read = self._family.read(values)
        if read is None:
            return None
        rig: Rig | None = None
        found = []
        for reached in self._reached:
            key = tuple([read[at] for at in reached.values])
            made = reached.kept.get(key)
            if made is None:
                try:
                    rig = self._family.rig(read) if rig is None else rig
                    params = self._pack(reached, rig)
                except ConfigError:
                    return None  # who packs it as a whole says what is wrong
                if params is None:
                    return None
                if len(reached.kept) >= KEPT:
                    reached.kept.clear()
                made = reached.kept[key] = Made(params, image_of(params))
            found.append(made)
        return Pressed(found, *self._draw(seed))

    @property
    def size(self) -> int:
        """Bytes of its tables, twice: as they are before a run, and after."""
        return 2 * int(self.job.table.nbytes + self.job.flags.nbytes)

    @property
    def is_drawn(self) -> bool:
        """Whether there is noise or a mishap, which each point draws for itself by its seed."""
        return self.job.run.overruns or bool(self._drawn)

    def _draw(self, seed: int) -> tuple[Array, Array]:
        """Return floats and flags with noise and mishaps of a seed."""
        job, cycles = self.job, self.job.run.cycles
        if not self.is_drawn:
            return job.table, job.flags
        table, flags = job.table.copy(), job.flags.copy()
        assert job.rig.simulation is not None
        overruns = draw_overruns(seed, job.rig.simulation.faults.overrun_probability, cycles)
        flags[: len(overruns)] = overruns
        for model, device in self._drawn:
            own = model._replace(seed=(seed % SEED_WORD, *model.seed[1:]))
            noise, missing = draw_noise(own, cycles), draw_missing(own, cycles)
            table[device.noise : device.noise + len(noise)] = noise
            flags[device.missing : device.missing + len(missing)] = missing
        return table, flags

    def _pack(self, reached: _Reached, rig: Rig) -> Any:
        """Return the constants of one part, None if they would need tables of other sizes."""
        job, (kind, name), number = self.job, reached.part, reached.number
        if kind == PAIR:
            return pack_pair(rig, name, job.axes, job.pairs[number].line)
        delay = self._facts.delays[name]
        if kind == SIDE:
            return pack_side(rig, name, delay, job.sides[number].pipe)
        cycles = job.run.cycles
        model = true_model(rig, name, delay, cycles)
        own: DeviceParams = job.devices[number]
        made = pack_device(model, Pieces(np.float64), Pieces(np.bool_), cycles)
        same = (made.delay, made.last, model.start_position)
        if same != (own.delay, own.last, job.start[number]):
            return None
        return made._replace(
            pipe=own.pipe, reference=own.reference, noise=own.noise, missing=own.missing
        )

    def filled(self, pressed: Pressed) -> Job:
        """Return the whole job of a point."""
        parts: dict[str, list[Any]] = {
            DEVICE: list(self.job.devices),
            SIDE: list(self.job.sides),
            PAIR: list(self.job.pairs),
        }
        for reached, made in zip(self._reached, pressed.made, strict=True):
            parts[reached.part.kind][reached.number] = made.params
        return self.job._replace(
            devices=tuple(parts[DEVICE]),
            sides=tuple(parts[SIDE]),
            pairs=tuple(parts[PAIR]),
            table=pressed.table,
            flags=pressed.flags,
        )

    def tables(self, pressed: Pressed, out: Array) -> Tables:
        """Return the tables of a point as NumPy records; they hold until the next one's."""
        if self._form is None or self._form.tables.out is not out:
            self._form = Form(self.job, out)
            self._written = [None] * len(self._reached)
        for at, (reached, made) in enumerate(zip(self._reached, pressed.made, strict=True)):
            if self._written[at] is not made:
                self._form.write(reached.part.kind, reached.number, made.image)
                self._written[at] = made
        return self._form.begin(pressed.table, pressed.flags)


class Stencils:
    """The stencils of the families that came last.

    Parameters
    ----------
    make : callable
        Returns the stencil of a family, None where each point is packed alone.
    """

    def __init__(self, make: Callable[[Family], Stencil | None]) -> None:
        self._make = make
        self._found: OrderedDict[Family, Stencil | None] = OrderedDict()
        self._size = 0

    def of(self, family: Family) -> Stencil | None:
        """Return the stencil of a family, made if it is not there any more."""
        if family in self._found:
            self._found.move_to_end(family)
            return self._found[family]
        stencil = self._found[family] = self._make(family)
        self._size += stencil.size if stencil is not None else 0
        while len(self._found) > 1 and (self._size > MEMORY or len(self._found) > FAMILIES):
            _, oldest = self._found.popitem(last=False)
            self._size -= oldest.size if oldest is not None else 0
        return stencil
