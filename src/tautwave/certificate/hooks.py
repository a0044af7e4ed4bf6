"""What the certificate asks of the package behind `scene`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Protocol

from tautwave import registry
from tautwave.certificate.data import Certificate
from tautwave.config import Rig
from tautwave.config.keys.control import SCENE
from tautwave.types import CommandDelay

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class CertificateHooks(Protocol):
    """Verdicts on a rig with a scene, and their picture."""

    def certificate(
        self, rig: Rig, delays: Mapping[str, CommandDelay], passes: Mapping[str, str]
    ) -> Certificate:
        """Return the certificate; `passes` are the reasons of verdicts that pass plainly."""

    def figure(self, rig: Rig, delays: Mapping[str, CommandDelay]) -> Figure:
        """Return the picture of the certificate."""

    def caption(self) -> str:
        """Return what is written below it."""


def certificate_hooks() -> CertificateHooks:
    """Return the hooks.

    Raises
    ------
    ConfigError
        The package is not installed, or does not import.
    """
    hooks: CertificateHooks = registry.control_hooks(SCENE, "certificate")
    return hooks
