"""`bench workprecision RIG` and `bench extremes RIG`: a rig of one's own, a scene, refusals."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from click.testing import CliRunner

from tautwave.bench import extremes
from tautwave.bench.precision import rigs, suite
from tautwave.bench.precision.points import Point, Scene
from tautwave.cli import main
from tautwave.config import load_rig
from tautwave.config.shipped import find_example
from tautwave.errors import ConfigError
from tautwave.simulation.kernel.pack import pack_rig

SIMULATED = (
    "bench-1dof-loopback", "bench-2axis-loopback", "bench-admittance-loopback",
    pytest.param("network-loopback", marks=pytest.mark.slow),
    "bench-position-coupling", "bench-multirate-loopback", "bench-canopen-virtual",
    "scene-resonator", "scene-granular", "scene-net",
)  # fmt: skip


def path_of(name: str) -> Path:
    return find_example(f"{name}.yaml").path


@pytest.mark.parametrize("name", SIMULATED)
def test_every_change_of_a_group_is_a_key_of_the_rig(name: str) -> None:
    path = path_of(name)
    groups = list(extremes.groups(load_rig(path)))
    assert len(groups) >= 7
    for group in groups:
        assert group.rigs, group.name
        for changes in group.rigs:
            assert changes, group.name
            said = ""
            try:
                load_rig(path, changes)
            except ConfigError as err:
                said = str(err)
            assert "unknown key" not in said, (group.name, changes)
            assert "required key" not in said, (group.name, changes)


def test_a_figure_that_is_not_finite_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    path = path_of("bench-1dof-loopback")
    made = extremes.simulate(load_rig(path), duration_s=0.01, engine="python")
    made.data[3, made.columns.index("master.lever.velocity")] = math.nan
    monkeypatch.setattr(extremes, "simulate", lambda *_, **__: made)
    found = extremes.try_rig(path, (), duration_s=0.01, engine="python")
    assert (found.end, found.not_finite) == ("finished", 1)


@pytest.mark.parametrize("scale", ["1", "2"])
def test_the_books_of_a_scaled_rig_close(scale: str) -> None:
    scaled = (
        f"coupling.pairs.lever.position_scale={scale}",
        "simulation.hand.lever.reference={type: minimum_jerk, "
        "waypoints: [[0.0, 0.0], [0.1, 0.1], [0.2, 0.0]]}",
    )
    path = path_of("bench-1dof-2khz")
    found = extremes.try_rig(path, scaled, duration_s=0.3, engine="python")
    assert found.end == "finished", found.why
    assert found.residual < 1e-12


def test_two_groups_as_a_command(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    group = extremes.Group("one", (("coupling.delay_s=0.5",), ("coupling.delay_s=-1",)))
    monkeypatch.setattr(extremes, "groups", lambda _: iter([group]))
    monkeypatch.setattr(extremes, "has_numba", lambda: False)
    words = ("bench", "extremes", str(path_of("bench-1dof-2khz")), "--duration", "0.05")
    done = CliRunner().invoke(main, [*words, "--json", "--out", str(tmp_path / "out")])
    assert done.exit_code == 0, done.output
    rows = json.loads(done.stdout)["tables"][0]["rows"]
    assert (rows[0]["finished"], rows[0]["refused"]) == (1, 1)
    reasons = (tmp_path / "out" / "extremes-rigs-that-were-refused-or-stopped.csv").read_text()
    assert "--set coupling.delay_s=-1" in reasons


@pytest.mark.parametrize("command", ["workprecision", "extremes"])
def test_what_cannot_be_measured_is_one_sentence(command: str, tmp_path: Path) -> None:
    rig = tmp_path / "rig.yaml"
    whole = path_of("bench-1dof-loopback").read_text()
    rig.write_text(whole.partition("\nsimulation:")[0])
    done = CliRunner().invoke(main, ["bench", command, str(rig)])
    assert done.exit_code == 2
    assert done.stderr.startswith(str(rig))
    assert len(done.stderr.splitlines()) == 1


def test_a_part_beyond_the_end_of_a_scene_is_refused() -> None:
    words = ("bench", "workprecision", str(path_of("scene-resonator")), "--begin", "1e4")
    done = CliRunner().invoke(main, words)
    assert done.exit_code == 2
    assert "--begin 10000" in done.stderr


def test_errors_are_those_of_what_follows_and_energy_of_all_devices() -> None:
    path = path_of("bench-2axis-loopback")
    job = pack_rig(rigs.RigScene("two", path).load(), 0.05)
    assert rigs._followed(job) == ["true.slave.wrist.position", "true.slave.slide.position"]
    scene = pack_rig(load_rig(path_of("bench-admittance-loopback")), 0.05)
    assert any(device.kind in rigs.MOVED for device in scene.devices)


def test_a_table_marks_front_and_chosen_point() -> None:
    points = tuple(Point("x", "rk4", 1e-3 / n, 1e-2 / n**4, math.nan, 1e-3 * n) for n in (1, 2, 4))
    slow = Point("x", "symplectic_euler", 1e-3, 1e-1, 1e-3, 5e-3)
    chosen = points[1]._replace(error=3e-4)
    table = suite.scene_table(Scene("x", "what", (*points, slow), chosen, "why"), 1e-4)
    assert [row[-1] for row in table.rows] == ["front", "front", "front", "", "NOT <= 0.0001"]
    assert table.rows[0][4] is None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "more"),
    [
        ("bench-2axis-loopback", ("--set", "duration_s=1")),
        ("scene-resonator", ("--begin", "0.2")),
    ],
)
def test_a_smaller_error_costs_time(name: str, more: tuple[str, ...], tmp_path: Path) -> None:
    pytest.importorskip("numba")
    words = ("bench", "workprecision", str(path_of(name)), "--out", str(tmp_path / "wp"))
    done = CliRunner().invoke(main, [*words, *more, "--json"])
    assert done.exit_code == 0, done.output
    (table,) = json.loads(done.stdout)["tables"]
    rows = [row for row in table["rows"] if row["method"] == "rk4"]
    assert rows[0]["error"] > 1e2 * rows[-1]["error"]
    assert rows[0]["step"] > rows[-1]["step"]
    assert table["rows"][-1]["method"].startswith("chosen: ")
    assert (tmp_path / "wp" / "workprecision.png").stat().st_size > 10_000
