"""Laws of positions that are passive by their tuning: the sampled two-port, and the verdict."""
