"""Map files: mistakes with their lines, tables, the command and its picture."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from tautwave.cli import main
from tautwave.errors import ConfigError
from tautwave.sweep.map import is_map, load_map, operating_value, run_map

ROOT = Path(__file__).parents[2]
SWEEPS = ROOT / "configs/sweeps"

GOOD = f"""\
name: small
rig: {ROOT}/configs/bench-1dof-loopback.yaml
axis: master.lever
planes:
  now:
    x: wall_damping
    label: "B [mN m s/rad]"
    factor: 1000
    values: {{low: 1.0e-5, high: 0.01, points: 6}}
    stiffness: {{low: 0.1, high: 300, points: 12}}
  late:
    x: period_s
    label: T [ms]
    delay_periods: 1
    values: {{low: 1.0e-4, high: 0.01, points: 5}}
    stiffness: {{low: 0.1, high: 3000, points: 12}}
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "map.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_what_is_a_map(tmp_path: Path) -> None:
    assert is_map(written(tmp_path, GOOD))
    assert not is_map(SWEEPS / "delay-stability.yaml")
    assert not is_map(tmp_path / "nothing.yaml")


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("master.lever", "master.arm", "map.yaml:3: axis: unknown axis 'master.arm'"),
        ("high: 300,", "high: 0.01,", "planes.now.stiffness.high: Input should be greater than"),
        ("low: 1.0e-4", "low: 0", "planes.late.values.low: Input should be greater than 0"),
        ("x: period_s", "x: colour", "map.yaml:12: planes.late.x"),
        ("factor: 1000", "faktor: 1000", "faktor"),
        ("points: 6", "points: 1", "planes.now.values.points"),
    ],
)
def test_mistakes_are_reported_with_their_place(
    tmp_path: Path, old: str, new: str, sentence: str
) -> None:
    with pytest.raises(ConfigError) as caught:
        load_map(written(tmp_path, GOOD.replace(old, new, 1)))
    assert any(sentence in problem for problem in caught.value.problems), caught.value.problems


def test_a_rig_without_simulation_is_refused(tmp_path: Path) -> None:
    text = (ROOT / "configs/bench-1dof-loopback.yaml").read_text(encoding="utf-8")
    (tmp_path / "bare.yaml").write_text(text[: text.index("\nsimulation:")], encoding="utf-8")
    bare = GOOD.replace(f"{ROOT}/configs/bench-1dof-loopback.yaml", "bare.yaml")
    with pytest.raises(ConfigError, match="simulat"):
        load_map(written(tmp_path, bare))


def test_tables_hold_every_point(tmp_path: Path) -> None:
    plan = load_map(written(tmp_path, GOOD))
    result = run_map(plan, tmp_path / "out")
    with result.points.open(encoding="utf-8") as file:
        points = list(csv.DictReader(file))
    assert len(points) == 6 * 12 + 5 * 12
    assert all(row["stable"] == row["predicted_stable"] for row in points)
    with result.boundaries.open(encoding="utf-8") as file:
        limits = list(csv.DictReader(file))
    assert len(limits) == 11
    # 2 mN m s/rad without the hand: K T / 2 + B
    assert float(limits[0]["passive"]) == pytest.approx((2e-3 - 1e-5) * 2000, rel=1e-6)
    assert float(limits[0]["stable"]) == pytest.approx(float(limits[0]["simulated"]), rel=1e-6)
    start = plan.starts["now"]
    assert start.wall.stiffness == 3.0
    assert operating_value(start, plan.file.planes["now"]) == 4e-4
    assert plan.starts["late"].wall.delay == 1.0


@pytest.mark.slow
def test_the_command_draws_and_says_how_far_they_agree(tmp_path: Path) -> None:
    path, out = written(tmp_path, GOOD), tmp_path / "out"
    run = CliRunner().invoke(main, ["sweep", str(path), "--out", str(out), "--json"])
    assert run.exit_code == 0, run.output
    reported = json.loads(run.stdout)
    assert reported["planes"]["now"]["mismatched"] == 0
    assert reported["planes"]["late"]["disagreement"] < 1e-6
    assert Path(reported["figure"]).read_bytes().startswith(b"\x89PNG")
    plain = CliRunner().invoke(main, ["sweep", str(path), "--out", str(out)])
    assert "differ at 0 of 72 points" in plain.stdout


QUANTISED = f"""\
name: steps
rig: {ROOT}/configs/bench-1dof-loopback.yaml
axis: master.lever
planes:
  quantum:
    x: quantum
    label: Q [rad]
    wall_damping: 0
    values: {{low: 1.0e-5, high: 0.1, points: 6}}
    stiffness: {{low: 0.01, high: 300, points: 12}}
"""


@pytest.mark.slow
def test_a_plane_over_the_encoders_step(tmp_path: Path) -> None:
    path, out = written(tmp_path, QUANTISED), tmp_path / "out"
    plan = load_map(path)
    assert operating_value(plan.starts["quantum"], plan.file.planes["quantum"]) == 2.094e-5
    run = CliRunner().invoke(main, ["sweep", str(path), "--out", str(out), "--json"])
    assert run.exit_code == 0, run.output
    reported = json.loads(run.stdout)
    assert reported["planes"]["quantum"]["mismatched"] == 0
    assert reported["planes"]["quantum"]["boundaries"] == 6
    assert reported["planes"]["quantum"]["disagreement"] < 0.01
    with Path(reported["table"]).open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            assert row["growth_per_period"] == ""
            assert (float(row["gain_per_cycle"]) <= 1.0) == (row["predicted_stable"] == "1")
    with Path(reported["boundaries"]).open(encoding="utf-8") as file:
        limits = [float(row["passive"]) for row in csv.DictReader(file)]
    assert limits[0] == pytest.approx(4.0)  # 2 b / T
    assert limits[-1] == pytest.approx(2.0 * 1e-3 / 0.1)  # 2 c / Q


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("    wall_damping: 0\n", "", "set wall_damping: 0 here"),
        ("wall_damping: 0", "{wall_damping: 0, delay_periods: 1}", "set delay_periods: 0 here"),
        ("low: 1.0e-5", "low: 0", "greater than 0"),
    ],
)
def test_what_the_quantised_limit_does_not_know(
    tmp_path: Path, old: str, new: str, sentence: str
) -> None:
    new = new.strip("{}").replace(", ", "\n    ")
    with pytest.raises(ConfigError, match=sentence):
        load_map(written(tmp_path, QUANTISED.replace(old, new)))


@pytest.mark.parametrize("name", ["wall-kb-plane.yaml", "wall-limits.yaml", "wall-quantum.yaml"])
def test_shipped_maps_are_right(name: str) -> None:
    assert len(load_map(SWEEPS / name).file.planes) in (2, 4)
