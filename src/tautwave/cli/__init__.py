"""The command line. Kept light: each command imports its backend when it runs."""

import sys

try:
    from tautwave.cli.group import main
except KeyboardInterrupt:  # while Python still reads the modules
    sys.stderr.write("tautwave: ended by Ctrl-C before anything began\n")
    raise SystemExit(130) from None

__all__ = ["main"]
