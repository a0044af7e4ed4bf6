"""The command line and whole runs without a process for each: what the tests of content use.

That the installed command, its children and their exit codes work is `tests/cli/test_end_to_end`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from contextlib import chdir, suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from click.testing import CliRunner, Result

from tautwave.certificate.__main__ import certify_text
from tautwave.cli import main
from tautwave.config import Rig, resolved_yaml
from tautwave.report import write_report
from tautwave.report.run.after_run import recheck_run
from tautwave.report.run.complete import complete_summary, write_summary
from tautwave.report.run.loading import load_run
from tautwave.report.run.warnings import with_warnings
from tautwave.rig import BusWay, real_buses
from tautwave.session import admitting, reporting


def tautwave(*words: object, cwd: Path) -> Result:
    """Run the command line in this process, in the directory `cwd`."""
    with chdir(cwd):
        return CliRunner().invoke(main, [str(word) for word in words], prog_name="tautwave")


def keep_in_one_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have runs compute certificate and summary here, and draw no figures."""

    def certificate_of(rig: Rig, ways: Mapping[str, BusWay]) -> dict[str, Any]:
        found: dict[str, Any] = json.loads(
            json.dumps(certify_text(resolved_yaml(rig), real_buses(ways)))
        )
        return found

    def complete(command: Sequence[str], **_: object) -> SimpleNamespace:
        assert command[1:3] == ["-m", "tautwave.report"]
        directory = Path(command[3])
        run = load_run(directory)
        run.result = complete_summary(run)
        run.result = recheck_run(run)
        run.result = with_warnings(run)
        write_summary(run)
        return SimpleNamespace(returncode=0, stderr="")

    monkeypatch.setattr(admitting, "certificate_of", certificate_of)
    monkeypatch.setattr(reporting, "subprocess", SimpleNamespace(run=complete))


def child_of(pid: int, word: str) -> int | None:
    """Return the child of a process with a word in its command line; others may end meanwhile."""
    for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
        with suppress(FileNotFoundError, ProcessLookupError):
            if word.encode() in Path(f"/proc/{child}/cmdline").read_bytes():
                return int(child)
    return None


def end_stops(*axes: str) -> tuple[str, ...]:
    """What an effort that is held through any stall may do: a rig that waits for long needs it."""
    sides = ("master", "slave")
    return tuple(f"{side}.axes.{it}.mechanical_range=[-2.5, 2.5]" for side in sides for it in axes)


def patient(*axes: str, slots: int = 10000) -> tuple[str, ...]:
    """For runs on the real clock: what a busy machine does beside them is not what is tested."""
    keys = (f"loop.missing_limit={slots}", f"loop.overrun_limit={slots}", *end_stops(*axes))
    return tuple(word for key in keys for word in ("--set", key))


END_STOPS = end_stops("lever")
PATIENT = patient("lever")

AT_200_HZ = ("--set", "rate_hz=200", "--set", "coupling.pairs.lever.wave_filter_hz=12")
"""Changes of `bench-canopen-vcan`: a guest kernel may take the 2 ms of a period for one cycle."""


def assert_ran_to_its_end(code: int, directory: Path, said: str) -> dict[str, Any]:
    """Return the summary of a run on the real clock that came to its end.

    However slow the machine is, it ends with 0, or with 3 where lost samples and held efforts broke
    a certificate that was there before.
    """
    assert code in (0, 3), said
    summary: dict[str, Any] = json.loads((directory / "summary.json").read_text(encoding="utf-8"))
    assert summary["outcome"]["kind"] == "finished", said
    assert summary["certificate"]["passed"], said
    assert (code == 3) == summary["certificate"]["after_run"]["invalidated"], said
    return summary


def page_of(directory: Path) -> str:
    """Return the page of a run, its recording and so its figures left out."""
    (directory / "recording.mcap").unlink(missing_ok=True)
    return write_report(directory).read_text(encoding="utf-8")
