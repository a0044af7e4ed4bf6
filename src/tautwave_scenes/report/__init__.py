"""A recorded scene: its picture, animation and sound."""
