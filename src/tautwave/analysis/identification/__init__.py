"""Parameters of devices, hands and environments from recorded motion."""
