"""The wave port before and after, and a laboratory's controller: `tautwave bench port`."""
