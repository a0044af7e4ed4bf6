"""Files that a rig names: recordings, sounds, parts of one's own."""
