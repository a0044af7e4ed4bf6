"""Haptic performance of a rig: stiffest walls, what is felt, limit cycles of walls that fail."""

from __future__ import annotations

from typing import Any, NamedTuple

from tautwave.certificate.belief import declared_delays
from tautwave.certificate.derate import derate_walls
from tautwave.certificate.haptics.cycles import WallCycle, wall_cycles
from tautwave.certificate.haptics.feel import Feel, rig_feel
from tautwave.certificate.haptics.transparency import Felt, pair_felt
from tautwave.certificate.haptics.width import AxisWidth, axis_width
from tautwave.config import Rig

__all__ = ["AxisWidth", "Feel", "Felt", "Haptics", "WallCycle", "haptics"]


class Haptics(NamedTuple):
    """Result of `haptics`.

    `silent` holds a sentence for each axis or pair without a result.
    """

    widths: tuple[AxisWidth, ...]
    felt: tuple[Felt, ...]
    feel: tuple[Feel, ...]
    cycles: tuple[WallCycle, ...]
    silent: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return plain data for JSON; infinity is null."""
        return {
            "z_width": {one.axis: one.as_dict() for one in self.widths},
            "transparency": {one.pair: one.as_dict() for one in self.felt},
            "feel": {one.pair: one.as_dict() for one in self.feel},
            "limit_cycles": {one.name: one.as_dict() for one in self.cycles},
            "silent": list(self.silent),
        }

    def sentences(self) -> list[tuple[str, list[str]]]:
        """Return headings with the sentences under each."""
        told = [line for one in self.feel for line in one.sentences()]
        headed = [
            ("Stiffest wall", [one.sentence() for one in self.widths]),
            ("Felt by the hand", [*told, *(line for one in self.felt for line in one.sentences())]),
            ("Limit cycles", [line for one in self.cycles for line in one.sentences()]),
            ("Not said", list(self.silent)),
        ]
        return [(heading, lines) for heading, lines in headed if lines]


def haptics(rig: Rig) -> Haptics:
    """Return the haptic performance of a rig; takes a second or two.

    All but `feel`, which is simulated, is from its believed parameters. Walls are as run: derated
    where the rig allows it.
    """
    if rig.scene is not None:
        return Haptics((), (), (), (), ("the hand touches a scene; see its certificate",))
    delays = declared_delays(rig)
    rig, _ = derate_walls(rig, delays, {})
    widths = tuple(
        axis_width(rig, name, delays)
        for name, axis in rig.axes.items()
        if axis.causality == "impedance"
    )
    silent = [
        f"{name}: it is velocity-controlled, and no theorem used here covers a wall on it"
        for name, axis in rig.axes.items()
        if axis.causality != "impedance"
    ]
    felt = []
    for pair in rig.coupling.pairs:
        pair_result = pair_felt(rig, pair, delays)
        if isinstance(pair_result, str):
            silent.append(pair_result)
        else:
            felt.append(pair_result)
    feel, unfelt = rig_feel(rig)
    return Haptics(widths, tuple(felt), feel, wall_cycles(rig, delays), (*silent, *unfelt))
