"""Law wave over a network: counters, packets and receivers in place of the line."""
