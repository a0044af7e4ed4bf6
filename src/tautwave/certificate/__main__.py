"""`python -m tautwave.certificate [BUS...] < RIG.yaml`: the certificate of a rig as JSON.

A live run starts this process, so that its own never imports the analysis. The buses are those that
are hardware; what the law chose for keys that are left to it comes along.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from typing import Any

from tautwave.errors import TautwaveError


def certify_text(text: str, hardware: Sequence[str] = ()) -> dict[str, Any]:
    """Return certificate and choices of a rig as plain data.

    Raises
    ------
    ConfigError
        The rig is not valid, or its law cannot choose.
    """
    from tautwave.certificate import certify
    from tautwave.config import parse_rig
    from tautwave.config.load import choose_keys
    from tautwave.rig import without_truth

    rig = choose_keys(parse_rig(text, choose=False))  # lines of this text are nobody's
    return {**certify(without_truth(rig, hardware)).as_dict(), "choices": dict(rig.choices)}


def main() -> int:
    """Read a rig from stdin, and print its certificate."""
    try:
        certificate = certify_text(sys.stdin.read(), sys.argv[1:])
    except TautwaveError as err:
        sys.stderr.write(f"{err}\n")
        return err.exit_code
    json.dump(certificate, sys.stdout, allow_nan=False)
    return 0


if __name__ == "__main__":
    sys.exit(main())
