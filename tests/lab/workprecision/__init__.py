"""Error against run time of every integrator, scene by scene."""
