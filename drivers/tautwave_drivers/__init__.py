"""Drivers of fieldbus devices. Each imports its vendor library inside its own package only."""
