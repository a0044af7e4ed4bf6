"""What building a rig asks of the package behind `scene`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from tautwave import registry
from tautwave.config import Rig
from tautwave.config.keys.control import SCENE
from tautwave.runtime.control import Control
from tautwave.types import CommandDelay


class RigHooks(Protocol):
    """The controller of a rig with a scene."""

    def build(self, rig: Rig, delays: Mapping[str, CommandDelay], cycles: int) -> Control:
        """Return the controller; `delays` by axis, in the order of the buses and their axes."""

    def order(self, control: Control) -> Sequence[int]:
        """Return the axes that a controller holds, in the order of its columns."""


def rig_hooks() -> RigHooks:
    """Return the hooks.

    Raises
    ------
    ConfigError
        The package is not installed, or does not import.
    """
    hooks: RigHooks = registry.control_hooks(SCENE, "rig")
    return hooks
