"""Law position over a network."""

from tautwave.couplings.over_link.steps import linked_law
from tautwave.couplings.position import steps

law = linked_law(steps.law)
