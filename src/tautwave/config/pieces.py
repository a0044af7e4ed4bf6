"""A rig file in pieces: the pieces that are valid on their own, though others may not be.

The cross-checks work on these pieces, so that a wrong number in one axis does not hide that another
axis names a bus that does not exist. An invalid piece is None: it has been reported.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

from tautwave.config.keys.chosen import named_block
from tautwave.config.keys.common import Block, Positive
from tautwave.config.keys.control import ControlKeys
from tautwave.config.keys.coupling import AnyLaw, AnyPair, Coupling, Pair, pair_block
from tautwave.config.keys.devices import Axis, Bus
from tautwave.config.keys.link import Link
from tautwave.config.keys.rig import Rig
from tautwave.config.keys.simulation import (
    AxisSimulation,
    EnvironmentPart,
    Foam,
    Free,
    Hand,
    HandPart,
    Recorded,
    SolidWall,
    Spring,
)
from tautwave.config.messages import salvage
from tautwave.config.text.document import Document
from tautwave.contracts import DriverPlugin

SIDES = ("master", "slave")

_ENVIRONMENTS: dict[str, type[Block]] = {
    "free": Free,
    "spring": Spring,
    "wall": SolidWall,
    "foam": Foam,
    "recorded": Recorded,
}


class _Timing(Block):
    value: Positive


class Parts(NamedTuple):
    """The pieces by name. `sides` lacks a side that is not a mapping; then `pairs` is None."""

    rate_hz: float | None
    duration_s: float | None
    buses: dict[str, Bus | None]
    plugins: dict[str, DriverPlugin | None]
    sides: dict[str, dict[str, Axis | None]]
    coupling: Coupling | None
    pairs: dict[str, Pair | None] | None
    simulated: bool
    truths: dict[str, AxisSimulation | None]
    hands: dict[str, Hand | HandPart | None]
    environments: dict[str, Block | None]
    scene: ControlKeys | None = None
    link: Link | None = None

    def axes(self) -> Iterator[tuple[str, str, Axis]]:
        """Yield side, name and axis of every valid axis."""
        for side, axes in self.sides.items():
            for name, axis in axes.items():
                if axis is not None:
                    yield side, name, axis

    def axis(self, side: str, name: str) -> Axis | None:
        """Return an axis, None if it is missing or invalid."""
        return self.sides.get(side, {}).get(name)


def take_apart(document: Document, plugins: dict[str, DriverPlugin | None]) -> Parts:
    """Return the pieces of a document."""
    get = document.get
    coupling = get(("coupling",))
    if isinstance(coupling, dict):
        coupling = {**coupling, "pairs": {}}
    environments = {
        name: _environment(block) for name, block in _named(get(("simulation", "environment")))
    }
    pairs = get(("coupling", "pairs"))
    return Parts(
        rate_hz=_number(get(("rate_hz",))),
        duration_s=_number(get(("duration_s",))),
        buses={name: salvage(Bus, block) for name, block in _named(get(("buses",)))},
        plugins=plugins,
        sides={
            side: {name: salvage(Axis, block) for name, block in get((side, "axes")).items()}
            for side in SIDES
            if isinstance(get((side, "axes")), dict)
        },
        coupling=_coupling(coupling),
        pairs=None
        if not isinstance(pairs, dict)
        else {name: _pair(coupling, block) for name, block in pairs.items()},
        simulated=get(("simulation",)) is not None,
        truths={
            name: salvage(AxisSimulation, block)
            for name, block in _named(get(("simulation", "axes")))
        },
        hands={
            name: salvage(named_block(Hand | HandPart, block), block)
            for name, block in _named(get(("simulation", "hand")))
        },
        environments=environments,
        scene=_scene(get(("scene",))),
        link=salvage(Link, get(("link",))),
    )


def pieces_of(rig: Rig, document: Document, plugins: dict[str, DriverPlugin | None]) -> Parts:
    """Return what `take_apart` makes of the document of a valid rig, from the rig itself.

    A model for each kind of piece is built for nothing else: a tenth of the reading of a small rig.
    """
    get, simulation = document.get, rig.simulation
    return Parts(
        rate_hz=rig.rate_hz,
        duration_s=rig.duration_s,
        buses=dict(rig.buses),
        plugins=plugins,
        sides={
            side: dict(getattr(rig, side).axes)
            for side in SIDES
            if isinstance(get((side, "axes")), dict)
        },
        coupling=rig.coupling if isinstance(get(("coupling",)), dict) else None,
        pairs=dict(rig.coupling.pairs) if isinstance(get(("coupling", "pairs")), dict) else None,
        simulated=simulation is not None,
        truths={} if simulation is None else dict(simulation.axes),
        hands={} if simulation is None else dict(simulation.hand),
        environments={} if simulation is None else dict(simulation.environment),
        scene=rig.scene,
        link=rig.link,
    )


def _scene(block: Any) -> ControlKeys | None:
    if block is None:
        return None  # no package is looked for
    keys: ControlKeys | None = salvage(ControlKeys.model_for(block), block)
    return keys


def _coupling(block: Any) -> Coupling | None:
    """Return the coupling with the keys of its law or, if those are invalid, those of all laws."""
    model = Coupling.model_for(block)
    piece: Coupling | None = salvage(model, block)
    return salvage(AnyLaw, block) if piece is None and model.part_word else piece


def _pair(coupling: Any, block: Any) -> Pair | None:
    """Return a pair with the keys of its law or, if those are invalid, those of all laws."""
    piece: Pair | None = salvage(pair_block(Coupling.model_for(coupling)), block)
    return salvage(AnyPair, block) if piece is None else piece


def _named(block: Any) -> list[tuple[str, Any]]:
    return list(block.items()) if isinstance(block, dict) else []


def _number(value: Any) -> float | None:
    timing: _Timing | None = salvage(_Timing, {"value": value})
    return None if timing is None else timing.value


def _environment(block: Any) -> Block | None:
    if isinstance(block, dict) and "part" in block:
        model = named_block(Free | EnvironmentPart, block)
        part: Block | None = salvage(model, block)
        return part
    kind = block.get("type") if isinstance(block, dict) else None
    model = _ENVIRONMENTS.get(kind) if isinstance(kind, str) else None
    piece: Block | None = None if model is None else salvage(model, block)
    return piece
