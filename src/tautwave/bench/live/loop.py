"""Measurements of the live loop, each in a process of its own, as a run would be.

`python -m tautwave.bench.live.loop NAME RIG-FILE SECONDS` prints one JSON object. The loop is the
session's: same assembly, recorder, collector and real-time requests.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from array import array
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from tautwave.bench.chunks import TOLERANCE, calibrate
from tautwave.config import Rig, load_rig
from tautwave.contracts import Clock
from tautwave.rig import Assembly, build_rig
from tautwave.runtime.loop import Loop
from tautwave.runtime.machine import quiet_collector, realtime
from tautwave.runtime.recorder import Recorder
from tautwave.session.engine import compiled_devices, with_engine

CHUNK = 250  # cycles between two calibrations


class Meter:
    """A clock around the loop's own that takes the CPU time of every cycle.

    The thread's CPU time is read at both ends of each sleep, so a cycle is all the loop does
    between two sleeps, hand-over of the row included; reading it costs some 0.3 us.
    """

    def __init__(self, clock: Clock, cycles: int) -> None:
        self._clock = clock
        self.now_ns = clock.now_ns
        self.wait = clock.wait
        self.spent = array("q", bytes(8 * (cycles + 1)))
        self.speed: list[int] = [calibrate()]
        self.count = 0
        self._began = time.thread_time_ns()

    def sleep_until(self, deadline_ns: int) -> None:
        """Close the account of a cycle, sleep, and open the next."""
        self.spent[self.count] = time.thread_time_ns() - self._began
        self.count += 1
        if self.count % CHUNK == 0:
            self.speed.append(calibrate())
        self._clock.sleep_until(deadline_ns)
        self._began = time.thread_time_ns()

    def chunks(self) -> Iterator[list[int]]:
        """Yield the cycles [ns] of the chunks during which the core was as fast as ever."""
        best = min(self.speed)
        for at in range(len(self.speed) - 1):
            if max(self.speed[at], self.speed[at + 1]) <= TOLERANCE * best:
                yield list(self.spent[at * CHUNK : (at + 1) * CHUNK])


class Probe:
    """A clock around the loop's own that reads the resident size every simulated minute."""

    def __init__(self, clock: Clock, every_ns: int) -> None:
        self._clock = clock
        self.now_ns = clock.now_ns
        self.wait = clock.wait
        self._every_ns = every_ns
        self._next_ns = clock.now_ns() + every_ns
        self.resident: list[int] = []

    def sleep_until(self, deadline_ns: int) -> None:
        """Sleep; look at the size when a minute has passed."""
        self._clock.sleep_until(deadline_ns)
        if deadline_ns >= self._next_ns:
            self._next_ns += self._every_ns
            self.resident.append(resident_bytes())


