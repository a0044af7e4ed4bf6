"""A report says how exact a scene was: against its oracle, and at half and double the rate."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tautwave.config import Rig, load_rig, resolved_yaml
from tautwave.report import write_report
from tautwave.report.precision.oracle import measure_precision
from tautwave.report.run.complete import write_summary
from tautwave.report.run.loading import load_run
from tautwave.report.units import quantity
from tautwave.rig import build_rig
from tautwave.runtime.loop import Loop
from tautwave_scenes.report import inputs as scene_inputs
from tautwave_scenes.report import precision as precision_scene
from tautwave_scenes.report.precision_table import decibels, scene_sentences, scene_tables
from tests.report.synthetic import write_recording

CONFIGS = Path(__file__).parents[2] / "configs"


class Kept:
    """A sink that keeps every row."""

    def __init__(self, width: int) -> None:
        self.row = [0.0] * width
        self.rows: list[list[float]] = []

    def commit(self) -> None:
        self.rows.append(list(self.row))


def leave_run(directory: Path, name: str, seconds: float, *given: str, skip: int = 0) -> Path:
    """Run a shipped scene for a moment and write what it leaves behind."""
    rig = load_rig(CONFIGS / f"scene-{name}.yaml", [f"duration_s={seconds}", *given])
    return write_run(directory, rig, skip)


def write_run(directory: Path, rig: Rig, skip: int = 0) -> Path:
    built = build_rig(rig, clock="fake")
    sink = Kept(len(built.columns))
    Loop(built.clock, built.buses, built.control, built.sources, sink).run()
    data = np.array(sink.rows)[skip:]
    directory.mkdir(parents=True)
    (directory / "rig.yaml").write_text(resolved_yaml(rig))
    summary = {"rig": rig.name, "clock": "fake", "rate_hz": rig.rate_hz, "pairs": {}}
    (directory / "summary.json").write_text(json.dumps(summary))
    columns = dict(zip(built.columns, data.T, strict=True))
    write_recording(directory / "recording.mcap", columns)
    return directory


@pytest.fixture(autouse=True)
def plain(monkeypatch: pytest.MonkeyPatch) -> None:
    """Use plain Python, whatever lies in a cache."""
    monkeypatch.setattr(precision_scene, "is_kept", lambda scene3d: False)


@pytest.fixture(scope="module")
def resonator(tmp_path_factory: pytest.TempPathFactory) -> Path:
    given = "simulation.hand.stylus.reference.waypoints=[[0.0, 0.0], [0.03, 0.006], [0.06, 0.0]]"
    return leave_run(tmp_path_factory.mktemp("runs") / "one", "resonator", 0.12, given)


def facts_of(directory: Path) -> dict[str, Any]:
    run = load_run(directory)
    run.result = measure_precision(run)
    write_summary(run)
    found: dict[str, Any] = run.result.precision
    return found


@pytest.mark.slow
def test_a_scene_is_replayed_to_the_bit_and_sampling_is_its_error(resonator: Path) -> None:
    reported = facts_of(resonator)
    assert reported["kind"] == "scene"
    assert reported["replayed_equal"] is True
    assert reported["whole"] is True
    assert reported["oracle"]["scheme"] == "exact"
    # The port is held for a period: the nodes lag by half of one, first order in T.
    error, double = reported["oracle"]["position_rms"], reported["double"]["position_rms"]
    assert 0.3 < double / error < 0.7
    assert 0.8 < math.log2(reported["half"]["position_rms"] / double) < 1.2
    assert reported["doubt"]["position_rms"] < 0.02 * error
    assert reported["oracle"]["effort"] > reported["double"]["effort"] > 0.0
    assert reported["doubt"]["apart_s"] is None


@pytest.mark.slow
def test_rk4_is_held_against_the_moment_that_it_has_come_to(
    resonator: Path, tmp_path: Path
) -> None:
    """It carries the scene on to the sample, the others from it: a period, no error of its own."""
    given = "simulation.hand.stylus.reference.waypoints=[[0.0, 0.0], [0.03, 0.006], [0.06, 0.0]]"
    reported = facts_of(leave_run(tmp_path / "one", "resonator", 0.12, given, "scene.scheme=rk4"))
    assert reported["replayed_equal"] is True
    held = facts_of(resonator)["oracle"]["position_rms"]
    for name in ("oracle", "half", "double"):
        assert reported[name]["position_rms"] < 0.05 * held


@pytest.mark.slow
def test_the_report_says_so(resonator: Path) -> None:
    facts_of(resonator)
    write_report(resonator)
    page = (resonator / "report.html").read_text()
    assert "reproduces the recorded efforts bit for bit" in page
    assert "error of this run" in page
    assert "uncertainty of the oracle" in page
    assert "Not computed" not in page


@pytest.mark.slow
def test_a_change_of_the_recording_is_found(resonator: Path) -> None:
    run = load_run(resonator)
    rig = load_rig(resonator / "rig.yaml")
    stiffer = rig.model_copy(
        update={
            "scene": rig.scene.model_copy(  # type: ignore[union-attr]
                update={
                    "ports": {
                        "stylus": rig.scene.ports["stylus"].model_copy(  # type: ignore[union-attr]
                            update={"stiffness": 3001.0}
                        )
                    }
                }
            )
        }
    )
    reported = precision_scene.scene_precision(run, stiffer)
    assert reported["replayed_equal"] is False
    assert "differs from the recorded efforts by" in " ".join(scene_sentences(reported))


@pytest.mark.slow
def test_little_time_is_spent_where_the_scene_is_felt(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    waypoints = "[[0.0, 0.0], [0.06, 0.0], [0.1, -0.02]]"
    given = f"simulation.hand.stick.reference.waypoints={waypoints}"
    directory = leave_run(tmp_path / "drum", "drum", 0.1, given)
    monkeypatch.setitem(precision_scene.SECONDS, "python", 1.0)
    monkeypatch.setattr(precision_scene, "base_run", hasty(precision_scene.base_run))
    reported = facts_of(directory)
    assert reported["whole"] is False
    assert reported["replayed_equal"] is True
    assert reported["begins_s"] > 0.03  # nothing was touched before
    assert reported["effort"] > 0.01
    assert reported["oracle"]["effort"] > 0.0
    assert reported["oracle"]["scheme"] == "discrete_gradient"
    words = " ".join(scene_sentences(reported))
    assert "where it is felt first" in words
    assert "not in the cache" in words


def hasty(made: Any) -> Any:
    """Let every step of the base run count as 1 ms, so that the machine's speed does not."""

    def base(*given: Any) -> Any:
        played, states = made(*given[:3], 60.0)
        return played._replace(cpu_s=1e-4 * len(played.efforts)), states

    return base


