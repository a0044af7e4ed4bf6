"""The report of a run with a scene: what `tautwave.report.hooks` asks for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from tautwave.columns import Column
from tautwave.config import Rig
from tautwave.report.run.parts import Part
from tautwave.report.run.rundir import Run
from tautwave_scenes.report.books import claim, given
from tautwave_scenes.report.books import scene_books as books
from tautwave_scenes.report.files import write_scene as write_files
from tautwave_scenes.report.precision_table import scene_sentences as precision_sentences
from tautwave_scenes.report.precision_table import scene_tables as precision_tables

SECTIONS = {
    "A scene": (
        Column("scene.kinetic", "J", "now in the masses"),
        Column("scene.stored", "J", "now in the links"),
        Column("scene.lifted", "J", "now held against gravity"),
        Column("scene.lost", "J", "dissipated by dampers, friction, plastic links and contacts"),
        Column("scene.made", "J", "created by negative dampers and energy sources"),
        Column("scene.numeric", "J", "created by a scheme that holds forces over a step"),
        Column("scene.port_work", "J", "done by the ports"),
        Column("scene.pumped", "J", "done by external forces"),
        Column("scene.residual", "J", "residual of the network's energy balance: rounding"),
        Column(
            "scene.hold",
            "J",
            "energy that the network received beyond what the devices "
            "supplied, due to the effort hold",
        ),
        Column(
            "scene.asked.PORT", "N m, N", "effort commanded by the network at a port, before limits"
        ),
        Column(
            "scene.at.NODE",
            "m",
            "position of a node; in three dimensions one column per coordinate",
        ),
    ),
}


__all__ = [
    "books",
    "claim",
    "columns",
    "given",
    "parts",
    "precision",
    "precision_sentences",
    "precision_tables",
    "write_files",
]


def columns() -> Mapping[str, tuple[Column, ...]]:
    """Return the columns by section."""
    return SECTIONS


def parts(run: Run) -> Iterator[Part]:
    """Yield the section of the page."""
    from tautwave_scenes.report.page import scene_parts  # with figures, which a summary needs not

    return scene_parts(run)


def precision(run: Run, rig: Rig) -> dict[str, Any]:
    """Return the precision of a run's network along the recorded motion of its ports."""
    from tautwave_scenes.report.precision import scene_precision

    return scene_precision(run, rig)
