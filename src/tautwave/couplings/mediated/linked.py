"""Law mediated over a network."""

from tautwave.couplings.mediated import steps
from tautwave.couplings.over_link.steps import linked_law

law = linked_law(steps.law)