def test_a_string_keeps_its_pitch_at_every_rate() -> None:
    [(name, pitch)] = precision_scene.pitches_of(load_rig(CONFIGS / "scene-string.yaml")).items()
    assert name == "string"
    asked = pitch.pop("asked_hz")
    assert asked == 196.0
    assert len(pitch) >= 3
    assert pitch == {rate: pytest.approx(asked, rel=0.01) for rate in pitch}


@pytest.mark.slow
def test_the_pitch_of_a_string_is_reported(tmp_path: Path) -> None:
    directory = leave_run(tmp_path / "string", "string", 0.1)
    reported = facts_of(directory)
    assert reported["replayed_equal"] is True
    pitch = reported["strings"]["string"]
    assert pitch["asked_hz"] == 196.0
    assert pitch["own"] == pytest.approx(196.0, rel=0.01)
    (_, pitches) = scene_tables(reported)
    assert pitches.rows[0][1] == "196 Hz"


def test_samples_before_the_scene_began_are_passed_over(tmp_path: Path) -> None:
    """A hand that leans on the coupling spring keeps the scene from starting."""
    rig = load_rig(CONFIGS / "scene-resonator.yaml", ["duration_s=0.05"])
    stage = scene_inputs.stage_of(rig)
    ports = np.array([[1.0], [1.0], [0.0], [1.0]])
    seen = np.array([[True], [True], [False], [True]])
    assert scene_inputs.armed_row(rig, stage, ports, seen) is None
    ports[1] = 1e-6
    assert scene_inputs.armed_row(rig, stage, ports, seen) == 1


