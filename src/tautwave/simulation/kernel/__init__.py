"""A whole run as functions over records: compiled, or in plain Python."""
