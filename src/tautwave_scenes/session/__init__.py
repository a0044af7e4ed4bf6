"""A rig with a scene from its check to its summary."""
