"""Laws of what each side sees of the other, over a network: the newest word of the far side."""

LINKED = "tautwave.couplings.over_link.constants:linked"
"""What makes their constants and table."""

LINKED_LAW = "tautwave.couplings.over_link.law:linked_law"
"""What makes the law over a network from the law."""
