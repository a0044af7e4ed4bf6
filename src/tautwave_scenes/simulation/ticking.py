"""A scene in the live loop, stepped by compiled code: one call per cycle, bit-identical."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from typing import Any

from tautwave.simulation.kernel import compiled
from tautwave_scenes.networks.compiling import INDEX_FIELDS, Arrays
from tautwave_scenes.networks.ledger import Ledger
from tautwave_scenes.networks.live import SceneModel
from tautwave_scenes.networks.network import Network
from tautwave_scenes.simulation import tick as network_tick
from tautwave_scenes.simulation.blocks import lay_out, put
from tautwave_scenes.simulation.playing import SCHEMES, flows_of
from tautwave_scenes.simulation.sources import SOURCES

_WHOLE = (*INDEX_FIELDS, "flows.sizes", "flows.parts", "forced")


def can_tick() -> bool:
    """Return whether the compiler for the steps is installed."""
    return find_spec("numba") is not None


@functools.cache
def compiled_tick() -> Callable[..., int]:
    """Return `tick_network` for numba; compiled at the first call, or read from the cache."""
    return compiled.cached(network_tick.tick_network, more=SOURCES)


class CompiledScene(SceneModel):
    """A `SceneModel` that is advanced by compiled code; its ledger is always taken.

    `arrays` are views into the memory that the compiled steps work on. Strings stay in Python.

    Raises
    ------
    ConfigError
        Numba is not installed, or the scheme does not support this network.
    """

    def __init__(self, network: Network, scheme: str, period: float) -> None:
        self._tick = compiled_tick()
        super().__init__(network, scheme, period, keep_books=True)
        before = [list(values) for values in self.arrays]
        self._tick(*self.given)  # loads the machine code, or compiles it
        for values, was in zip(self.arrays, before, strict=True):
            for at, value in enumerate(was):
                values[at] = value

    def reset(self, positions: Sequence[float]) -> None:
        """Reset to the start, with the ports at `positions` [m]."""
        super().reset(positions)
        flows = flows_of(self)
        ports, forced = len(self.network.ports), self._forced
        given: dict[str, Any] = {
            **self.arrays._asdict(),
            **{f"flows.{name}": values for name, values in flows._asdict().items()},
            "ports": [0.0] * ports,
            "pushes": [0.0] * len(forced),
            "efforts": [0.0] * ports,
            "ledger": [0.0] * len(Ledger._fields),
            "forced": forced,
        }
        blocks = lay_out(given, _WHOLE)
        views = blocks.views
        self.arrays = Arrays(*(views[name] for name in Arrays._fields))
        self._ports_in, self._pushes = views["ports"], views["pushes"]
        self._efforts, self.figures = views["efforts"], views["ledger"]
        number = SCHEMES[self.scheme]
        self.given = (blocks.floats, blocks.whole, blocks.at, number, self.period)

    def advance(self, positions: Sequence[float], pushes: Sequence[float] = ()) -> list[float]:
        """Take port positions and external forces; step; return efforts."""
        put(self._ports_in, positions)
        put(self._pushes, pushes)
        if not self.strings:
            self._tick(*self.given)
            self.booked = Ledger(*self.figures)
            return list(self._efforts)
        s = self.arrays
        for string in self.strings:
            string.push(s)
        self._tick(*self.given)
        for string in self.strings:
            string.carry_on(s)
        self.booked = self.with_strings(Ledger(*self.figures))
        return list(self._efforts)
