"""What carries waves from one site to the other."""
