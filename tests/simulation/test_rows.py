"""Live equals offline: every row of every engine, to the bit, and the way a run ends."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

import tautwave
from tautwave.config import Rig, load_rig
from tautwave.errors import SafetyStop
from tautwave.recordings.recording import read_recording
from tautwave.rig import build_rig
from tautwave.runtime.loop import Loop
from tautwave.runtime.recorder import Recorder
from tautwave.simulation import simulate
from tests.rigs.running import Tree, rig_of, tree
from tests.simulation.family import any_rigs
from tests.simulation.live import COMPILED_APART, CONFIGS, assert_equal, assert_same, live_run

pytest.importorskip("numba")


def bench(name: str, *changes: str) -> Rig:
    [path] = [path for path in CONFIGS if path.stem == name]
    return load_rig(path, list(changes))


SHIPPED = [
    pytest.param(path, marks=[pytest.mark.slow] if path.stem in COMPILED_APART else [])
    for path in CONFIGS
]


@pytest.mark.sparse(6)
@pytest.mark.parametrize("path", SHIPPED, ids=[path.stem for path in CONFIGS])
def test_shipped_rigs(path: Path) -> None:
    live = assert_equal(load_rig(path), "compiled", duration_s=2.5)
    assert len(live.table) > 1000


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_the_kernel_is_plain_python_too(path: Path) -> None:
    assert_equal(load_rig(path), "python", duration_s=0.25)


def assert_ends_and_rows(rig: Rig, engine: str) -> None:
    live = live_run(rig)
    error = live.result.error
    if isinstance(error, SafetyStop) and "engage_tolerance" in str(error):
        with pytest.raises(SafetyStop) as caught:
            simulate(rig, engine=engine)
        assert str(caught.value) == str(error)
    else:
        assert_same(live, simulate(rig, engine=engine))


@pytest.mark.slow
@settings(max_examples=80, suppress_health_check=list(HealthCheck))
@given(any_rigs())
def test_rigs_of_every_kind(data: Tree) -> None:
    wave = data["coupling"].get("law") != "position"
    assert_ends_and_rows(rig_of(data), "compiled" if wave else "python")


@pytest.mark.slow
@settings(max_examples=40, suppress_health_check=list(HealthCheck))
@given(any_rigs().filter(lambda rig: rig["coupling"].get("law") == "position"))
def test_positions_of_every_kind(data: Tree) -> None:
    assert_ends_and_rows(rig_of(data), "compiled")


STOPS = {
    "position range": ({"master.axes.a.position_range": [-0.01, 0.02]}, "left its position range"),
    "velocity": ({"master.axes.a.velocity_limit": 0.1}, "exceeded its velocity limit"),
    "missing samples": (
        {"simulation.faults": {"missing_probability": 0.5}, "loop.missing_limit": 5},
        "no sample in 5 cycles in a row",
    ),
    "overruns": (
        {
            "simulation.faults": {"overrun_probability": 0.01, "overrun_slots": 7},
            "loop.overrun_limit": 7,
        },
        "7 slots of 1 ms were missed in a row",
    ),
}
HELD: Tree = {
    "coupling.release_ramp_s": 0.05,
    "coupling.delay_s": 0.003,
    "simulation.hand.a": {
        "reference": {"type": "minimum_jerk", "waypoints": [[0.1, 0.0], [0.6, 0.1]]}
    },
}


@pytest.mark.parametrize("name", STOPS)
@pytest.mark.parametrize(
    ("law", "engines"),
    [
        ("wave", ("compiled", "python")),
        ("position", ("python",)),
        pytest.param("position", ("compiled",), marks=pytest.mark.slow),
    ],
)
def test_a_stop_ends_the_rows_as_live(name: str, law: str, engines: tuple[str, ...]) -> None:
    change, sentence = STOPS[name]
    data = tree(HELD, change)
    if law == "position":
        data["coupling"]["law"] = law
        data["coupling"]["pairs"]["a"] = {"stiffness": 500.0, "damping": 3.0}
    live = assert_equal(rig_of(data), *engines)
    assert sentence in str(live.result.error)
    assert 50 < len(live.table) < 1000


def test_coloured_noise_is_the_same_in_every_engine() -> None:
    noise = {"position_noise": 1e-5, "position_noise_autocorrelation": [0.5]}
    own = {f"master.axes.a.{key}": value for key, value in noise.items()}
    rig = rig_of(tree({**own, "simulation.axes": {"slave.a": noise}}))
    live = assert_equal(rig, "compiled", "python", duration_s=0.5)
    white = live_run(rig_of(tree({"master.axes.a.position_noise": 1e-5})), 0.5)
    assert not np.array_equal(live.table, white.table)


def test_a_stop_on_one_pair_stops_the_other() -> None:
    live = assert_equal(
        bench("bench-2axis-loopback", "master.axes.wrist.velocity_limit=0.1"), "compiled"
    )
    assert "master.wrist exceeded" in str(live.result.error)


def test_a_start_too_far_apart_is_refused_alike() -> None:
    rig = rig_of(tree({"coupling.pairs.a.offset": 0.02, "coupling.pairs.a.engage_tolerance": 0.01}))
    error = live_run(rig).result.error
    assert "pair a: the slave starts +0.02 m away from where the master puts it" in str(error)
    assert "engage_tolerance (0.01 m at the slave)" in str(error)
    for engine in ("compiled", "python"):
        with pytest.raises(SafetyStop) as caught:
            simulate(rig, engine=engine)
        assert str(caught.value) == str(error)


@pytest.mark.parametrize("missing", [0.0, 1.0])
def test_not_engaging_is_refused_alike(missing: float) -> None:
    rig = rig_of(
        tree(
            {
                "duration_s": 6.0,
                "rate_hz": 100.0,
                "loop.missing_limit": 1000,
                "simulation.faults": {"missing_probability": missing},
                "coupling.pairs.a.wall_master": {"position": -1.0, "stiffness": 500.0},
            }
        )
    )
    error = live_run(rig).result.error
    if missing:
        assert error is None or "not engaged" in str(error)
    else:
        assert "not engaged after 5 s" in str(error)
    for engine in ("compiled", "python"):
        with pytest.raises(SafetyStop) as caught:
            simulate(rig, engine=engine)
        assert str(caught.value) == str(error)


def test_a_recorded_file_holds_the_same_rows(tmp_path: Path) -> None:
    rig = bench("bench-saturation-loopback")
    built = build_rig(rig, clock="fake", duration_s=1.0)
    recorder = Recorder(
        tmp_path / "run.mcap",
        built.columns,
        metadata={},
        attachments={},
        lossless=True,
        rate_hz=rig.rate_hz,
    )
    recorder.start()
    try:
        Loop(built.clock, built.buses, built.control, built.sources, recorder).run()
    finally:
        recorder.close()
    recording = read_recording(tmp_path / "run.mcap")
    simulation = tautwave.simulate(rig, duration_s=1.0)
    for name in simulation.columns:
        np.testing.assert_array_equal(recording[name], simulation[name])


def test_a_run_leaves_nothing_to_the_next() -> None:
    """State is fresh in every run: the second is the first again."""
    rig = bench("bench-saturation-loopback")
    first, second = (simulate(rig, duration_s=0.5).data for _ in range(2))
    assert first.tobytes() == second.tobytes()