def resident_bytes() -> int:
    """Return the resident size of this process [bytes], shared pages of the ring included."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * 4096


@contextmanager
def recorded(rig: Rig, assembly: Assembly, *, lossless: bool) -> Iterator[Recorder]:
    """Give a recorder that writes into a folder of its own, gone afterwards."""
    with tempfile.TemporaryDirectory(prefix="tautwave-bench-") as folder:
        recorder = Recorder(
            Path(folder) / "recording.mcap",
            assembly.columns,
            metadata={"rig": rig.name},
            attachments={},
            rows=rig.loop.ring_rows,
            lossless=lossless,
            rate_hz=rig.rate_hz,
        )
        recorder.start()
        try:
            yield recorder
        finally:
            recorder.close()


def _loop(assembly: Assembly, clock: Clock, recorder: Recorder) -> Loop:
    return Loop(clock, assembly.buses, assembly.control, assembly.sources, recorder)


def cycle_cost(path: Path, seconds: float) -> dict[str, Any]:
    """Take the CPU time of every cycle of a FakeClock run with the recorder running [us]."""
    rig = load_rig(path)
    assembly = build_rig(rig, clock="fake", duration_s=seconds)
    with recorded(rig, assembly, lossless=True) as recorder, quiet_collector():
        meter = Meter(assembly.clock, assembly.control.run.cycles)
        result = _loop(assembly, meter, recorder).run()
    everything = sorted(meter.spent[1 : meter.count])
    quiet = list(meter.chunks())
    pooled = sorted(spent for chunk in quiet for spent in chunk) or everything
    return {
        "cycles": result.cycles,
        **{f"p{share}_us": pooled[len(pooled) * share // 100] / 1e3 for share in (10, 50, 90, 99)},
        "mean_us": sum(pooled) / len(pooled) / 1e3,
        "p50_of_all_us": everything[len(everything) // 2] / 1e3,
        "quiet_chunks": len(quiet),
        "chunks": max(1, len(meter.speed) - 1),
    }


def fake_run(path: Path, seconds: float, engine: str = "python") -> dict[str, Any]:
    """Run on the FakeClock with recording; CPU time of this process and wall time [s]."""
    rig = load_rig(path, [f"loop.engine={engine}"])
    assembly = build_rig(rig, clock="fake", duration_s=seconds, devices=compiled_devices(rig))
    assembly = with_engine(rig, assembly)
    with recorded(rig, assembly, lossless=True) as recorder, quiet_collector():
        loop = _loop(assembly, assembly.clock, recorder)
        cpu, wall = time.process_time(), time.perf_counter()
        result = loop.run()
        cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
        stats = recorder.close()
    simulated = result.cycles * rig.period_s
    return {
        "simulated_s": simulated,
        "cpu_s": cpu,
        "wall_s": wall,
        "times_real_cpu": simulated / cpu,
        "times_real_wall": simulated / wall,
        "rows_written": stats.rows_written,
        "rows_dropped": stats.rows_dropped,
    }


def realtime_run(path: Path, seconds: float) -> dict[str, Any]:
    """Run on the machine's clock with recording; lateness and compute time [us]."""
    rig = load_rig(path)
    assembly = build_rig(rig, clock="real", duration_s=seconds)
    keys = rig.loop
    with recorded(rig, assembly, lossless=False) as recorder:
        loop = _loop(assembly, assembly.clock, recorder)
        with (
            realtime(keys.fifo_priority, keys.cpu, keys.lock_memory) as granted,
            quiet_collector(),
        ):
            cpu = time.process_time()
            result = loop.run()
            cpu = time.process_time() - cpu
            resident = resident_bytes()
        stats = recorder.close()
    return {
        "seconds": seconds,
        "rate_hz": rig.rate_hz,
        "cycles": result.cycles,
        "missed_cycles": result.missed_cycles,
        "lateness_us": loop.lateness.summary(),
        "compute_us": loop.compute.summary(),
        "cpu_share": cpu / seconds,
        "resident_mb": resident / 1e6,
        "rows_dropped": stats.rows_dropped,
        "realtime": list(granted),
        "error": None if result.error is None else str(result.error),
    }


def memory(path: Path, seconds: float) -> dict[str, Any]:
    """Run on the FakeClock with recording; resident size every simulated minute [MB]."""
    rig = load_rig(path)
    assembly = build_rig(rig, clock="fake", duration_s=seconds)
    every_s = min(60.0, seconds / 4.0)
    with recorded(rig, assembly, lossless=True) as recorder, quiet_collector():
        probe = Probe(assembly.clock, round(every_s * 1e9))
        result = _loop(assembly, probe, recorder).run()
    sizes = [size / 1e6 for size in probe.resident] or [resident_bytes() / 1e6]
    span_h = (len(sizes) - 1) * every_s / 3600.0
    return {
        "simulated_s": result.cycles * rig.period_s,
        "every_s": every_s,
        "resident_mb": sizes,
        "first_mb": sizes[0],
        "last_mb": sizes[-1],
        "greatest_mb": max(sizes),
        "growth_mb": sizes[-1] - sizes[0],
        "slope_mb_per_h": (sizes[-1] - sizes[0]) / span_h if span_h > 0.0 else 0.0,
    }


MEASUREMENTS: dict[str, Callable[[Path, float], dict[str, Any]]] = {
    "cycle_cost": cycle_cost,
    "fake_run": fake_run,
    "fake_run_compiled": partial(fake_run, engine="compiled"),
    "realtime_run": realtime_run,
    "memory": memory,
}

if __name__ == "__main__":
    sys.stdout.write(json.dumps(MEASUREMENTS[sys.argv[1]](Path(sys.argv[2]), float(sys.argv[3]))))
