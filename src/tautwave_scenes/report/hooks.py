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
from tautwave_scenes.report.columns import SECTIONS
from tautwave_scenes.report.files import write_scene as write_files
from tautwave_scenes.report.precision_table import scene_sentences as precision_sentences
from tautwave_scenes.report.precision_table import scene_tables as precision_tables

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
