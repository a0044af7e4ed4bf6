"""Tuning: whole sets only, ramps, and no energy from a change."""

from __future__ import annotations

import fcntl
import json
import os
import struct
import subprocess
import sys
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pytest

from tautwave.config import Rig, load_rig
from tautwave.couplings.wave.port import WaveEnd, tune
from tautwave.errors import RecordingError
from tautwave.rig import build_rig
from tautwave.rig.controller import end_constants
from tautwave.rig.tuning import knobs_of, tunables
from tautwave.runtime.loop import Loop
from tautwave.runtime.tuning.desk import ParameterPage, last_left, leave
from tautwave.runtime.tuning.source import Tuning
from tautwave.session.engine import with_engine
from tautwave.session.operating import with_operation
from tautwave.session.viewing.tuning import (
    tuning_facts,
    tuning_of,
    with_tuning,
)
from tautwave.types import CommandDelay
from tautwave_scenes.session.pace import use_engine
from tests.runtime.operating import BARE, BENCH, Rows, bench

K = "coupling.pairs.lever.wall_slave.stiffness"
FILTER = "coupling.pairs.lever.wave_filter_hz"
INTO = "simulation.hand.lever.reference={type: minimum_jerk, waypoints: [[0, 0], [0.6, -0.4]]}"


class Tuned(NamedTuple):
    columns: Mapping[str, npt.NDArray[np.float64]]
    changes: list[dict[str, Any]]
    notes: list[str]

    def __getitem__(self, name: str) -> npt.NDArray[np.float64]:
        return self.columns[name]

    def residual(self) -> float:
        """Return what the books of the pair do not explain, at most [J]."""
        ports = [c for name, c in self.columns.items() if name.endswith(".port_energy")]
        kept = [c for name, c in self.columns.items() if name.endswith((".stored", ".dissipated"))]
        return float(np.abs(sum(ports) - sum(kept)).max())


def tuned(
    rig: Rig, duration_s: float, sets: Mapping[float, Mapping[str, float]], engine: str = "python"
) -> Tuned:
    """Run a rig on the fake clock, with sets of values left on its desk at some times [s]."""
    assembly = with_engine(rig, build_rig(rig, clock="fake", duration_s=duration_s))
    assembly = use_engine(with_operation(rig, assembly, (), ()), engine)
    with tuning_of(rig, assembly, allowed=True) as tuning:
        assert tuning is not None
        assembly = with_tuning(assembly, tuning)
        goals = {knob.path: knob.value for knob in tuning.knobs}
        due = sorted(sets.items())
        facts = tuning_facts(rig, tuning, [])
        assert facts is not None

        class Sink(Rows):
            def commit(self) -> None:
                super().commit()
                while due and self.row[0] >= due[0][0]:
                    goals.update(due.pop(0)[1])
                    leave(facts["desk"], list(goals.values()))

        sink = Sink(assembly.columns)
        notes: list[str] = []
        tuning.note = lambda at_s, text: notes.append(text)
        Loop(assembly.clock, assembly.buses, assembly.control, assembly.sources, sink).run()
        table = np.array(sink.kept)
        return Tuned(dict(zip(assembly.columns, table.T, strict=True)), tuning.summary(), notes)


def test_a_wall_softens_in_contact_and_stiffens_only_out_of_it() -> None:
    run = tuned(load_rig(BENCH, [INTO]), 1.3, {0.9: {K: 1.0}, 1.15: {K: 2.5}})
    acts, time = run["tuning.slave.lever.wall_stiffness"], run["time_s"]
    pushes = np.abs(run["slave.lever.wall_effort"])
    assert pushes[time > 0.9].min() > 0.001  # it is in the wall all the while
    falls = np.diff(acts)
    assert acts[time <= 0.9].tolist() == [3.0] * int((time <= 0.9).sum())
    assert falls.min() == pytest.approx(-2.0 / 200, rel=1e-6)  # 0.2 s at 1 kHz
    assert acts[-1] == 1.0  # it waits to rise: the wall is not left
    assert falls.max() <= 0.0
    assert run["tuning.generation"][-1] == 2.0
    assert [change["values"] for change in run.changes] == [{K: 1.0}, {K: 2.5}]
    assert run.notes == [f"{K} 1", f"{K} 2.5"]
    # What the spring gave up when it softened is booked: nothing is left over, nothing is made.
    assert run.residual() < 1e-12
    rigid = tuned(load_rig(BENCH, [INTO]), 1.3, {})
    assert run["lever.wall_slave.dissipated"][-1] > rigid["lever.wall_slave.dissipated"][-1] + 1e-4


