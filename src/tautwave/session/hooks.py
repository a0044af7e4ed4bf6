"""What checks and runs ask of the package behind `scene`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from tautwave import registry
from tautwave.config import Rig
from tautwave.config.keys.control import SCENE
from tautwave.rig import BusWay
from tautwave.types import CommandDelay

if TYPE_CHECKING:
    from tautwave.rig import Assembly


class Engine(Protocol):
    """The engine of a run (`python` or `compiled`), and what a user reads about it."""

    @property
    def name(self) -> str:
        """Which steps."""

    @property
    def sentences(self) -> tuple[str, ...]:
        """What the summary says of them."""

    def warnings(self) -> list[str]:
        """Return what is said before the run."""


class SessionHooks(Protocol):
    """A rig with a scene from its check to its summary."""

    def plan(self, rig: Rig) -> Iterable[tuple[str, bool, str, str]]:
        """Yield its elements: name, whether it is in, why, and why not."""

    def words(self, rig: Rig) -> str:
        """Return what stands in place of a coupling."""

    def facts(self, rig: Rig, *, brief: bool) -> list[tuple[str, str]]:
        """Return what `check` says of it beside the certificate; `brief`: on one screen."""

    def prompt_claim(self, rig: Rig, delays: Mapping[str, CommandDelay]) -> float:
        """Return what all its ports may supply together before a run has stopped [J]; inf: all."""

    def choose_engine(self, rig: Rig, clock: str, ways: Mapping[str, BusWay]) -> Engine:
        """Return the engine that keeps the rate.

        Raises
        ------
        BusBudgetError
            On the real clock, if none does.
        """

    def use_engine(self, assembly: Assembly, engine: str) -> Assembly:
        """Return a built rig that is run by this engine."""

    def keep_files(self, rig: Rig, directory: Path) -> Rig:
        """Copy its files into the directory of a run; return the rig that names the copies."""

    def summary(self, assembly: Assembly, engine: str) -> dict[str, Any]:
        """Return its block of a run's summary."""


def session_hooks() -> SessionHooks:
    """Return the hooks.

    Raises
    ------
    ConfigError
        The package is not installed, or does not import.
    """
    hooks: SessionHooks = registry.control_hooks(SCENE, "session")
    return hooks
