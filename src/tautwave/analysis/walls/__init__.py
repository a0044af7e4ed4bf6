"""Sampled virtual walls: passivity, stability, published rules and limit cycles."""
