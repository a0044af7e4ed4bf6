"""How fast the live loop can go: 1, 2 and 6 pairs at 1 to 10 kHz, in Python and compiled.

`python -m tautwave.bench.live.rate SECONDS ROUNDS` prints one JSON object. On the machine's clock,
with recorder, collector off and what real-time conditions are granted. The engines, a loop that
only sleeps, and one that counts for as long as the last engine's median cycle take turns in one
process, so that other load on the machine affects all of them: what the counting loop shows in the
tail is the machine's.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from typing import Any, NamedTuple

from tautwave.bench.live.loop import recorded
from tautwave.bench.result import Goal, Suite, Table
from tautwave.bench.rigs import ONE_PAIR
from tautwave.clock import MonotonicClock
from tautwave.config import Rig, parse_rig
from tautwave.errors import SafetyStop
from tautwave.rig import build_rig
from tautwave.runtime.loop import Loop
from tautwave.runtime.machine import quiet_collector, realtime
from tautwave.runtime.timing import Histogram
from tautwave.session.engine import compiled_devices, with_engine

PAIRS = (1, 2, 6)
RATES_HZ = (1000, 2000, 4000, 10000)
ENGINES = ("python", "compiled")
GOALS = ((1, 10000), (6, 4000))
"""Pairs and rates that the compiled loop must keep."""

COUNTING = "counting"
"""Name of the loop that only counts, among the engines of the table."""

TRIAL_S, TRIAL_TURNS = 0.1, 200
"""How long, and how far, the counting loop counts to find out how long a turn takes."""


class Paced(NamedTuple):
    """A case: time of computing, slots run and missed by engine; those of the empty loop.

    `stopped`: why runs of an engine ended early. What they measured until then counts.
    """

    pairs: int
    rate_hz: int
    compute: dict[str, Histogram]
    ran: dict[str, int]
    missed: dict[str, int]
    stopped: dict[str, list[str]]


def pairs_rig(pairs: int, rate_hz: int, engine: str) -> Rig:
    """Return the shipped one-pair rig with several identical pairs."""
    one = ONE_PAIR.load().model_dump(mode="json", exclude_unset=True)
    names = [f"lever{at}" for at in range(1, pairs + 1)]
    for side in ("master", "slave"):
        lever = one[side]["axes"].pop("lever")
        one[side]["axes"] = {name: {**lever, "id": at} for at, name in enumerate(names, 1)}
    one["coupling"]["pairs"] = dict.fromkeys(names, one["coupling"]["pairs"]["lever"])
    simulation = one["simulation"]
    simulation["axes"] = {
        f"{side}.{name}": simulation["axes"][f"{side}.lever"]
        for name in names
        for side in ("master", "slave")
    }
    for part in ("hand", "environment"):
        simulation[part] = dict.fromkeys(names, simulation[part]["lever"])
    # Missed slots are the measurement here, not a reason to stop.
    one.update(rate_hz=rate_hz, loop={"engine": engine, "overrun_limit": 1_000_000})
    return parse_rig(json.dumps(one))


def empty_loop(rate_hz: int, seconds: float, turns: int = 0) -> tuple[int, int, Histogram]:
    """Sleep from slot to slot as the loop does, and count `turns` in each slot.

    Returns slots run and missed, and the time from waking to the end of counting.
    """
    clock = MonotonicClock()
    compute = Histogram()
    period = round(1e9 / rate_hz)
    deadline = clock.now_ns()
    slot = ran = missed = 0
    while slot < seconds * rate_hz:
        ran += 1
        awake = clock.now_ns()
        counted = 1.0
        for _ in range(turns):
            counted = counted * 0.999 + 0.5
        compute.add(clock.now_ns() - awake)
        deadline += period
        slot += 1
        clock.sleep_until(deadline)
        skipped = (clock.now_ns() - deadline) // period
        if skipped > 0:
            slot += skipped
            deadline += skipped * period
            missed += skipped
    return ran, missed, compute


def _count_as_long(paced: Paced, engine: str, seconds: float) -> None:
    """Run the counting loop with as many turns as fill an engine's median cycle."""
    _, _, trial = empty_loop(paced.rate_hz, TRIAL_S, TRIAL_TURNS)
    turns = TRIAL_TURNS * paced.compute[engine].quantile_us(0.5) / trial.quantile_us(0.5)
    ran, missed, compute = empty_loop(paced.rate_hz, seconds, round(turns))
    paced.compute[COUNTING].add_all(compute)
    paced.ran[COUNTING] += ran
    paced.missed[COUNTING] += missed


def _run(paced: Paced, engine: str, seconds: float) -> None:
    rig = pairs_rig(paced.pairs, paced.rate_hz, engine)
    built = build_rig(rig, clock="real", duration_s=seconds, devices=compiled_devices(rig))
    built = with_engine(rig, built)
    with recorded(rig, built, lossless=False) as recorder, quiet_collector():
        loop = Loop(built.clock, built.buses, built.control, built.sources, recorder)
        result = loop.run()
    if isinstance(result.error, SafetyStop):  # a host that stands still is no fault of the loop
        paced.stopped[engine].append(str(result.error))
    elif result.error is not None:
        raise result.error
    paced.compute[engine].add_all(loop.compute)
    paced.ran[engine] += result.cycles
    paced.missed[engine] += result.missed_cycles


