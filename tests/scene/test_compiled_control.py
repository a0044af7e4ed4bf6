"""A scene whose axes are compiled with its steps has the rows and the end of one in Python."""

from __future__ import annotations

from dataclasses import asdict
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tautwave.config import load_rig
from tautwave.errors import TautwaveError
from tautwave.rig import build_rig
from tautwave.runtime.loop import Loop
from tautwave.runtime.sensing import Sensing
from tautwave.session.engine import scene_devices
from tautwave_scenes.session.pace import use_engine
from tautwave_scenes.simulation import tick, ticking
from tests.scene.test_runs import Rows

pytest.importorskip("numba")
CONFIGS = Path(__file__).parents[2] / "configs"
TIMES = ("lateness_us", "compute_us")


def rows_of(engine: str, name: str, changes: list[str], asked: int) -> tuple[Any, ...]:
    rig = load_rig(CONFIGS / f"{name}.yaml", changes)
    seconds = 3000 * rig.period_s
    built = build_rig(rig, clock="fake", duration_s=seconds, devices=scene_devices(rig, engine))
    built = use_engine(built, engine)
    sink = Rows(len(built.columns))
    loop: Loop

    def progress(share: float, word: str) -> None:
        if asked and len(sink.rows) > asked:
            loop.stop()

    loop = Loop(built.clock, built.buses, built.control, built.sources, sink, progress)
    result = loop.run()
    whole = np.array(sink.rows)
    kept = [at for at, column in enumerate(built.columns) if column not in TIMES]
    elements = built.control.scene.model.elements()  # type: ignore[union-attr]
    end = str(result.error), result.cycles, result.missed_cycles, result.lost, built.control.place()
    return whole[:, kept], end, elements, type(built.control).__name__, result.error


def test_the_state_goes_to_compiled_code_and_back_as_it_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Up to the first step that is compiled, which is not taken here."""
    monkeypatch.setattr("tautwave.simulation.live.entry.entry", lambda *_: print)
    monkeypatch.setattr(ticking, "compiled_tick", lambda: tick.tick_network)
    found = []
    for engine in ("python", "compiled"):
        rig = load_rig(CONFIGS / "scene-resonator.yaml")
        built = use_engine(build_rig(rig, clock="fake", duration_s=1.0), engine)
        control, sensing = built.control, Sensing(built.buses, built.control)
        for bus in built.buses:
            bus.driver.open()
            while not bus.driver.enable_step():
                built.clock.sleep_until(built.clock.now_ns() + rig.period_ns)
        for slot in count():
            sensing.sense(slot, 0)
            if control.step(slot, 0) and control.state.armed_at >= 0:
                break
        if engine == "compiled":
            control.state.armed_at = -7  # is read from there, not kept here
        axes = [asdict(control.axis(which)) for which in range(len(control.params))]
        row = [0.0] * len(control.columns)
        control.fill(row, 0)
        found.append((slot, control.state, axes, [*map(float, row)], control.end, control.error()))
    assert repr(found[0]) == repr(found[1])


@pytest.mark.slow  # numba compiles for ten seconds and more
@pytest.mark.nightly
@pytest.mark.parametrize(
    ("name", "changes", "asked", "kind"),
    [
        ("scene-resonator", [], 0, "None"),
        ("scene-granular", [], 1000, "None"),
        ("scene-resonator", ["simulation.faults.missing_probability=0.1"], 0, "None"),
        (
            "scene-resonator",
            ["simulation.faults.missing_probability=0.7", "loop.missing_limit=4"],
            0,
            "no sample in 4 cycles",
        ),
        (
            "scene-resonator",
            ["simulation.faults.overrun_probability=0.01", "simulation.faults.overrun_slots=3"],
            0,
            "None",
        ),
        ("scene-granular", ["master.axes.bar.velocity_limit=1e-3"], 0, "velocity limit"),
        ("scene-granular", ["scene.hold_limit_j=1e-15"], 0, "hold_limit_j"),
    ],
)
def test_rows_and_ends_are_those_of_plain_python(
    name: str, changes: list[str], asked: int, kind: str
) -> None:
    plain, compiled = (rows_of(engine, name, changes, asked) for engine in ("python", "compiled"))
    assert kind in compiled[1][0]
    assert compiled[3] == "CompiledSceneControl"
    assert plain[0].shape == compiled[0].shape
    differ = plain[0].view(np.uint64) != compiled[0].view(np.uint64)
    differ &= ~(np.isnan(plain[0]) & np.isnan(compiled[0]))
    assert not differ.any(), np.argwhere(differ)[0]
    assert plain[1] == compiled[1]
    assert plain[2] == compiled[2]
    assert plain[4] is None or isinstance(plain[4], TautwaveError)
