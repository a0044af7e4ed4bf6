"""Two arms of seven MIT motors over UDP multicast: does a real loop hold its rate against them?

`tautwave sim` serves both arms on one core, `tautwave run --attach` has the other, compiled, with
the real-time priority it asks for. The arms are those of `arms/openarm` without their weight, which
400 Hz cannot carry. CPU is that of whole processes between two looks, a cycle; it does not depend
on what else the machine does, as missed slots do.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
import numpy as np
import yaml

from tautwave.bench.result import Goal, Suite, Table, Value
from tautwave.cli.options import json_option
from tautwave.cli.terminal.measured import print_suites
from tautwave.config.shipped import find_example
from tautwave.recordings.recording import read_recording

MAIN = [sys.executable, "-c", "from tautwave.cli import main; main(prog_name='tautwave')"]
CHANNELS = {"leader": "239.74.163.230", "follower": "239.74.163.231"}
MAX_MISSED = 0.01
START_S, SETTLE_S = 120.0, 1.0


def rig_of(rate_hz: float, fd: bool, seconds: float, patience: int) -> dict[str, Any]:
    """Return the rig: both arms on UDP multicast, classic or FD, without their weight."""
    example = find_example("arms/openarm").path
    rig: dict[str, Any] = yaml.safe_load(example.read_text(encoding="utf-8"))
    rig |= {"name": "served-arms", "rate_hz": rate_hz, "duration_s": seconds}
    limits = {"missing_limit": patience, "overrun_limit": patience}
    rig["loop"] |= {"engine": "compiled", "cpu": 0, **limits}
    for bus, channel in CHANNELS.items():
        options = rig["buses"][bus]["options"]
        options |= {"interface": "udp_multicast", "channel": channel}
        if not fd:
            del options["data_bitrate"]
    for side in ("master", "slave"):
        del rig[side]["arm"]
    return rig


@contextmanager
def served(path: Path) -> Iterator[list[int]]:
    """Serve the rig's devices on the last core; give the processes that simulate."""
    core = max(os.sched_getaffinity(0))
    words = ["taskset", "-c", str(core), *MAIN, "sim", str(path)]
    child = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    assert child.stdout is not None
    try:
        for _ in CHANNELS:
            json.loads(child.stdout.readline())
        yield children_of(child.pid)
    finally:
        child.send_signal(signal.SIGINT)
        child.wait(60)
        child.stdout.close()


def children_of(parent: int) -> list[int]:
    """Return the processes that a process has started."""
    return [
        int(word) for word in Path(f"/proc/{parent}/task/{parent}/children").read_text().split()
    ]


def cpu_s(processes: list[int]) -> float:
    """Return the CPU that processes have taken so far [s]."""
    ticks = 0
    for one in processes:
        fields = Path(f"/proc/{one}/stat").read_text().rpartition(")")[2].split()
        ticks += int(fields[11]) + int(fields[12])
    return ticks / os.sysconf("SC_CLK_TCK")


def run(path: Path, out: Path, simulators: list[int], seconds: float) -> tuple[float, float] | None:
    """Run the rig; return the CPU of loop and simulators in a second of motion, if it lasted."""
    words = [*MAIN, "run", str(path), "--attach", "--allow-uncertified", "--out", str(out)]
    child = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    until = time.monotonic() + START_S
    while not (out / "recording.mcap").exists():
        if child.poll() is not None or time.monotonic() > until:
            raise click.ClickException(f"the run did not begin: {' '.join(words)}")
        time.sleep(0.05)
    time.sleep(SETTLE_S)
    looks = []
    for pause in (max(0.5, seconds - 2.0 * SETTLE_S), 0.0):
        if child.poll() is not None:
            return None  # it ended early
        looks.append((time.monotonic(), cpu_s([child.pid]), cpu_s(simulators)))
        time.sleep(pause)
    child.wait()
    (began, loop, simulated), (ended, loop_then, simulated_then) = looks
    return (loop_then - loop) / (ended - began), (simulated_then - simulated) / (ended - began)


def measured(rate_hz: float, fd: bool, seconds: float, patience: int) -> Suite:
    """Run the rig once, and count."""
    with tempfile.TemporaryDirectory() as folder:
        path, out = Path(folder) / "served-arms.yaml", Path(folder) / "out"
        path.write_text(yaml.safe_dump(rig_of(rate_hz, fd, seconds, patience), sort_keys=False))
        with served(path) as simulators:
            cpu = run(path, out, simulators, seconds)
        summary = json.loads((out / "summary.json").read_text())
        recording = read_recording(out)
        valid = [np.asarray(recording[one]) for one in recording.columns if one.endswith(".valid")]
    silent = np.column_stack(valid) == 0
    slots = summary["cycles"] + summary["missed_cycles"]
    share = summary["missed_cycles"] / slots
    rows: list[tuple[Value, ...]] = [
        ("ended", summary["outcome"]["kind"], ""),
        ("slots", slots, ""),
        ("missed slots", 100.0 * share, "%"),
        ("samples not there in time", 100.0 * float(silent.mean()), "%"),
        ("cycles without one of the 14", 100.0 * float(silent.any(axis=1).mean()), "%"),
        ("late, 99 %", summary["lateness_us"]["p99"], "us"),
        ("CPU of the loop's process, a cycle", cpu and 1e3 * cpu[0] / rate_hz, "ms"),
        ("CPU of both simulators, a cycle", cpu and 1e3 * cpu[1] / rate_hz, "ms"),
        ("a cycle", 1e3 / rate_hz, "ms"),
    ]
    what = f"{'CAN FD' if fd else 'classic CAN'}, {rate_hz:g} Hz, {seconds:g} s asked, real clock"
    table = Table("Two arms of seven motors on UDP multicast", what, ("what", "measured", ""), rows)
    return Suite("served_arms", [table], [Goal("missed slots", MAX_MISSED, "", share)])


@click.command("served_arms", short_help="Two arms over UDP multicast, on a core each side.")
@click.option("--rate", default=400.0, show_default=True, help="[Hz] of the loop.")
@click.option("--fd", is_flag=True, help="CAN FD at 1 and 5 Mbit/s, not classic at 1.")
@click.option("--seconds", default=60.0, show_default=True, help="How long.")
@click.option(
    "--patience",
    default=3,
    show_default=True,
    help="Slots that may be missed in a row; more keeps a run going on a busy machine.",
)
@json_option
def served_arms(rate: float, fd: bool, seconds: float, patience: int, as_json: bool) -> None:
    """Run two arms of seven motors in real time against simulated ones that others could be."""
    print_suites([measured(rate, fd, seconds, patience)], as_json)
