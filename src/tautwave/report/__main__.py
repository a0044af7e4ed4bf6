"""`python -m tautwave.report DIR`: add to a run's summary what its recording tells, and draw it."""

from __future__ import annotations

import sys
from pathlib import Path

from tautwave.errors import TautwaveError


def main() -> int:
    """Complete `summary.json` and write the report of the directory in argv[1]."""
    from tautwave.report import write_report
    from tautwave.report.precision.oracle import measure_precision
    from tautwave.report.run.after_run import recheck_run
    from tautwave.report.run.complete import complete_summary
    from tautwave.report.scene.files import write_scene

    directory = Path(sys.argv[1])
    try:
        complete_summary(directory)
        recheck_run(directory)
        measure_precision(directory)
        write_scene(directory)
        write_report(directory)
    except TautwaveError as err:
        sys.stderr.write(f"{err}\n")
        return err.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main())
