"""What a rig that people operate comes to."""
