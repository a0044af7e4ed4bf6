"""`python -m tautwave.report DIR`: complete a run's summary from its recording, draw the report."""

from __future__ import annotations

import sys
from pathlib import Path

from tautwave.errors import TautwaveError


def main() -> int:
    """Complete `summary.json` and write the report of the directory in argv[1]."""
    from tautwave.report.arms.files import write_arms
    from tautwave.report.hooks import report_hooks
    from tautwave.report.precision.oracle import measure_precision
    from tautwave.report.run.after_run import recheck_run
    from tautwave.report.run.complete import complete_summary, write_summary
    from tautwave.report.run.loading import load_run
    from tautwave.report.run.page import write_page
    from tautwave.report.run.warnings import with_warnings

    try:
        run = load_run(Path(sys.argv[1]))
        for step in (complete_summary, recheck_run, with_warnings, measure_precision):
            run.summary = step(run)
        write_summary(run)
        if run.ports:
            report_hooks().write_files(run)
        write_arms(run)
        write_page(run)
    except TautwaveError as err:
        sys.stderr.write(f"{err}\n")
        return err.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main())
