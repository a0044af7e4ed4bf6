"""A network of points in the live loop, stepped by compiled code: one call a cycle, same bits."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any

from tautwave.offline import compiled, space_tick
from tautwave.offline.blocks import lay_out
from tautwave.scene.ledger import Ledger
from tautwave.scene.space.arrays import INDEX_FIELDS, SpaceArrays
from tautwave.scene.space.live import SpaceModel
from tautwave.scene.space.network import SpaceNetwork

SCHEMES = {"symplectic": space_tick.SYMPLECTIC, "discrete_gradient": space_tick.GRADIENT}


@functools.cache
def compiled_space_tick() -> Callable[..., int]:
    """Return `tick_space` for numba; compiled at the first call, or read from the cache."""
    return compiled.cached(space_tick.tick_space)


class CompiledSpaceModel(SpaceModel):
    """A `SpaceModel` that is advanced by compiled code; its ledger is always taken.

    `arrays` are views into the memory that the compiled steps work on.

    Raises
    ------
    ConfigError
        Numba is not installed, or the scheme is none of points in space.
    """

    def __init__(self, network: SpaceNetwork, scheme: str, period: float) -> None:
        self._tick = compiled_space_tick()
        super().__init__(network, scheme, period, keep_books=True)
        self._tick(*self._given)  # loads the machine code, or makes it
        self.reset([0.0] * len(network.axes))

    def reset(self, positions: Sequence[float]) -> None:
        """Put everything back to the start, with the axes of the ports at `positions` [m]."""
        super().reset(positions)
        axes = len(self.network.axes)
        given: dict[str, Any] = {
            **self.arrays._asdict(),
            "axes_at": list(positions),
            "pushes": [0.0] * len(self._forced),
            "ways": [part for _, way in self._forced for part in way],
            "efforts": [0.0] * axes,
            "ledger": [0.0] * len(Ledger._fields),
            "forced": [at for at, _ in self._forced],
        }
        blocks = lay_out(given, (*INDEX_FIELDS, "forced"))
        views = blocks.views
        self.arrays = SpaceArrays(*(views[name] for name in SpaceArrays._fields))
        self._axes_in, self._pushes = views["axes_at"], views["pushes"]
        self._efforts, self._told = views["efforts"], views["ledger"]
        number = SCHEMES[self.scheme]
        self._given = (blocks.floats, blocks.whole, blocks.at, number, self.period)

    def take_state(self, model: SpaceModel) -> None:
        """Go on from the state of another model of the same network."""
        for values, others in zip(self.arrays, model.arrays, strict=True):
            for at, value in enumerate(others):
                values[at] = value
        self.start, self.booked = model.start, model.booked

    def advance(self, positions: Sequence[float], pushes: Sequence[float] = ()) -> list[float]:
        """Take where the axes are and every outside force; step; give the efforts."""
        given = self._axes_in
        for axis, position in enumerate(positions):
            given[axis] = position
        given = self._pushes
        for at, push in enumerate(pushes):
            given[at] = push
        self._tick(*self._given)
        self.booked = Ledger(*self._told)
        return list(self._efforts)
