"""What bridges cost the run that they show: lateness with them and without, in turns in one run.

The run is `tautwave run` on loopback devices, beside it every bridge that is installed: the page
with a client that takes every row, Foxglove's protocol with another, a program that polls rows, ROS
2, a camera. All are stopped (SIGSTOP) and continued in turns, and killed at the end, so that the
recording also shows what stopped and killed bridges cost it.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import tempfile
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tautwave.bench.live.bridges import CLI, beside, cameras_beside, installed
from tautwave.bench.result import Goal, Suite, Table, Value
from tautwave.bench.rigs import END_STOPS, ONE_PAIR
from tautwave.clock import MonotonicClock
from tautwave.config import resolved_yaml
from tautwave.config.guard import parse_json
from tautwave.errors import RecordingError
from tautwave.recordings.recording import read_recording
from tautwave.runtime.tap import LIVE, Live, Tap

SETTLE_S = 0.3
"""After a turn begins: what was waiting is sent in it."""

BEGIN_S = 60.0
SETS = ("loop.overrun_limit=20000", *END_STOPS, "cameras={camera: {driver: synthetic}}")


class Viewed(NamedTuple):
    """A finished run: lateness [us] by turn, its bridges.

    `share` and `resident_mb` are the processor time per time and the memory of the page's server;
    `cycles` those of the run, `alive` its rows that came after the bridges were killed.
    """

    open_us: np.ndarray[Any, np.dtype[np.float64]]
    closed_us: np.ndarray[Any, np.dtype[np.float64]]
    share: float
    resident_mb: float
    columns: int
    recording: dict[str, Any]
    bridges: Sequence[str] = ("page",)
    cycles: int = 0
    alive: int = 0

    @property
    def missing(self) -> int:
        """Cycles of the run without a row in the recording."""
        return self.cycles - int(self.recording.get("rows_written", self.cycles))


def viewed(*, turns: int, turn_s: float) -> Viewed:
    """Run a rig with its bridges open in every second of `turns` turns of `turn_s` [s]."""
    clock = MonotonicClock()
    with tempfile.TemporaryDirectory(prefix="tautwave-bench-") as folder:
        out = Path(folder) / "run"
        rig = Path(folder) / "rig.yaml"
        rig.write_text(resolved_yaml(ONE_PAIR.load()), encoding="utf-8")
        sets = [word for one in SETS for word in ("--set", one)]
        words = ("run", str(rig), *sets, "--duration", "3600", "--out", str(out), "--quiet")
        run = subprocess.Popen([*CLI, *words], stdout=subprocess.DEVNULL)
        try:
            live = _begun(run, out, clock)
            tap = Tap.of_run(live)
            marks, busy = [], []
            bridges = installed()
            with beside(out, bridges) as processes:
                viewers = [number for some in processes.values() for number in some]
                viewers += cameras_beside(run.pid)
                for turn in range(turns):
                    is_open = turn % 2 == 0
                    _signal(viewers, signal.SIGCONT if is_open else signal.SIGSTOP)
                    before = _cpu_s(viewers[0])
                    marks.append(_now_s(tap, live))
                    clock.sleep_until(clock.now_ns() + round(1e9 * turn_s))
                    if is_open:
                        busy.append((_cpu_s(viewers[0]) - before) / turn_s)
                resident = _resident_mb(viewers[0])
                marks.append(_now_s(tap, live))
                tap.take()
                _signal(viewers, signal.SIGKILL)
            clock.sleep_until(clock.now_ns() + 1_000_000_000)
            alive = len(tap.take())
            tap.close()
        finally:
            run.send_signal(signal.SIGINT)
            while run.poll() is None and not (out / "summary.json").exists():
                clock.sleep_until(clock.now_ns() + 50_000_000)
            run.send_signal(signal.SIGINT)  # its report is not needed
            run.wait()
        rows_read = read_recording(out, ["time_s", "lateness_us"])
        summary = parse_json((out / "summary.json").read_text(encoding="utf-8"))
    open_us, closed_us = _by_turn(rows_read["time_s"], rows_read["lateness_us"], marks)
    share = float(np.mean(busy))
    recording = dict(summary["recording"])
    return Viewed(
        open_us, closed_us, share, resident, len(live.columns), recording,
        [*(one.name for one in bridges), *summary["cameras"]], summary["cycles"], alive,
    )  # fmt: skip


def _by_turn(time_s: Any, late_us: Any, marks: Sequence[float]) -> tuple[Any, Any]:
    """Return the lateness of open and of closed turns."""
    parts: tuple[list[Any], list[Any]] = ([], [])
    for turn, (begin, end) in enumerate(pairwise(marks)):
        inside = (time_s >= begin + SETTLE_S) & (time_s < end)
        parts[turn % 2].append(late_us[inside])
    return np.concatenate(parts[0]), np.concatenate(parts[1])


def _begun(run: subprocess.Popen[bytes], out: Path, clock: MonotonicClock) -> Live:
    until = clock.now_ns() + round(1e9 * BEGIN_S)
    while clock.now_ns() < until and run.poll() is None:
        if (out / LIVE).exists():
            return Live(**parse_json((out / LIVE).read_text(encoding="utf-8")))
        clock.sleep_until(clock.now_ns() + 50_000_000)
    raise RecordingError("the run whose page is measured did not begin")


def _signal(processes: Sequence[int], number: int) -> None:
    for process in processes:
        os.kill(process, number)


def _cpu_s(process: int) -> float:
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _resident_mb(process: int) -> float:
    pages = int(Path(f"/proc/{process}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def _now_s(tap: Tap, live: Live) -> float:
    """Return the time of the newest row [s]."""
    rows = tap.take()
    while not rows:
        rows = tap.take()
    return rows[-1][list(live.columns).index("time_s")]


def viewed_suite(found: Viewed) -> Suite:
    """Return what was measured as a table and its goals."""
    figures = ("p50", "p99", "p999", "max")
    shares = (50.0, 99.0, 99.9, 100.0)
    rows: list[Sequence[Value]] = [
        (name, len(late), *(round(float(np.percentile(late, share)), 1) for share in shares))
        for name, late in (("open", found.open_us), ("stopped", found.closed_us))
    ]
    table = Table(
        "Lateness of the loop [us], bridges open and stopped in turns of one run",
        f"{', '.join(found.bridges)}; {found.columns} columns. They are stopped in every second "
        f"turn and killed at the end. {json.dumps(found.recording)}",
        ("bridges", "rows", *figures),
        rows,
    )
    ratio = float(np.percentile(found.open_us, 99) / np.percentile(found.closed_us, 99))
    goals = [
        Goal("lateness with bridges open against stopped, p99", 1.1, "", ratio),
        Goal("processor time of the page's server", 5.0, "%", 100.0 * found.share),
        Goal("rows dropped from the recording", 0.0, "", float(found.recording["rows_dropped"])),
        Goal("cycles that are not in the recording", 0.0, "", float(found.missing)),
        Goal("resident memory of the page's server", 80.0, "MB", found.resident_mb),
    ]
    return Suite("view", [table], goals)
