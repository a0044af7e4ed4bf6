"""Law position: a spring and a damper between delayed positions, for comparison."""

from tautwave.contracts import CouplingPlugin
from tautwave.couplings.over_link import LINKED

plugin = CouplingPlugin(
    summary="spring and damper between delayed positions, passive by tuning where it is soft",
    keys="tautwave.couplings.position.keys:PositionCoupling",
    law="tautwave.couplings.position.steps:law",
    over_link="tautwave.couplings.position.linked:law",
    linked=LINKED,
    end_constants="tautwave.couplings.position.from_keys:end_constants",
    linear="tautwave.couplings.position.linear:linear_end",
    verdict="tautwave.couplings.position.verdict:verdict",
    messages="tautwave.couplings.position.messages:messages",
)
