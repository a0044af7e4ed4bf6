"""`loop.engine: compiled`: the live loop around machine code gives the same rows, to the bit."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tautwave.config import Rig, load_rig
from tautwave.errors import ConfigError
from tautwave.rig import build_rig
from tautwave.runtime.control import Control, CoupledControl
from tautwave.runtime.loop import Loop, LoopResult
from tautwave.session import engine
from tautwave.simulation.live.control import CompiledControl
from tautwave.types import Fault
from tests.rigs.row_hashes import CHANGED, Case, rig_of
from tests.rigs.running import ListSink, tree
from tests.rigs.running import rig_of as rig_of_tree
from tests.runtime.parts import Bench, Pair, site
from tests.simulation.live import live_run

pytest.importorskip("numba")
RIGS = ("bench-1dof-loopback", "bench-multirate-loopback", "bench-admittance-loopback")
ALL = (*RIGS, "bench-2axis-loopback", "bench-position-coupling", "bench-saturation-loopback")
MORE = ("bench-foam-loopback", "bench-mixed-sim")


def compiled_run(rig: Rig, duration_s: float) -> tuple[np.ndarray[Any, Any], LoopResult]:
    """Run as `tautwave run` does with the compiled engine, its loopback devices too."""
    loop = rig.loop.model_copy(update={"engine": "compiled"})
    rig = rig.model_copy(update={"loop": loop})
    built = build_rig(
        rig, clock="fake", duration_s=duration_s, devices=engine.compiled_devices(rig)
    )
    built = engine.with_engine(rig, built)
    assert isinstance(built.control, CompiledControl)
    sink = ListSink(len(built.columns))
    result = Loop(built.clock, built.buses, built.control, built.sources, sink).run()
    return np.array(sink.rows), result


def assert_alike(rig: Rig, duration_s: float) -> None:
    live = live_run(rig, duration_s)
    rows, result = compiled_run(rig, duration_s)
    same = (rows == live.table) | (np.isnan(rows) & np.isnan(live.table))
    assert rows.shape == live.table.shape
    assert same.all(), [live.columns[at] for at in sorted(set(np.argwhere(~same)[:, 1]))]
    assert str(result.error) == str(live.result.error)
    assert result._replace(error=None) == live.result._replace(error=None)


@pytest.mark.slow
@pytest.mark.nightly
def test_coloured_noise_is_the_same_noise() -> None:
    noise = {"position_noise": 1e-5, "position_noise_autocorrelation": [-0.4]}
    assert_alike(rig_of_tree(tree({"simulation.axes": {"slave.a": noise}})), 0.5)


@pytest.mark.slow
@pytest.mark.parametrize("name", RIGS)
def test_rows_are_those_of_plain_python(name: str) -> None:
    assert_alike(rig_of(Case(name, "", "live")), 1.5)


@pytest.mark.slow
@pytest.mark.parametrize(
    "case", [Case(name, more, "live") for name in ALL for more in ("", *CHANGED.get(name, ()))],
    ids=str,
)  # fmt: skip
def test_every_stop_fault_and_delay_is_the_same(case: Case) -> None:
    assert_alike(rig_of(case), 2.5)


@pytest.mark.slow
@pytest.mark.parametrize("name", MORE)
def test_other_physics_and_other_buses_are_the_same(name: str) -> None:
    assert_alike(rig_of(Case(name, "", "live")), 2.5)


@pytest.mark.slow
@pytest.mark.parametrize("script", [{"faults": {7: Fault("master.a", "too hot", True)}}, {}])
def test_a_device_that_stops_the_run_is_named(script: dict[str, Any]) -> None:
    """A fault of the first bus comes before a sample that the second one lacks."""
    found = []
    for compiled in (False, True):
        bench = Bench(hand=script, arm={"valid": lambda axis, k: k < 4}, missing_limit=4)
        control: Control = bench.pair.control
        if compiled:
            assert isinstance(control, CoupledControl)
            control = CompiledControl(control)
        loop = Loop(bench.clock, bench.loop._buses, control, [control], bench)
        result = loop.run()
        found.append((str(result.error), result.cycles, result.lost, bench.rows))
    assert found[0] == found[1]
    assert ("too hot" if script else "no sample in 4 cycles") in found[0][0]


@pytest.mark.slow
@pytest.mark.parametrize("broken", [float("nan"), float("inf")])
def test_a_broken_sample_reaches_no_motor(broken: float) -> None:
    bench = Bench(arm={"positions": lambda axis, k: broken if k == 9 else 0.0})
    control = CompiledControl(bench.pair.control)
    result = Loop(bench.clock, bench.loop._buses, control, [control], bench).run()
    assert "a sensor or its driver is broken" in str(result.error)
    assert all(np.isfinite(it[0].effort) for it in bench.arm.written)


def test_without_numba_it_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "find_spec", lambda name: None)
    rig = rig_of_tree(tree({"loop.engine": "compiled"}))
    with pytest.raises(ConfigError, match=r"loop.engine: compiled needs numba: pip install"):
        engine.compiled_devices(rig)


@pytest.mark.slow
def test_compiling_is_announced_where_nothing_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = rig_of_tree(tree({"loop.engine": "compiled"}))
    reported: list[str] = []
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    engine.compiled_devices(rig, lambda share, word: reported.append(word))
    monkeypatch.undo()
    CompiledControl(Pair(site(), site()).control)
    engine.compiled_devices(rig, lambda share, word: reported.append("again"))
    assert reported == ["compiling the controller (once per machine and version)"]


@pytest.mark.slow
def test_a_run_in_python_does_not_import_numba() -> None:
    code = (
        "import sys; from tautwave.session import running; from tautwave.config import parse_rig;"
        "from tautwave.session.engine import compiled_devices, with_engine;"
        "assert not {'numba', 'tautwave.simulation.kernel.compiled'} & {*sys.modules}"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_scene_has_an_engine_of_its_own() -> None:
    path = Path(__file__).parents[2] / "configs" / "scene-resonator.yaml"
    with pytest.raises(ConfigError, match=r"loop.engine.*scene.engine"):
        load_rig(path, ["loop.engine=compiled"])
