"""`python -m tautwave.certificate < RIG.yaml`: the certificate of a rig as JSON on stdout.

A live run starts this process, so that its own never imports the analysis.
"""

from __future__ import annotations

import json
import sys

from tautwave.errors import TautwaveError


def main() -> int:
    """Read a rig from stdin, or the file in argv[1], and print its certificate."""
    from tautwave.certificate import certify
    from tautwave.config import load_rig, parse_rig

    try:
        rig = load_rig(sys.argv[1]) if len(sys.argv) > 1 else parse_rig(sys.stdin.read())
        found = certify(rig).as_dict()
    except TautwaveError as err:
        sys.stderr.write(f"{err}\n")
        return err.exit_code
    json.dump(found, sys.stdout, allow_nan=False)
    return 0


if __name__ == "__main__":
    sys.exit(main())
