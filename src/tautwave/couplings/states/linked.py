"""The laws of states over a network."""

from tautwave.couplings.over_link.steps import linked_law
from tautwave.couplings.states import steps

position_force = linked_law(steps.position_force)
pd_damping = linked_law(steps.pd_damping)
four_channel = linked_law(steps.four_channel)
