"""The rig of two served arms may run at its rates, and what processes take is counted."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

from tautwave.config import load_rig
from tests.lab.served_arms import children_of, cpu_s, measured, rig_of


@pytest.mark.parametrize(("rate_hz", "fd"), [(400.0, False), (1000.0, True)])
def test_both_arms_are_on_a_group_of_their_own(rate_hz: float, fd: bool, tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text(yaml.safe_dump(rig_of(rate_hz, fd, 5.0, 3)))
    rig = load_rig(path, choose=False)
    options = [bus.options for bus in rig.buses.values()]
    assert len({one["channel"] for one in options}) == 2
    assert {one["interface"] for one in options} == {"udp_multicast"}
    assert {one.get("data_bitrate") is not None for one in options} == {fd}
    assert (rig.rate_hz, rig.loop.engine, len(rig.axes)) == (rate_hz, "compiled", 14)


def test_cpu_is_that_of_the_processes_that_were_started() -> None:
    work = "import time\nwhile time.process_time() < 0.2: pass\nprint(flush=True); input()"
    words = [sys.executable, "-c", work]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as child:
        assert child.stdout is not None
        assert child.pid in children_of(os.getpid())
        child.stdout.readline()
        assert 0.1 <= cpu_s([child.pid]) < 5.0
        child.communicate(b"\n")


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.realtime
def test_a_short_run_is_counted() -> None:
    began = time.monotonic()
    suite = measured(400.0, fd=False, seconds=4.0, patience=400)
    rows = {row[0]: row[1] for row in suite.tables[0].rows}
    assert 0 < int(rows["slots"] or 0) <= 400 * (time.monotonic() - began)
    assert suite.goals[0].measured is not None
