"""What the rig file asks of the package behind `scene`."""

from __future__ import annotations

from typing import Any, Protocol

from tautwave import registry
from tautwave.config.keys.control import SCENE, ControlKeys
from tautwave.config.pieces import Parts
from tautwave.config.text.document import Document
from tautwave.errors import ConfigError


class ConfigHooks(Protocol):
    """Keys, checks and files of a `scene`."""

    def model_for(self, value: Any) -> type[ControlKeys]:
        """Return the block for a value of the file, whatever it is."""

    def blocks(self) -> Any:
        """Return the type of the key, all blocks it may be, for the schema."""

    def name_files(self, document: Document) -> None:
        """Make the paths of files absolute that have to be read to check the keys."""

    def check(self, document: Document, parts: Parts) -> None:
        """Note mistakes between its keys, and between them and others."""

    def complete(self, document: Document, keys: ControlKeys) -> ControlKeys:
        """Return its valid keys with every default explicit, and paths absolute."""


def config_hooks() -> ConfigHooks:
    """Return the hooks.

    Raises
    ------
    ConfigError
        The package is not installed, or does not import.
    """
    hooks: ConfigHooks = registry.control_hooks(SCENE, "config")
    return hooks


def hooks_of(document: Document) -> ConfigHooks | None:
    """Return the hooks for a document with a scene; None without one, or without the package."""
    if document.get((SCENE,)) is None:
        return None
    try:
        return config_hooks()
    except ConfigError:
        return None  # the rig's model reports it, at the key
