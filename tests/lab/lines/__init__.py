"""What a network does to a pair: energy, position and force, over random patterns."""