def test_a_wall_that_is_not_touched_stiffens_within_the_ramp() -> None:
    run = tuned(load_rig(BENCH), 0.4, {0.1: {K: 2.0}, 0.11: {K: 3.0}})
    acts = run["tuning.slave.lever.wall_stiffness"]
    assert acts.min() == pytest.approx(2.95)
    assert acts[-1] == 3.0


def test_a_ceiling_goes_down_to_a_twentieth_of_its_limit() -> None:
    rig = load_rig(BENCH)
    knobs = {knob.path: knob for knob in knobs_of(rig, build_rig(rig, clock="fake").control)}
    ceiling = knobs["slave.axes.lever.effort_limit"]
    assert (ceiling.low, ceiling.high) == (pytest.approx(0.05 * 1.1), 1.1)


def test_viewers_are_sent_every_knob_and_of_what_is_fixed() -> None:
    rig = load_rig(BENCH)
    control = build_rig(rig, clock="fake").control
    knobs = [knob for knob in knobs_of(rig, control) if knob.path in (K, FILTER)]
    desk = ParameterPage(len(knobs))
    try:
        facts = tuning_facts(rig, Tuning(knobs, desk, rig.period_s), ["master"])
        assert facts is not None
        assert json.loads(json.dumps(facts)) == facts
        assert facts["knobs"] == [
            {"path": FILTER, "column": "tuning.lever.wave_filter_hz", "unit": "Hz",
             "when": "engaged", "value": 100.0, "low": 5.0, "high": 100.0, "ramped": False},
            {"path": K, "column": "tuning.slave.lever.wall_stiffness", "unit": "N m/rad",
             "when": "engaged", "value": 3.0, "low": 0.003, "high": 30.0, "ramped": True},
        ]  # fmt: skip
        assert (facts["desk"], facts["hardware"]) == (desk.address, ["master"])
        assert {one["path"] for one in facts["fixed"]} == {
            path for path, *_ in tunables(rig) if path not in (K, FILTER)
        }
        assert all(one["when"] == "between runs" for one in facts["fixed"])
        limit = next(x for x in facts["fixed"] if x["path"] == "slave.axes.lever.effort_limit")
        assert limit["value"] == rig.slave.axes["lever"].effort_limit
    finally:
        desk.close()
    assert tuning_facts(rig, None, []) is None


def test_a_set_out_of_its_range_is_left_as_a_whole() -> None:
    run = tuned(load_rig(BENCH), 0.3, {0.1: {K: 1.0, FILTER: 1e4}})
    assert run.changes == []
    assert run.notes == [f"refused: {FILTER} is 5 to 100 Hz"]
    assert set(run["tuning.slave.lever.wall_stiffness"]) == {3.0}
    assert set(run["tuning.generation"]) == {0.0}
    run = tuned(load_rig(BENCH), 0.3, {0.1: {K: float("nan")}})
    assert run.changes == []


def test_a_ceiling_falls_at_once_and_rises_when_nothing_is_clipped() -> None:
    limit = "slave.axes.lever.effort_limit"
    pushing = INTO.replace("-0.4", "0.3")  # the slave against what is in its way
    run = tuned(load_rig(BENCH, [pushing, *BARE]), 1.3, {0.8: {limit: 0.06}, 1.1: {limit: 1.1}})
    acts, sent = run["tuning.slave.lever.effort_ceiling"], run["slave.lever.commanded"]
    late = run["time_s"] > 1.02
    assert np.abs(sent[late]).max() <= 0.06 + 1e-12
    assert acts[-1] == pytest.approx(0.06)
    assert run.residual() < 1e-12


