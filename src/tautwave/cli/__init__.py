"""The command line. Kept light: each command imports its backend when it runs."""

from tautwave.cli.group import main

__all__ = ["main"]
