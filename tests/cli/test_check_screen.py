"""`check` says on one screen what matters of any rig; the rest is behind `--verbose`."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from click.testing import Result

from tautwave.cli.terminal.screen import COLUMNS, LINES, axes_named, folded, spanned
from tautwave.config import load_rig
from tautwave.session import check

Cli = Callable[..., Result]
CONFIGS = Path(__file__).parents[2] / "configs"
SHIPPED = sorted(
    str(path.relative_to(CONFIGS))
    for path in [*CONFIGS.glob("*.yaml"), *CONFIGS.glob("arms/*.yaml")]
)
HEAVY = (
    "arms-loopback",
    "six-seven",
    "tissue",
    "three-bus",
    "planar",
    "scene",
    "dynamixel",
    "mixed",
    "bimanual",
)


def rigs() -> list:
    return [
        pytest.param(name, marks=pytest.mark.slow if any(one in name for one in HEAVY) else ())
        for name in SHIPPED
    ]


@pytest.mark.parametrize("name", rigs())
def test_every_shipped_rig_is_one_screen(tautwave_cli: Cli, name: str) -> None:
    done = tautwave_cli("check", CONFIGS / name)
    assert done.exit_code == 0, done.output
    lines = done.stdout.splitlines()
    assert len(lines) <= LINES == 24
    assert max(map(len, lines)) <= COLUMNS
    assert lines[-1] == f"  {load_rig(CONFIGS / name).name}: may run."
    assert any("(required)" in line for line in lines) or "bench-position" in name
    at = next((k for k, line in enumerate(lines) if line.startswith("  improve")), None)
    if at is not None:  # ends with what to do, a command or in words
        said = lines[at : lines.index("", at)]
        assert not said[-1].endswith("..."), said


@pytest.mark.slow
@pytest.mark.parametrize("name", [one for one in SHIPPED if not re.search("scene|tissue", one)])
def test_what_would_improve_a_rig_may_run(name: str) -> None:
    """The value that a line names leaves the rig certified, and the hint behind."""
    found = check(load_rig(CONFIGS / name), brief=True).improvement
    if found is None or not found.change:
        return
    better = check(load_rig(CONFIGS / name, [found.change]), brief=True)
    assert better.exit_code == 0, better.failures
    assert better.improvement is None or tuple(better.improvement) != tuple(found)


def test_what_matters_most_is_named_with_its_command(tautwave_cli: Cli) -> None:
    """A claim beyond the kinetic energy first, with the limit that brings it back."""
    rig = CONFIGS / "bench-1dof-2khz.yaml"
    done = tautwave_cli("check", rig, "--set", "loop.overrun_limit=40")
    [line] = [line for line in done.stdout.splitlines() if "--set " in line]
    value = int(line.rpartition("loop.overrun_limit=")[2])
    assert "improve" in done.stdout
    said = tautwave_cli("check", rig, "--set", f"loop.overrun_limit={value}").stdout
    assert "a stall gives" not in said
    known = json.loads(
        tautwave_cli("check", rig, "--set", "loop.overrun_limit=40", "--json").stdout
    )["improvement"]
    assert known["on"] == "hint on claims"
    assert known["set"] == f"loop.overrun_limit={value}"


def test_what_depends_on_a_person_is_said(tautwave_cli: Cli) -> None:
    done = tautwave_cli("check", CONFIGS / "epos4-pair.yaml")
    said = " ".join(done.stdout.split())
    assert "decide the inertia of master.lever" in said
    assert "assumed until identified (2 alike)" in said


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (["j1"], "j1"),
        (["j1", "j2"], "j1-j2"),
        ([f"j{n}" for n in range(1, 7)], "j1-j6"),
        (["j1", "j3"], "j1, j3"),
        (["x", "y", "z"], "x, y, z"),
        (["waist", "shoulder", "elbow", "forearm", "wrist"], "waist to wrist (5)"),
    ],
)
def test_names_of_alike_joints_are_one(names: list[str], said: str) -> None:
    assert spanned(names) == said


def test_alike_ends_are_named_once() -> None:
    assert axes_named(["master.j1", "master.j2"]) == "master.j1-j2"
    assert axes_named(["master.j1", "slave.j1"]) == "j1, both sides"
    assert axes_named(["master.j1", "slave.j2"]) == "master.j1, slave.j2"


def test_a_long_text_is_cut_at_its_last_line() -> None:
    text = "word " * 60
    lines = folded("label", text, 5, 2).splitlines()
    assert len(lines) == 2
    assert lines[1].endswith(" ...")
    assert max(map(len, lines)) <= COLUMNS - 9
    assert folded("label", "short", 5) == "short"


def test_what_an_older_run_said_is_on_a_screen_as_well(tautwave_cli: Cli, tmp_path: Path) -> None:
    """Keys that differ, each with the option that keeps it; no line is wider than a screen."""
    older = Path(__file__).parents[1] / "summary" / "older" / "e8d32118-wall.json"
    shutil.copy(older, tmp_path / "summary.json")
    rig = CONFIGS / "bench-stiff-wall-loopback.yaml"
    then = yaml.safe_load(rig.read_text())
    key = "coupling.pairs.lever.wall_slave.stiffness"
    then["coupling"]["pairs"]["lever"]["wall_slave"]["stiffness"] = 3.5
    then["coupling"]["wave_filter_hz"] = 50
    (tmp_path / "rig.yaml").write_text(yaml.safe_dump(then))
    lines = tautwave_cli("check", rig, "--against", tmp_path).stdout.splitlines()
    at = lines.index(f"  {key}: 3.5 then, 3.0 now")
    assert lines[at + 1] == f"    --set {key}=3.5"
    at = lines.index("  no key any more: coupling.wave_filter_hz")
    assert "tautwave new NEW.yaml --from RUN" in lines[at + 1]
    assert any(line.startswith("  new since (") for line in lines)
    paths = [line for line in lines if str(tmp_path) in line]
    assert max(len(line) for line in lines if line not in paths) <= COLUMNS