def test_values_that_change_nothing_change_no_bit() -> None:
    plain = tuned(load_rig(BENCH), 0.3, {})
    same = tuned(load_rig(BENCH), 0.3, {0.1: {K: 3.0}})
    assert (plain.notes, same.notes) == ([], ["unchanged"])
    for name, column in plain.columns.items():
        if name != "tuning.generation":
            assert np.array_equal(column, same[name], equal_nan=True), name


def test_a_filter_that_changes_sends_the_rest_of_its_wave() -> None:
    rig = load_rig(BENCH)
    old = end_constants(rig, "slave.lever", CommandDelay(0, 0.0))
    e = WaveEnd(filtered=0.5, gap=0.01)
    new = tune(old, e, "wave_filter_hz", 20.0, 1e-3)

    def rest(gain: float) -> float:
        """Sum what the filter still sends when nothing comes in any more."""
        y, total = 0.5, 0.0
        for _ in range(5000):
            y -= gain * y
            total += 1e-3 * y
        return total

    before = rest(old.port.filter_gain) + 0.01
    assert rest(new.port.filter_gain) + e.gap == pytest.approx(before, rel=1e-9)
    assert new.port.reserve == old.port.reserve
    assert new.port.leak == old.port.leak
    with pytest.raises(KeyError):
        tune(old, e, "wave_impedance", 0.1, 1e-3)


def test_a_filter_is_lowered_while_it_runs_and_the_books_close() -> None:
    run = tuned(load_rig(BENCH), 1.5, {1.0: {FILTER: 20.0}, 1.2: {FILTER: 100.0}})
    assert set(run["tuning.lever.wave_filter_hz"]) == {100.0, 20.0}
    assert run.residual() < 1e-12


@pytest.mark.slow
@pytest.mark.nightly
def test_a_compiled_controller_is_tuned_to_the_bit() -> None:
    pytest.importorskip("numba")
    ceiling = "slave.axes.lever.effort_limit"
    sets = {0.8: {K: 1.0, FILTER: 40.0}, 0.9: {ceiling: 0.06}, 1.2: {K: 2.0, FILTER: 100.0}}
    plain = tuned(load_rig(BENCH, [INTO]), 1.3, sets)
    machine = tuned(load_rig(BENCH, [INTO, "loop.engine=compiled"]), 1.3, sets)
    assert set(machine["tuning.generation"]) == {0.0, 1.0, 2.0, 3.0}
    assert machine.residual() < 1e-12
    for name, column in plain.columns.items():
        if name.split("_")[-1] not in ("us", "ns"):
            assert np.array_equal(column, machine[name], equal_nan=True), name


def test_a_wall_is_moved_only_while_nothing_is_coupled() -> None:
    at = "coupling.pairs.lever.wall_slave.position"
    run = tuned(load_rig(BENCH), 0.3, {0.1: {at: -0.2}})
    assert set(run["tuning.slave.lever.wall_position"]) == {-0.28}
    run = tuned(bench(), 0.3, {0.1: {at: -0.2}})  # idle
    assert set(run["tuning.slave.lever.wall_position"]) == {-0.28, -0.2}


WRITER = """
import sys
from tautwave.runtime.tuning.desk import leave
address = {"pid": int(sys.argv[1]), "descriptor": int(sys.argv[2])}
for k in range(int(sys.argv[3])):
    leave(address, [float(k)] * 20)
"""


