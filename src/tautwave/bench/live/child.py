"""Processes of their own: measurements that a run would make alone, and the cost of starting."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

from tautwave.bench.chunks import Cost, calibrate, summary
from tautwave.errors import TautwaveError

MAIN = "from tautwave.cli import main; main(prog_name='tautwave')"


def measure(name: str, path: Path, seconds: float) -> dict[str, Any]:
    """Return what `tautwave.bench.live.loop` measures as `name`, in a process of its own."""
    return _answer("tautwave.bench.live.loop", name, str(path), repr(seconds))


def rates(seconds: float, rounds: int) -> dict[str, Any]:
    """Return what `tautwave.bench.live.rate` measures, in a process of its own."""
    return _answer("tautwave.bench.live.rate", repr(seconds), str(rounds))


def _answer(*words: str) -> dict[str, Any]:
    done = subprocess.run(
        [sys.executable, "-m", *words],
        capture_output=True,
        text=True,
        check=False,
        env=_environment(),
    )
    if done.returncode != 0:
        last = (done.stderr.strip() or f"exit code {done.returncode}").splitlines()[-1]
        raise TautwaveError(f"bench: its measuring process {words[0]} failed: {last}")
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def start_costs(commands: Mapping[str, Sequence[str]], rounds: int) -> dict[str, Cost]:
    """Return the CPU time [ns] of whole processes, `sys.executable` with the given arguments."""
    taken: dict[str, list[tuple[int, float]]] = {name: [] for name in commands}
    for _ in range(rounds):
        for name, arguments in commands.items():
            before = median(calibrate() for _ in range(5))
            spent = _process_cpu_ns(arguments)
            after = median(calibrate() for _ in range(5))
            taken[name].append((int(max(before, after)), spent))
    best = min(speed for chunks in taken.values() for speed, _ in chunks)
    return {name: summary(chunks, best) for name, chunks in taken.items()}


def _process_cpu_ns(arguments: Sequence[str]) -> float:
    child = subprocess.Popen(
        [sys.executable, *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=_environment(),
    )
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    return (usage.ru_utime + usage.ru_stime) * 1e9


def _environment() -> dict[str, str]:
    # The child finds the modules where this process found them.
    return {**os.environ, "PYTHONPATH": os.pathsep.join(entry for entry in sys.path if entry)}
