"""Every measurement in tiny mode: it runs and says what it measured. Speed is never asserted."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from tautwave import bench
from tautwave.bench import calls, chunks, compiled, result, rigs, simulated, suites
from tautwave.bench.live import child, think
from tautwave.bench.live import loop as live
from tautwave.bench.result import Goal, Suite, Table
from tautwave.cli import main
from tautwave.cli.terminal import measured as cli_bench

RIG = rigs.ONE_PAIR.path()


def numbers(value: Any) -> list[float]:
    if isinstance(value, bool | str) or value is None:
        return []
    if isinstance(value, dict):
        return [n for item in value.values() for n in numbers(item)]
    if isinstance(value, list | tuple):
        return [n for item in value for n in numbers(item)]
    return [float(value)]


def test_a_cost_counts_only_chunks_on_a_quiet_core() -> None:
    cost = chunks.summary([(100, 5.0), (105, 7.0), (110, 6.0), (200, 1.0)], 100)
    assert cost == chunks.Cost(5.0, 6.0, 3, 4)


def test_a_core_that_is_never_quiet_still_gives_a_figure() -> None:
    taken = [(100, 9.0)] + [(200 + at, 5.0 + at) for at in range(20)]
    assert chunks.summary(taken, 100).counted == 5


def test_costs_of_works_in_turn() -> None:
    found = chunks.costs({"sqrt": chunks.calling(math.sqrt, 2.0)}, rounds=2, chunk_ns=2e4)
    assert found["sqrt"].taken == 2
    assert 0.0 < found["sqrt"].best_ns <= found["sqrt"].median_ns


@pytest.mark.parametrize("call", [*calls.LAWS, *calls.MODELS], ids=lambda call: call.name)
def test_calls_are_typical(call: calls.Call) -> None:
    given = call.function(*call.arguments)
    assert all(math.isfinite(n) for n in numbers(given))
    assert isinstance(call.arguments[call.chain], float)


def test_the_named_events_of_the_plant_happen() -> None:
    by_name = {call.name: call.function(*call.arguments) for call in calls.MODELS}
    assert by_name["plant_step, friction stops it"][1] == 0.0
    assert by_name["plant_step, stops and turns back"][1] < 0.0
    assert by_name["plant_step, meets the wall"][0] > calls.PLANT.wall_position
    assert 0.0 < by_name["plant_step, nothing happens"][0] < calls.PLANT.wall_position


def test_think_parts_are_those_of_an_axis_that_is_well() -> None:
    """A port that begins without its reserve is starved, and measured at repaying."""
    for case in (case for case in think.cases() if case.impedance):
        bench = think.standing_axis(case)
        close, receive = think.closing(bench), think.thinking(bench)
        for position in think.POSITIONS[:300]:
            close(position)
            receive()
            assert not bench.pair.one.stopping
            assert not getattr(bench.pair.one.end, "watched", False)
        assert bench.pair.one.command != 0.0


def test_think_parts_cost_something() -> None:
    found = think.part_costs(think.cases()[:1], 1)
    assert all(cost.best_ns > 0.0 for part in found.values() for cost in part.values())


@pytest.mark.slow
def test_a_compiled_call_runs() -> None:
    pytest.importorskip("numba")
    works = compiled.kernels((calls.LAWS[0],))
    assert works["track_velocity"](10) > 0.0


@pytest.mark.parametrize("path", [rig.path() for rig in rigs.RIGS.values()])
def test_own_rigs_run_to_their_end(path: Path) -> None:
    found = live.fake_run(path, 0.05)
    assert found["rows_written"] == 50
    assert found["rows_dropped"] == 0


def test_the_meter_sees_every_cycle() -> None:
    found = live.cycle_cost(RIG, 0.3)
    assert found["cycles"] == 300
    assert found["p10_us"] <= found["p50_us"] <= found["p90_us"]


def test_the_real_time_run_says_what_it_was_granted() -> None:
    found = live.realtime_run(RIG, 0.05)
    assert 0 < found["cycles"] + found["missed_cycles"] <= 50  # a stall may reach beyond its end
    assert len(found["realtime"]) == 3
    assert found["error"] is None


def test_memory_is_sampled_and_its_slope_reported() -> None:
    found = live.memory(RIG, 0.04)
    assert len(found["resident_mb"]) in (3, 4)
    assert found["growth_mb"] == found["last_mb"] - found["first_mb"]


@pytest.mark.slow
def test_a_measurement_in_a_process_of_its_own() -> None:
    found = child.measure("fake_run", RIG, 0.02)
    assert found["simulated_s"] == pytest.approx(0.02)


def test_starting_costs_cpu_time() -> None:
    found = child.start_costs({"python": ("-S", "-c", "pass")}, 1)
    assert found["python"].best_ns > 0.0


def test_goals_are_met_missed_or_not_measured() -> None:
    assert Goal("a", 5.0, "us", 4.0).met is True
    assert Goal("a", 5.0, "us", 6.0).met is False
    assert Goal("a", 20.0, "x", 21.0, at_least=True).met is True
    assert Goal("a", 5.0, "us", None).met is None


def fake_measure(name: str, path: Path, seconds: float) -> dict[str, Any]:
    quantiles = dict.fromkeys(("p50", "p99", "p999", "max"), 1.5)
    return {
        "cycle_cost": {
            **{f"{key}_us": 2.0 for key in ("p10", "p50", "p90", "p99", "mean", "p50_of_all")},
            "quiet_chunks": 1,
            "chunks": 2,
        },
        "fake_run": dict.fromkeys(
            ("simulated_s", "cpu_s", "wall_s", "times_real_cpu", "times_real_wall"), 3.0
        )
        | {"rows_dropped": 0},
        "realtime_run": {
            "seconds": seconds,
            "rate_hz": 1000.0,
            "cycles": 9,
            "missed_cycles": 1,
            "lateness_us": quantiles,
            "compute_us": quantiles,
            "cpu_share": 0.1,
            "resident_mb": 60.0,
            "rows_dropped": 0,
            "realtime": ["SCHED_FIFO refused"],
            "error": None,
        },
        "memory": {
            "simulated_s": seconds,
            "every_s": 1.0,
            "resident_mb": [50.0, 50.0],
            **dict.fromkeys(("first_mb", "last_mb", "greatest_mb"), 50.0),
            "growth_mb": 0.0,
            "slope_mb_per_h": 0.0,
        },
    }[name]


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Suites that measure nothing but the smallest chunk of the laws."""
    monkeypatch.setattr(child, "measure", fake_measure)
    monkeypatch.setattr(
        child,
        "start_costs",
        lambda commands, rounds: {name: chunks.Cost(1e7, 2e7, 1, 1) for name in commands},
    )
    real_costs = chunks.costs
    for module in (suites, think):
        monkeypatch.setattr(module, "costs", lambda works, rounds: real_costs(works, 1, 1e4))
    monkeypatch.setattr(compiled, "has_numba", lambda: False)
    monkeypatch.setattr(
        suites, "simulate_costs", lambda rigs, rounds: Table("C", "what", ("rig",), [])
    )


