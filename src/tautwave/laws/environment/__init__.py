"""What a device touches: estimated from its motion, and rendered elsewhere as a local model."""
