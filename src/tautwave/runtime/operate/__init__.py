"""A rig that people operate: states, commands, and what the axes do when not coupled."""
