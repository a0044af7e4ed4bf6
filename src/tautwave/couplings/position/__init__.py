"""Law position: a spring and a damper between delayed positions, for comparison."""

from tautwave.contracts import CouplingPlugin

plugin = CouplingPlugin(
    summary="spring and damper between delayed positions, passive by tuning where it is soft",
    keys="tautwave.couplings.position.keys:PositionCoupling",
    law="tautwave.couplings.position.law:law",
    over_link="tautwave.couplings.over_link:linked_law",
    linked="tautwave.couplings.over_link:linked",
    end_constants="tautwave.couplings.position.law:end_constants",
    linear="tautwave.couplings.position.certificate:linear_end",
    verdict="tautwave.couplings.position.certificate:verdict",
    messages="tautwave.couplings.position.certificate:messages",
)
