"""`tautwave ros`: messages, the node, the dead-man, and foreign readers."""