def test_slots_that_were_skipped_are_made_up(tmp_path: Path) -> None:
    faults = "simulation.faults={overrun_probability: 0.05, overrun_slots: 2}"
    directory = leave_run(tmp_path / "late", "resonator", 0.08, faults, "loop.overrun_limit=10")
    reported = facts_of(directory)
    assert reported["replayed_equal"] is True
    assert load_run(directory).read("skipped_slots")["skipped_slots"].sum() > 0
    assert reported["span_s"] == pytest.approx(0.08, abs=1e-3)


@pytest.mark.slow
def test_a_scene_in_space_is_replayed_alike(tmp_path: Path) -> None:
    moved = "simulation.hand.up.reference.waypoints=[[0.0, 0.0], [0.05, -0.03]]"
    directory = leave_run(tmp_path / "net", "net", 0.06, moved)
    reported = facts_of(directory)
    assert reported["replayed_equal"] is True
    assert reported["scheme"] == reported["oracle"]["scheme"] == "symplectic"
    assert reported["effort"] > 0.0
    assert 0.0 < reported["doubt"]["position_rms"] < 0.5 * reported["oracle"]["position_rms"]
    assert reported["double"]["position_rms"] < reported["half"]["position_rms"]
    words = " ".join(scene_sentences({**reported, "whole": False, "engine": "python"}))
    assert "A run with `scene.engine: compiled` puts them there" in words


def test_a_thousandth_of_a_decibel_is_nothing() -> None:
    assert decibels(-1e-4) == "0 dB"
    assert decibels(-0.73) == "\N{MINUS SIGN}0.730 dB"


@pytest.mark.slow
def test_samples_that_were_lost_leave_the_port_where_it_was(tmp_path: Path) -> None:
    faults = "simulation.faults={missing_probability: 0.05}"
    directory = leave_run(tmp_path / "lost", "resonator", 0.08, faults, "loop.missing_limit=10")
    assert facts_of(directory)["replayed_equal"] is True


def test_without_positions_it_says_so(resonator: Path) -> None:
    run = load_run(resonator)
    run.columns = tuple(name for name in run.columns if name != "master.stylus.position")
    rig = load_rig(resonator / "rig.yaml")
    assert "not recorded" in precision_scene.scene_precision(run, rig)["error"]


def test_runs_that_part_are_explained_by_what_makes_them() -> None:
    part = {"position_rms": 1e-3, "effort": 1.0, "effort_rms": 0.1, "level_db": 0.1}
    reported: dict[str, Any] = {
        "travel": 0.01,
        "effort": 2.0,
        "doubt": {**part, "position_rms": 1e-5},
    }
    reported["oracle"] = {**part, "apart_s": 0.4, "scheme": "discrete_gradient"}
    [table] = scene_tables(reported)
    assert "contacts met again" in table.note
    assert table.rows[0][-1] == quantity(0.4, "s", 3)
    reported["oracle"]["scheme"] = "exact"  # linear: nothing doubles there
    [table] = scene_tables(reported)
    assert "a tenth of their travel" in table.note
    assert "contacts" not in table.note
    assert "the oracle's own uncertainty" not in table.note
    assert "of its samples" not in table.note
    [table] = scene_tables({**reported, "scheme": "rk4"})
    assert "half a period's change of the effort counts as error" in table.note
    reported["doubt"]["position_rms"] = 9e-4
    [table] = scene_tables(reported)
    assert "the oracle's own uncertainty" in table.note
