"""`tautwave new`: from the devices on the bench to a rig file."""
