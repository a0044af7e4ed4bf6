"""What the page of a run asks of the package behind `scene`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Protocol

from tautwave import registry
from tautwave.config.keys.control import SCENE
from tautwave.report.run.parts import Part
from tautwave.report.run.rundir import Run
from tautwave.tables import Table


class PageHooks(Protocol):
    """The page of a run with a scene."""

    def parts(self, run: Run) -> Iterable[Part]:
        """Yield its section."""

    def precision_sentences(self, precision: dict[str, Any]) -> Iterable[str]:
        """Yield what is said of its precision."""

    def precision_tables(self, precision: dict[str, Any]) -> Iterable[Table]:
        """Yield the tables of its precision."""


def page_hooks() -> PageHooks:
    """Return the hooks.

    Raises
    ------
    ConfigError
        The package is not installed, or does not import.
    """
    hooks: PageHooks = registry.control_hooks(SCENE, "report")
    return hooks
