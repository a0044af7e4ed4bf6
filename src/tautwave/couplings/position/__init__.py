"""Law position: a spring and a damper between delayed positions, for comparison."""

from tautwave.contracts import CouplingPlugin
from tautwave.couplings.over_link import LINKED, LINKED_LAW

plugin = CouplingPlugin(
    summary="spring and damper between delayed positions, passive by tuning where it is soft",
    keys="tautwave.couplings.position.keys:PositionCoupling",
    law="tautwave.couplings.position.law:law",
    over_link=LINKED_LAW,
    linked=LINKED,
    end_constants="tautwave.couplings.position.law:end_constants",
    linear="tautwave.couplings.position.certificate:linear_end",
    verdict="tautwave.couplings.position.certificate:verdict",
    messages="tautwave.couplings.position.certificate:messages",
)
