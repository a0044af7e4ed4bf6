"""Error against run time of a rig or a scene: `tautwave bench workprecision [RIG]`."""
