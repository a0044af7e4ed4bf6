"""Recordings that are read back: our own (MCAP), and columns of anybody's files."""

RUN = "recording.mcap"
"""Name of the recording in the directory of a run."""

DIRECTORIES = (RUN, "meta/info.json", "metadata.yaml")
"""What a directory has that is read as a recording: a run's, a LeRobot dataset, a ROS 2 bag."""