def test_only_whole_sets_are_taken() -> None:
    desk = ParameterPage(20)
    assert desk.take() is None
    assert last_left(desk.address, 20) is None
    order = [sys.executable, "-c", WRITER]
    address = desk.address
    child = subprocess.Popen([*order, str(address["pid"]), str(address["descriptor"]), "1000"])
    seen = []
    while child.poll() is None:
        found = desk.take()
        if found is not None:
            assert len(set(found)) == 1
            seen.append(found[0])
    assert child.returncode == 0
    found = desk.take()
    seen += [] if found is None else [found[0]]
    assert seen == sorted(set(seen))
    assert seen[-1] == 999.0
    assert last_left(address, 20) == (999.0,) * 20
    # A writer that was killed in the middle: its half is not taken, the next whole set is.
    struct.pack_into("<Q", desk._memory, 0, desk.generation + 1)
    assert desk.take() is None
    leave(address, [7.0] * 20)
    assert desk.take() == [7.0] * 20
    desk.close()
    with pytest.raises(RecordingError, match="has ended"):
        leave(address, [0.0] * 20)


def open_desks() -> list[str]:
    names = [os.readlink(link) for link in Path("/proc/self/fd").iterdir() if link.is_symlink()]
    return [name for name in names if "tautwave-desk" in name]


def test_of_two_writers_one_waits_and_neither_keeps_the_desk_open() -> None:
    desk = ParameterPage(2)
    before = len(open_desks())
    held = os.open(f"/proc/self/fd/{desk.address['descriptor']}", os.O_RDWR)
    fcntl.flock(held, fcntl.LOCK_EX)
    second = threading.Thread(target=leave, args=(desk.address, [1.0, 2.0]))
    second.start()
    second.join(0.3)
    assert second.is_alive()
    assert desk.take() is None
    os.close(held)
    second.join()
    assert desk.take() == [1.0, 2.0]
    assert len(open_desks()) == before
    desk.close()


def rig_of(name: str, *overrides: str) -> Rig:
    return load_rig(Path(BENCH).parent / name, list(overrides))


LIMIT = "master.axes.stylus.effort_limit"
PRESSED = {0.15: {LIMIT: 1.0}, 0.35: {LIMIT: 20.0}}


@pytest.mark.slow
def test_a_scene_has_the_ceilings_of_its_axes_and_they_act() -> None:
    run = tuned(rig_of("scene-resonator.yaml"), 0.4, PRESSED)
    acts = run["tuning.master.stylus.effort_ceiling"]
    assert acts[0] == 20.0
    assert acts.min() == pytest.approx(1.0)
    sent = np.abs(run["master.stylus.commanded"])
    assert np.abs(run["scene.asked.stylus"]).max() > 2.0  # it would push harder
    assert np.all(sent[1:] <= acts[:-1] + 1e-12)


@pytest.mark.nightly
@pytest.mark.slow
def test_a_compiled_scene_takes_the_same_ceilings() -> None:
    rig = rig_of("scene-resonator.yaml")
    plain, compiled = (tuned(rig, 0.4, PRESSED, engine) for engine in ("python", "compiled"))
    for name in ("tuning.master.stylus.effort_ceiling", "master.stylus.commanded"):
        assert np.array_equal(plain[name], compiled[name])


def test_a_coupling_over_a_network_has_ceilings_and_walls_but_no_filter() -> None:
    limit, wall = "slave.axes.lever.effort_limit", "coupling.pairs.lever.wall_slave"
    rig = rig_of("network-loopback.yaml", f"{wall}={{position: -0.6, stiffness: 3, damping: 4e-4}}")
    run = tuned(rig, 0.6, {0.1: {limit: 0.06, f"{wall}.stiffness": 1.0}})
    assert run["tuning.slave.lever.effort_ceiling"][-1] == pytest.approx(0.06)
    assert run["tuning.slave.lever.wall_stiffness"][-1] == 1.0
    late = run["time_s"] > 0.35
    assert np.abs(run["slave.lever.commanded"][late]).max() <= 0.06 + 1e-12
    assert not any("wave_filter" in name for name in run.columns)


def test_a_site_tunes_its_own_devices_only() -> None:
    rig = rig_of("network-loopback.yaml", "sites.here=slave")
    knobs = {knob.path for knob in knobs_of(rig, build_rig(rig, clock="fake").control)}
    assert "slave.axes.lever.effort_limit" in knobs
    assert not any("master" in path for path, *_ in tunables(rig))
