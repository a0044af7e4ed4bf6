"""What reports ask of the package behind `scene`, but for the page: that is `run.page_hooks`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Protocol

from tautwave import registry
from tautwave.columns import Column
from tautwave.config import Rig
from tautwave.config.keys.control import SCENE
from tautwave.report.figures.envelope import Floats

if TYPE_CHECKING:
    from tautwave.report.run.rundir import Run


class ReportHooks(Protocol):
    """The report of a run with a scene."""

    def columns(self) -> Mapping[str, tuple[Column, ...]]:
        """Return what its recorded columns are, by section."""

    def books(self, run: Run) -> dict[str, float | None]:
        """Return the totals of its energy books [J]: gross_flow, residual, generated."""

    def given(self, run: Run) -> Floats | None:
        """Return what it gave to itself by holding efforts [J], (rows,); None if not recorded."""

    def claim(self, rig: Rig) -> float:
        """Return how much of that it may give [J]."""

    def write_files(self, run: Run) -> None:
        """Write what stands beside the page: an animation, a sound."""

    def precision(self, run: Run, rig: Rig) -> dict[str, Any]:
        """Return the precision of a run, as plain numbers; `kind` is the rig's key."""


def report_hooks() -> ReportHooks:
    """Return the hooks.

    Raises
    ------
    ConfigError
        The package is not installed, or does not import.
    """
    hooks: ReportHooks = registry.control_hooks(SCENE, "report")
    return hooks
