"""The controller of a live run and its loopback devices, compiled: `loop.engine: compiled`."""