def measure(
    seconds: float,
    rounds: int,
    pairs: Sequence[int] = PAIRS,
    rates_hz: Sequence[int] = RATES_HZ,
    engines: Sequence[str] = ENGINES,
) -> dict[str, Any]:
    """Measure every case; `seconds` for each engine in each round."""
    first = pairs_rig(1, 1000, engines[0]).loop
    figures = []
    with realtime(first.fifo_priority, first.cpu, first.lock_memory) as granted:
        requests = list(granted)
        for count in pairs:
            for rate_hz in rates_hz:
                shown = (*engines, COUNTING)
                zero = dict.fromkeys((*shown, "empty"), 0)
                times = {name: Histogram() for name in shown}
                why: dict[str, list[str]] = {name: [] for name in shown}
                paced = Paced(count, rate_hz, times, dict(zero), dict(zero), why)
                for _ in range(rounds):
                    ran, missed, _ = empty_loop(rate_hz, seconds)
                    paced.ran["empty"] += ran
                    paced.missed["empty"] += missed
                    for engine in engines:
                        _run(paced, engine, seconds)
                    _count_as_long(paced, engines[-1], seconds)
                figures.append(_figures(paced))
    return {"realtime": requests, "seconds": seconds * rounds, "cases": figures}


def _figures(paced: Paced) -> dict[str, Any]:
    slots = {name: paced.ran[name] + paced.missed[name] for name in paced.ran}
    period_us = 1e6 / paced.rate_hz
    return {
        "pairs": paced.pairs,
        "rate_hz": paced.rate_hz,
        "missed_share": {name: paced.missed[name] / max(slots[name], 1) for name in slots},
        "stopped": paced.stopped,
        "compute_share": {
            name: {key: value / period_us for key, value in times.summary().items()}
            for name, times in paced.compute.items()
        },
    }


def _why(measured: dict[str, Any]) -> str:
    """Return why runs ended early, as a clause; nothing if none did."""
    reasons = [why for case in measured["cases"] for it in case["stopped"].values() for why in it]
    if not reasons:
        return ""
    runs = "1 run was" if len(reasons) == 1 else f"{len(reasons)} runs were"
    return (
        f"; {runs} ended early by a guard, as when the machine stands still for a while, and count "
        f"until then: {reasons[0]}"
    )


def rate_suite(measured: dict[str, Any]) -> Suite:
    """Return what was measured as a table and its goals."""
    rows: list[list[Any]] = []
    goals = []
    for case in measured["cases"]:
        empty = case["missed_share"]["empty"]
        for engine, share in case["compute_share"].items():
            missed = case["missed_share"][engine]
            rows.append(
                [
                    case["pairs"],
                    case["rate_hz"],
                    engine,
                    *(100.0 * share[key] for key in ("p50", "p99", "p999")),
                    100.0 * missed,
                    100.0 * empty,
                    len(case["stopped"][engine]),
                ]
            )
            if engine == "compiled" and (case["pairs"], case["rate_hz"]) in GOALS:
                plural = "pair" if case["pairs"] == 1 else "pairs"
                what = f"{case['pairs']} {plural} at {case['rate_hz'] / 1000:g} kHz, compiled"
                busy = 100.0 * share["p999"]
                goals.append(Goal(f"{what}: p99.9 of compute", 50.0, "% of the period", busy))
                machine = case["compute_share"][COUNTING]["p999"]
                goals.append(
                    Goal(
                        f"{what}: p99.9 of compute",
                        1.5,
                        "times the counting loop's",
                        share["p999"] / machine,
                    )
                )
                ratio = missed / empty if empty > 0.0 else (0.0 if missed == 0.0 else float("inf"))
                goals.append(
                    Goal(f"{what}: slots missed", 1.1, "times the empty loop's", min(ratio, 1e9))
                )
    return Suite(
        "loop --rate",
        [
            Table(
                "Compute time as a share of the period, and slots missed",
                "wall time of a cycle on the machine's clock, loopback devices and recording "
                f"included, in bins of 1 us; {measured['seconds']:g} s of each, engines, an empty "
                "sleeping loop and one that counts for as long as the median of the last engine "
                f"taking turns; {'; '.join(measured['realtime'])}"
                f"{_why(measured)}",
                (
                    "pairs", "rate_hz", "engine", "p50_percent", "p99_percent", "p999_percent",
                    "missed_percent", "empty_missed_percent", "stopped_runs",
                ),
                rows,
            )
        ],
        goals,
    )  # fmt: skip


if __name__ == "__main__":
    sys.stdout.write(json.dumps(measure(float(sys.argv[1]), int(sys.argv[2]))))
