"""`identify`: of a device on its bus, and from a recording."""
