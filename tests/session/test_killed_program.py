"""A program that runs a rig, as LeRobot's plugin does, is killed: the run ends by itself, whole."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

RIG = Path(__file__).parents[2] / "configs" / "bench-1dof-loopback.yaml"
PROGRAM = """
import sys, time
from tautwave import Session, load_rig

pytestmark = pytest.mark.realtime
rig = load_rig(sys.argv[1], ["operate={}", "loop.overrun_limit=20000", "duration_s=600"])
with Session(rig, out=sys.argv[2]) as session:
    session.engage()
    assert session.wait_for("engaged", 60.0)
    print("engaged", flush=True)
    while True:
        session.row()
        time.sleep(1 / 60)
"""
PATIENCE_S = 90.0


@pytest.mark.slow
def test_the_run_of_a_killed_program_ramps_down_and_its_recording_is_complete(
    tmp_path: Path,
) -> None:
    out = tmp_path / "run"
    program = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(RIG), str(out)], stdout=subprocess.PIPE
    )
    assert program.stdout is not None
    assert program.stdout.readline() == b"engaged\n"
    program.kill()
    program.communicate()
    until = time.monotonic() + PATIENCE_S
    while not (out / "summary.json").exists() and time.monotonic() < until:
        time.sleep(0.1)
    summary = json.loads((out / "summary.json").read_text())
    assert summary["recording"]["rows_written"] == summary["cycles"]
    assert summary["recording"]["rows_dropped"] == 0
    said = summary["operation"]["journal"][-1]
    assert (said["word"], said["state"]) == ("stop", "stopping")
    assert said["source"] == "end of input"
    assert summary["duration_s"] < 60.0