@pytest.mark.usefixtures("quick")
def test_the_suites_name_every_goal_of_speed_and_memory() -> None:
    goals = [goal.name for suite in (bench.loop(), bench.laws()) for goal in suite.goals]
    for word in ("think part", "cycle", "FakeClock", "--help", "check", "resident size"):
        assert any(word in name for name in goals)


@pytest.mark.sparse(2)
@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("words", [(), ("loop",), ("laws",), ("loop", "--hour")])
def test_tables_and_goals_are_printed(words: tuple[str, ...]) -> None:
    done = CliRunner().invoke(main, ["bench", *words], catch_exceptions=False)
    assert done.exit_code == 0
    assert "Goals" in done.output
    if words != ("laws",):
        assert "real time for 10 s" in done.output or "1 cycles missed" in done.output
    if "--hour" in words:
        assert "3600 simulated s" in done.output


@pytest.mark.usefixtures("quick")
def test_json_holds_machine_tables_and_goals() -> None:
    done = CliRunner().invoke(main, ["bench", "loop", "--json"], catch_exceptions=False)
    printed = json.loads(done.output)
    assert printed["bench"] == "loop"
    assert printed["machine"]["cores"]
    assert all(table["what"] and table["rows"] for table in printed["tables"])
    assert {"name", "limit", "measured", "met"} <= set(printed["goals"][0])
    both = json.loads(CliRunner().invoke(main, ["bench", "--json"]).output)
    assert [suite["bench"] for suite in both["suites"]] == ["loop", "laws"]


def test_headings_and_figures_read_well() -> None:
    assert cli_bench.heading("both_best_ns") == "both best [ns]"
    assert cli_bench.heading("slope_mb_per_h") == "slope [MB/h]"
    assert cli_bench.figure(1234.56) == "1235"
    assert cli_bench.figure(1.23456) == "1.23"
    assert cli_bench.figure(None) == "-"


def test_a_suite_is_plain_data() -> None:
    suite = Suite("x", [Table("t", "w", ("a", "b_ns"), [["one", 2.0]])], [])
    assert suite.as_dict()["tables"][0]["rows"] == [{"a": "one", "b_ns": 2.0}]
    assert "processor" in result.machine()


def test_simulate_where_there_is_no_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulated, "has_numba", lambda: False)
    table = simulated.simulate_costs((rigs.ONE_PAIR,), 1)
    assert table.rows[0][1] is None
    assert "numba" in str(table.rows[0][2])


def test_a_whole_run_is_timed_by_the_step() -> None:
    """A stand-in for the kernel: compiling it takes longer than a test should."""
    steps, cost = simulated._measure(rigs.ONE_PAIR, 1, 0.002, lambda *tables: 1)
    assert steps == 2
    assert cost.best_ns >= 0.0
