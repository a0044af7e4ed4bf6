"""Serial chains as pure functions over floats: kinematics, gravity, inertia; SI units."""
