"""A program that runs a rig, as LeRobot's plugin does, is killed: the run ends by itself, whole."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.realtime

RIG = Path(__file__).parents[2] / "configs" / "bench-1dof-loopback.yaml"
PROGRAM = """
import sys, time
from tautwave import Session, load_rig

ends = [f"{side}.axes.lever.mechanical_range=[-1, 1]" for side in ("master", "slave")]
rig = load_rig(
    sys.argv[1], ["operate={}", "loop.overrun_limit=20000", "duration_s=600", *ends]
)
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
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(RIG), str(out)], stdout=subprocess.PIPE
    ) as program:
        assert program.stdout is not None
        said = program.stdout.readline()
        program.kill()
    assert said == b"engaged\n"
    until = time.monotonic() + PATIENCE_S
    while not (out / "summary.json").exists() and time.monotonic() < until:
        time.sleep(0.1)
    summary = json.loads((out / "summary.json").read_text())
    assert summary["recording"]["rows_written"] == summary["cycles"]
    assert summary["recording"]["rows_dropped"] == 0
    last = summary["operation"]["journal"][-1]
    assert (last["word"], last["state"]) == ("stop", "stopping")
    assert last["source"] == "end of input"
    assert summary["duration_s"] < 60.0
