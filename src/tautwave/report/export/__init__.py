"""Runs for other programs: tables by episode, MATLAB files, LeRobot datasets."""
