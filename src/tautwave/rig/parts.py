"""The declaration of a rig's coupling law."""

from __future__ import annotations

from tautwave import registry
from tautwave.config import Rig
from tautwave.contracts import CouplingPlugin

ACCOUNT = "tautwave.couplings.account:with_account"
"""What puts a law in an account; loaded where a rig has one."""


def coupling_part(rig: Rig) -> CouplingPlugin:
    """Return the declaration of a rig's coupling law, in an account if there is one."""
    part = registry.load_coupling(rig.coupling.law)
    if part.variant:
        part = registry.load_named(part.variant)(part, rig.coupling)
    if rig.coupling.account is not None:
        part = registry.load_named(ACCOUNT)(part, rig.coupling.account)
    return part
