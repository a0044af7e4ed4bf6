"""The LeRobot plugin, against a stand-in for LeRobot's base classes."""
