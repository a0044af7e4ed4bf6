"""Two runs of a rig as its two sites, each `tautwave run --site` in a process of its own."""

from __future__ import annotations

import math
import subprocess
import sys
import tempfile
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import numpy as np

from tautwave.bench.live.child import MAIN
from tautwave.bench.rigs import END_STOPS
from tautwave.bench.sites.order import free_port
from tautwave.config.shipped import copy_example
from tautwave.errors import LinkError
from tautwave.report.run.loading import load_run
from tautwave.sites.certificates import make_authority

SIDES = ("slave", "master")
EXAMPLE = "network-loopback"
SETS = ("loop.overrun_limit=2000", *END_STOPS, "link.depth_s=auto")
LOOK_S = 2.0
"""Time between two looks at the memory of both [s]."""
SETTLED_S = 20.0
"""Time in which a run takes the memory that it needs, at most half of it [s]."""


def run_sites(duration_s: float, rate_hz: float) -> list[dict[str, Any]]:
    """Run both sites of the example on this machine; return what each measured.

    `late`: loop lateness [us]; `delay`: of one way of the waves' packets [us], by clocks known to
    half a round trip; `memory`: resident sizes [bytes], every `LOOK_S`; `sessions`,
    `silences`, `lost` rows.

    Raises
    ------
    LinkError
        A run did not end as it should.
    """
    with tempfile.TemporaryDirectory(prefix="tautwave-bench-") as name, ExitStack() as stack:
        folder = Path(name)
        make_authority(folder / "keys", list(SIDES))
        rig = copy_example(EXAMPLE, folder)[0].path
        lasting = f"sites.port={free_port()}", f"duration_s={duration_s}", f"rate_hz={rate_hz}"
        changes = (*lasting, *SETS)
        words = [word for one in changes for word in ("--set", one)]
        runs = []
        for side in SIDES:
            command = ["run", str(rig), "--site", side, "--out", str(folder / side), *words]
            log = stack.enter_context((folder / f"{side}.log").open("w", encoding="utf-8"))
            runs.append(
                subprocess.Popen(
                    [sys.executable, "-c", MAIN, *command], stdout=log, stderr=subprocess.STDOUT
                )
            )
            stack.callback(_end, runs[-1])
        memory: list[list[int]] = [[] for _ in SIDES]
        while left := [run for run in runs if run.poll() is None]:
            for sizes, side, run in zip(memory, SIDES, runs, strict=True):
                log_text = (folder / f"{side}.log").read_text(encoding="utf-8")
                if "running" in log_text and "reporting" not in log_text:
                    with suppress(OSError, IndexError):
                        sizes.append(_resident(run.pid))
            with suppress(subprocess.TimeoutExpired):
                left[0].wait(LOOK_S)
        for side, run in zip(SIDES, runs, strict=True):
            if run.returncode:
                text = (folder / f"{side}.log").read_text(encoding="utf-8").strip()
                raise LinkError(f"the {side}'s run ended with {run.returncode}: {text[-300:]}")
        return [_found(folder / side, sizes) for side, sizes in zip(SIDES, memory, strict=True)]


def _end(run: subprocess.Popen[bytes]) -> None:
    run.kill()
    run.wait()


def _resident(pid: int) -> int:
    return int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1]) * 4096


def _found(out: Path, memory: list[int]) -> dict[str, Any]:
    run = load_run(out)
    delay = 1e6 * run.read("link.delay_s")["link.delay_s"]
    quantiles = np.quantile(delay[delay > 0.0], (0.5, 0.99, 0.999, 1.0))
    sessions = run.result.link.sessions if run.result.link is not None else ()
    return {
        "late": run.result.lateness_us.model_dump(exclude_unset=True),
        "delay": dict(zip(("p50", "p99", "p999", "max"), map(float, quantiles), strict=True)),
        "memory": memory,
        "sessions": len(sessions),
        "silences": sum(len(one.silences) for one in sessions),
        "dropped": run.result.recording.rows_dropped,
    }


def grown(memory: list[int]) -> float:
    """Return by how much a run's resident size grew once it had settled [MB], NaN if unknown."""
    settled = min(round(SETTLED_S / LOOK_S), len(memory) // 2)
    return (memory[-1] - memory[settled]) / 1e6 if len(memory) > 1 else math.nan
