"""Laws of positions, velocities and efforts: position-force, PD with damping, four channels.

One set of steps serves all three (`law`); they differ in their keys and in which gains those
make. Without an account (`coupling.account`) pd_damping may be passive by its tuning, the others
are not certified.
"""

from __future__ import annotations

from tautwave.contracts import CouplingPlugin

_ROOM = "tautwave.couplings.states"


def _plugin(name: str, keys: str, summary: str) -> CouplingPlugin:
    return CouplingPlugin(
        summary=summary,
        keys=f"{_ROOM}.keys:{keys}",
        law=f"{_ROOM}.law:{name}",
        over_link="tautwave.couplings.over_link:linked_law",
        linked="tautwave.couplings.over_link:linked",
        end_constants=f"{_ROOM}.law:end_constants",
        verdict=f"{_ROOM}.certificate:verdict",
        messages=f"{_ROOM}.certificate:{name}",
        resolve=f"{_ROOM}.keys:resolve",
    )


position_force = _plugin(
    "position_force",
    "PositionForceCoupling",
    "the slave follows positions, the master is fed the slave's effort",
)
pd_damping = _plugin(
    "pd_damping",
    "PdDampingCoupling",
    "spring and damper between delayed positions, dampers to ground (Nuno)",
)
four_channel = _plugin(
    "four_channel",
    "FourChannelCoupling",
    "positions and external efforts both ways, efforts observed (Lawrence)",
)
