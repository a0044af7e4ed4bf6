"""A 3D network in the live loop, stepped by compiled code: one call per cycle, bit-identical."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any

from tautwave.simulation.kernel import compiled
from tautwave_scenes.networks.ledger import Ledger
from tautwave_scenes.networks3d.arrays import INDEX_FIELDS, Arrays3d
from tautwave_scenes.networks3d.elements import Elements
from tautwave_scenes.networks3d.live import Model3d
from tautwave_scenes.networks3d.network import Network3d
from tautwave_scenes.simulation import tick3d
from tautwave_scenes.simulation.blocks import lay_out, put
from tautwave_scenes.simulation.sources import SOURCES

SCHEMES = {
    "symplectic": tick3d.SYMPLECTIC,
    "discrete_gradient": tick3d.GRADIENT,
    "linearly_implicit": tick3d.LINEARLY,
}


@functools.cache
def compiled_tick3d() -> Callable[..., int]:
    """Return `tick_network3d` for numba; compiled at the first call, or read from the cache."""
    return compiled.cached(tick3d.tick_network3d, more=SOURCES)


class CompiledModel3d(Model3d):
    """A `Model3d` that is advanced by compiled code; its ledger is always taken.

    `arrays` are views into the memory that the compiled steps work on.

    Raises
    ------
    ConfigError
        Numba is not installed, or the scheme does not support 3D networks.
    """

    def __init__(self, network: Network3d, scheme: str, period: float) -> None:
        self._tick = compiled_tick3d()
        super().__init__(network, scheme, period, keep_books=True)
        self._tick(*self._given)  # loads the machine code, or compiles it
        self.reset([0.0] * len(network.axes))

    def reset(self, positions: Sequence[float]) -> None:
        """Reset to the start, with the devices' axes at `positions` [m or rad]."""
        super().reset(positions)
        given: dict[str, Any] = {
            **_numbers(self.arrays),
            "axes_at": list(self._spread(positions)),
            "pushes": [0.0] * len(self._forced),
            "ways": [part for _, way in self._forced for part in way],
            "efforts": [0.0] * len(self.network.coordinates),
            "ledger": [0.0] * len(Ledger._fields),
            "forced": [at for at, _ in self._forced],
        }
        blocks = lay_out(given, (*INDEX_FIELDS, "forced"))
        views = blocks.views
        elements = Elements(*(views[name] for name in Elements._fields))
        own = {name: views[name] for name in Arrays3d._fields if name != "elements"}
        self.arrays = Arrays3d(**own, elements=elements)
        self._axes_in, self._pushes = views["axes_at"], views["pushes"]
        self._efforts, self._ledger = views["efforts"], views["ledger"]
        number = SCHEMES[self.scheme]
        self._given = (blocks.floats, blocks.whole, blocks.at, number, self.period)

    def take_state(self, model: Model3d) -> None:
        """Continue from the state of another model of the same network."""
        own, others = _numbers(self.arrays), _numbers(model.arrays)
        for name, values in others.items():
            for at, value in enumerate(values):
                own[name][at] = value
        self.start, self.booked = model.start, model.booked

    def _advance(self, positions: Sequence[float], pushes: Sequence[float]) -> list[float]:
        """Take coordinates of the ports and external forces; step; return the efforts."""
        put(self._axes_in, positions)
        put(self._pushes, pushes)
        self._tick(*self._given)
        self.booked = Ledger(*self._ledger)
        return list(self._efforts)


def _numbers(arrays: Arrays3d) -> dict[str, Any]:
    """Return the lists of a network by name, those of its elements last."""
    own = arrays._asdict()
    elements: Elements = own.pop("elements")
    return {**own, **elements._asdict()}
