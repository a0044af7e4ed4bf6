"""The wave port before and after, and a laboratory's controller: `python -m tests.lab port`."""
