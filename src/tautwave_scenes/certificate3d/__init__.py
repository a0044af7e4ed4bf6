"""The certificate of a rig with a scene of points in three dimensions."""
