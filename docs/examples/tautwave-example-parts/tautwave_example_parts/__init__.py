"""Example parts for tautwave: each module is one, named by an entry point of pyproject.toml."""
