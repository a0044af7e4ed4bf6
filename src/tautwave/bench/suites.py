"""The two suites of `tautwave bench`: measurements and goals."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from tautwave.bench import calls, chains, compiled
from tautwave.bench.chunks import Cost, calling, costs
from tautwave.bench.live import child, think
from tautwave.bench.result import Goal, Suite, Table, Value
from tautwave.bench.rigs import ONE_PAIR, RIGS, TWO_PAIRS
from tautwave.bench.simulated import simulate_costs

Tell = Callable[[str], None]

CHUNKS = (
    "CPU time in chunks of 1 ms between two calibrations, chunks on a slowed core left out; "
    "best and median chunk"
)


def silent(_: str) -> None:
    """Say nothing about progress."""


def laws(*, rounds: int = 40, compile_laws: bool = True, tell: Tell = silent) -> Suite:
    """Measure every law and model, live and compiled, and a step of `simulate`.

    Parameters
    ----------
    rounds : int
        Chunks per figure.
    compile_laws : bool
        Measure what numba makes of them too, where it is installed.
    tell : callable
        Called with the name of each measurement as it starts.
    """
    tell("think part, live")
    site_costs = think.part_costs(think.cases(), rounds)
    tables = [_think_table(site_costs)]
    with_numba = compile_laws and compiled.has_numba()
    for title, group in (("Laws", calls.LAWS), ("Models of devices", calls.MODELS)):
        tell(f"{title.lower()}, live")
        live = costs({c.name: calling(c.function, *c.arguments) for c in group}, rounds)
        fast: dict[str, Cost] = {}
        if with_numba:
            tell(f"{title.lower()}, compiled (numba compiles for some seconds)")
            fast = costs(compiled.kernels(group), rounds)
        tables.append(_law_table(title, live, fast, with_numba))
    worst = max(cost["both"].median_ns / 1e3 for cost in site_costs.values())
    tell("serial chains")
    tables.append(chains.chain_table(rounds, with_numba=with_numba))
    goals = [Goal("think part per axis and cycle, live, slowest kind", 5.0, "us", worst)]
    if compile_laws:
        tell("simulate (numba compiles for half a minute where it has not yet)")
        tables.append(simulate_costs((ONE_PAIR, TWO_PAIRS), rounds))
    return Suite("laws", tables, goals)


def loop(
    *,
    duration_s: float = 10.0,
    simulated_s: float = 10.0,
    memory_s: float = 120.0,
    rounds: int = 5,
    tell: Tell = silent,
) -> Suite:
    """Measure the whole loop: its cycle, a FakeClock run, a real-time run, starting, memory.

    Parameters
    ----------
    duration_s : float
        Length of the real-time run [s].
    simulated_s : float
        Length of the FakeClock runs [s].
    memory_s : float
        Simulated time over which the resident size is watched [s].
    rounds : int
        How often each command is started.
    tell : callable
        Called with the name of each measurement as it starts.
    """
    tell("one cycle, CPU time")
    cycles = {
        name: child.measure("cycle_cost", rig.path(), simulated_s) for name, rig in RIGS.items()
    }
    tell("FakeClock run with recording")
    fake = {name: child.measure("fake_run", rig.path(), simulated_s) for name, rig in RIGS.items()}
    fast = f"{TWO_PAIRS.name}, compiled"
    with_numba = compiled.has_numba()
    if with_numba:
        tell("FakeClock run, compiled (numba compiles for a while, once)")
        fake[fast] = child.measure("fake_run_compiled", TWO_PAIRS.path(), simulated_s)
    tell(f"real time, {duration_s:g} s")
    real = child.measure("realtime_run", TWO_PAIRS.path(), duration_s)
    tell("starting")
    check = str(TWO_PAIRS.path())
    starts = child.start_costs(
        {
            "python, nothing": ("-c", "pass"),
            "import tautwave": ("-c", "import tautwave"),
            "tautwave --help": ("-c", child.MAIN, "--help"),
            "tautwave check": ("-c", child.MAIN, "check", check),
        },
        rounds,
    )
    tell(f"memory over {memory_s / 60.0:g} simulated minutes")
    memory = child.measure("memory", TWO_PAIRS.path(), memory_s)
    pair = TWO_PAIRS.name
    hour = " over an hour" if memory_s >= 3600.0 else f" over {memory_s:g} simulated s"
    return Suite(
        "loop",
        [
            _cycle_table(cycles),
            _fake_table(fake),
            _real_table(real),
            _start_table(starts),
            _memory_table(memory),
        ],
        [
            Goal(f"cycle of {pair}, p50 of CPU time", 60.0, "us", cycles[pair]["p50_us"]),
            Goal(
                f"FakeClock run of {pair} with recording, loop's CPU",
                20.0,
                "times real time",
                fake[pair]["times_real_cpu"],
                at_least=True,
            ),
            Goal(
                f"FakeClock run of {pair} with recording, wall clock",
                20.0,
                "times real time",
                fake[pair]["times_real_wall"],
                at_least=True,
            ),
            Goal(
                f"FakeClock run of {fast}, with recording, loop's CPU",
                40.0,
                "times real time",
                fake[fast]["times_real_cpu"] if with_numba else None,
                at_least=True,
                why_not="" if with_numba else compiled.NO_NUMBA,
            ),
            Goal("tautwave --help, CPU", 0.2, "s", starts["tautwave --help"].median_ns / 1e9),
            Goal("tautwave check, CPU", 0.7, "s", starts["tautwave check"].median_ns / 1e9),
            Goal(f"resident size{hour}", 300.0, "MB", memory["greatest_mb"]),
            Goal(f"growth of the resident size{hour}", 1.0, "MB", memory["growth_mb"]),
        ],
    )


def rates(*, duration_s: float = 10.0, tell: Tell = silent) -> Suite:
    """Measure how fast the live loop can go, `duration_s` for each engine and case."""
    from tautwave.bench.live.rate import rate_suite

    tell(f"1, 2 and 6 pairs at 1, 2, 4 and 10 kHz, {duration_s:g} s each, in turns")
    rounds = max(1, round(duration_s / 2.0))
    return rate_suite(child.rates(duration_s / rounds, rounds))


def view(*, duration_s: float = 30.0, tell: Tell = silent) -> Suite:
    """Measure what bridges cost a run, in turns of a second for `duration_s`."""
    from tautwave.bench.live.viewed import viewed, viewed_suite

    tell(f"a run with its bridges open and stopped in turns, {duration_s:g} s")
    return viewed_suite(viewed(turns=2 * max(1, round(duration_s / 2.0)), turn_s=1.0))


def _think_table(site: dict[str, dict[str, Cost]]) -> Table:
    rows: list[list[Value]] = []
    for name, cost in site.items():
        parts = [cost[part].median_ns for part in think.PARTS]
        rows.append([name, *parts, cost["both"].best_ns])
    return Table(
        "Think part of one axis in one cycle, live plain Python",
        "the controller's steps as the loop calls them: slot and close, receive and think, both; "
        + CHUNKS,
        ("axis", "close_ns", "think_ns", "both_ns", "both_best_ns"),
        rows,
    )


def _law_table(title: str, live: dict[str, Cost], fast: dict[str, Cost], numba: bool) -> Table:
    rows: list[list[Value]] = []
    for name, cost in live.items():
        quick = fast.get(name)
        rows.append(
            [
                name,
                cost.best_ns,
                cost.median_ns,
                None if quick is None else quick.median_ns,
                None if quick is None else cost.median_ns / max(quick.median_ns, 1e-3),
            ]
        )
    what = "plain Python called from a loop; compiled: numba, no fastmath, in a compiled loop"
    if not numba:
        what += f" (left out: {compiled.NO_NUMBA})"
    return Table(
        f"{title}, one call",
        f"{what}; {CHUNKS}",
        ("law" if title == "Laws" else "model", "best_ns", "median_ns", "compiled_ns", "ratio"),
        rows,
    )


def _cycle_table(cycles: dict[str, dict[str, Any]]) -> Table:
    return Table(
        "One whole cycle on loopback devices, recorder running",
        "CPU time of the loop's thread between two sleeps of the FakeClock, physics of the "
        "simulated devices included; cycles on a slowed core left out, except p50_of_all",
        ("rig", "p10_us", "p50_us", "p90_us", "p99_us", "mean_us", "p50_of_all_us", "kept_cycles"),
        [
            [
                name,
                *(c[f"{key}_us"] for key in ("p10", "p50", "p90", "p99", "mean", "p50_of_all")),
                f"{c['quiet_chunks']} of {c['chunks']} chunks",
            ]
            for name, c in cycles.items()
        ],
    )


def _fake_table(fake: dict[str, dict[str, Any]]) -> Table:
    return Table(
        "FakeClock run with recording",
        "Loop.run from open to close; CPU time of the loop's process, and wall time, in which "
        "the loop also waits for the recording's writer",
        ("rig", "simulated_s", "cpu_s", "wall_s", "times_real_cpu", "times_real_wall", "dropped"),
        [
            [
                name,
                f["simulated_s"],
                f["cpu_s"],
                f["wall_s"],
                f["times_real_cpu"],
                f["times_real_wall"],
                f["rows_dropped"],
            ]
            for name, f in fake.items()
        ],
    )


def _real_table(real: dict[str, Any]) -> Table:
    rows: list[list[Value]] = [
        ["lateness_us", *(real["lateness_us"][key] for key in ("p50", "p99", "p999", "max"))],
        ["compute_us", *(real["compute_us"][key] for key in ("p50", "p99", "p999", "max"))],
    ]
    granted = "; ".join(real["realtime"])
    return Table(
        f"Real time: {TWO_PAIRS.name} at {real['rate_hz']:g} Hz for {real['seconds']:g} s, "
        f"{real['missed_cycles']} cycles missed",
        f"wall time on the machine's clock with recording; {granted}; {real['cycles']} cycles "
        f"ran, {real['rows_dropped']} rows dropped, {100.0 * real['cpu_share']:.1f} % of a core, "
        f"{real['resident_mb']:.0f} MB resident"
        + ("" if real["error"] is None else f"; ended early: {real['error']}"),
        ("time", "p50", "p99", "p999", "max"),
        rows,
    )


def _start_table(starts: dict[str, Cost]) -> Table:
    return Table(
        "Starting",
        "CPU time of the whole process, user and system; best and median of "
        f"{next(iter(starts.values())).taken} starts in turn",
        ("command", "best_s", "median_s"),
        [[name, cost.best_ns / 1e9, cost.median_ns / 1e9] for name, cost in starts.items()],
    )


def _memory_table(memory: dict[str, Any]) -> Table:
    sizes = memory["resident_mb"]
    return Table(
        f"Memory: {TWO_PAIRS.name} at 1 kHz for {memory['simulated_s']:g} simulated s",
        f"resident size of the loop's process every {memory['every_s']:g} simulated s, FakeClock, "
        "recording, ring included; `--hour` watches an hour",
        ("samples", "first_mb", "last_mb", "greatest_mb", "growth_mb", "slope_mb_per_h"),
        [
            [
                len(sizes),
                *(memory[key] for key in ("first_mb", "last_mb", "greatest_mb", "growth_mb")),
                memory["slope_mb_per_h"],
            ]
        ],
    )
