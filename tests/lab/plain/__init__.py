"""Hand-written yardsticks: the textbook scene in plain C, alone and in vector lanes."""
