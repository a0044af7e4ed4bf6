"""`tautwave check` on a screen: short, the verdict last, tables that stay tables."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from click.testing import Result

from tautwave.cli.terminal.screen import LINES
from tautwave.cli.terminal.show import plain_lines
from tautwave.tables import Table

Cli = Callable[..., Result]
CONFIGS = Path(__file__).parents[2] / "configs"
RIG = CONFIGS / "bench-1dof-loopback.yaml"


@pytest.fixture
def six(tmp_path: Path) -> Path:
    """The README's rig six times over, each pair with a bus of its own."""
    keys = yaml.safe_load(RIG.read_text())
    coupling, simulation = keys["coupling"], keys["simulation"]
    blocks = [keys["master"]["axes"], keys["slave"]["axes"], coupling["pairs"]]
    blocks += [simulation["hand"], simulation["environment"]]
    keys["buses"] = {f"bus{n}": {"driver": "loopback"} for n in range(6)}
    simulation.pop("axes", None)
    for block in blocks:
        like = block.pop("lever", None)
        block.update({f"joint{n}": yaml.safe_load(yaml.safe_dump(like)) for n in range(6)})
    for n in range(6):
        for at, side in enumerate(("master", "slave")):
            keys[side]["axes"][f"joint{n}"].update({"bus": f"bus{n}", "id": at + 1})
    path = tmp_path / "six.yaml"
    path.write_text(yaml.safe_dump(keys, sort_keys=False))
    return path


def test_six_pairs_fit_on_a_screen_and_the_verdict_is_last(tautwave_cli: Cli, six: Path) -> None:
    done = tautwave_cli("check", six)
    assert done.exit_code == 0, done.output
    lines = done.stdout.splitlines()
    assert len(lines) <= LINES
    assert max(map(len, lines)) <= 80
    assert lines[-1] == "  bench-1dof: may run."
    for alike in ("  bus bus0-bus5 ", "  pair joint0-joint5 ", "  joint0-joint5, both sides "):
        assert [line.startswith(alike) for line in lines].count(True) == 1


def test_each_port_has_its_claim_beside_its_kinetic_energy(tautwave_cli: Cli) -> None:
    rig = CONFIGS / "bench-1dof-2khz.yaml"
    found = json.loads(tautwave_cli("check", rig, "--json").stdout)["claims"]["master.lever"]
    assert found["kinetic_j"] == pytest.approx(0.5 * 1.584e-3 * 15.0**2)
    assert found["ratio"] == pytest.approx(found["claim_j"] / found["kinetic_j"])
    numbers = {
        key: f"{1e3 * found[f'{key}_j']:.3g}" for key in ("prompt", "stall", "let_go", "kinetic")
    }
    done = tautwave_cli("check", rig)
    assert done.exit_code == 0, done.output
    [short] = [line.split() for line in done.stdout.splitlines() if "lever, both sides" in line]
    assert [one for one in short if one in numbers.values()] == [
        numbers["prompt"],
        numbers["let_go"],
    ]
    assert short[-1] == found["judged"] == "passed"
    said = tautwave_cli("check", rig, "--verbose").stdout.splitlines()
    rows = [line.split() for line in said[said.index("Claims") :]]
    at = next(at for at, row in enumerate(rows) if row[:2] == ["port", "prompt"])
    assert [row[0] for row in rows[at + 1 : at + 3]] == ["master.lever", "slave.lever"]
    assert [one for one in rows[at + 1] if one in numbers.values()] == list(numbers.values())
    assert rows[at + 1][3:5] == [f"{1e3 * found['gap_s']:.3g}", "ms"]
    longer = tautwave_cli("check", rig, "--set", "loop.overrun_limit=40").stdout
    assert any(line.split()[-1] == "depends" for line in longer.splitlines() if "lever, b" in line)


@pytest.mark.slow
@pytest.mark.parametrize("rig", ["three-bus-sim", "bench-mixed-sim", "xm430-pair", "scene-drum"])
def test_what_is_said_of_the_buses_fits_on_a_screen(tautwave_cli: Cli, rig: str) -> None:
    done = tautwave_cli("check", CONFIGS / f"{rig}.yaml")
    assert done.exit_code == 0, done.output
    assert max(map(len, done.stdout.splitlines())) <= 80


@pytest.mark.slow
def test_check_names_the_scheme_that_auto_takes(tautwave_cli: Cli) -> None:
    said = tautwave_cli("check", CONFIGS / "scene-drum.yaml", "--set", "scene.scheme=auto").stdout
    assert "touch a scene, scheme rk4 (auto)" in said


def test_each_thing_that_fails_is_one_line_at_the_end(tautwave_cli: Cli, six: Path) -> None:
    stiff = [f"coupling.pairs.joint{n}.wall_slave.stiffness=900" for n in (1, 4)]
    done = tautwave_cli("check", six, "--set", stiff[0], "--set", stiff[1])
    assert done.exit_code == 3
    lines = done.stdout.splitlines()
    assert len(lines) <= LINES + 2
    assert lines[-1].endswith("may not run: not certified as required (exit code 3).")
    for line, n in zip(lines[-5:-1:2], (1, 4), strict=True):
        assert "wall" in line
        assert "K = 900 N m/rad is" in line
        assert f"joint{n}" in line
    assert "--verbose shows all" in lines[-6]


def test_verbose_holds_the_rest(tautwave_cli: Cli, six: Path) -> None:
    reported = tautwave_cli("check", six, "--verbose").stdout
    assert len(reported.splitlines()) > 100
    assert "matching damper of master.joint3" in reported
    assert reported.splitlines()[-1] == "  bench-1dof: may run."


@pytest.mark.slow
def test_out_shows_what_the_rig_can_show_a_hand(tautwave_cli: Cli, tmp_path: Path) -> None:
    stiff = "coupling.pairs.lever.wall_slave.stiffness=40"
    done = tautwave_cli("check", RIG, "--set", stiff, "--verbose", "--out", "kept")
    assert done.exit_code == 3
    reported = (tmp_path / "kept/check.txt").read_text()
    *body, _, failure, last = done.stdout.splitlines()
    assert reported.startswith("\n".join(body[:-1]))
    assert reported.splitlines()[-2:] == [failure, last]
    found = json.loads((tmp_path / "kept/check.json").read_text())["haptics"]
    assert set(found["z_width"]) == {"master.lever", "slave.lever"}
    assert found["z_width"]["slave.lever"]["passive_stiffness"] == pytest.approx(4.0)  # 2 b / T
    assert found["transparency"]["lever"]["llewellyn"]["stable"] is True
    cycle = found["limit_cycles"]["slave wall"]
    for key, rel in (("depth", 0.03), ("frequency", 0.03), ("height", 0.06)):
        assert cycle["predicted"][key] == pytest.approx(cycle["simulated"][key], rel=rel)
    for heading in ("Stiffest wall", "Felt by the hand", "Limit cycles"):
        assert f"\n{heading}\n" in reported
    for name in ("certificate", "z-width", "transparency", "limit-cycle"):
        assert (tmp_path / f"kept/{name}.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_a_bus_that_is_too_slow_is_said_at_the_end(tautwave_cli: Cli) -> None:
    rig = CONFIGS / "bench-dynamixel-sim.yaml"
    done = tautwave_cli("check", rig, "--set", "rate_hz=2000", "--set", "coupling.delay_s=0")
    assert done.exit_code == 4, done.output
    *_, why, last = done.stdout.splitlines()
    assert why.startswith("  bus ")
    assert "do not fit in 0.500 ms" in why
    assert last.endswith("may not run: rate too high for a bus (exit code 4).")


def test_lines_of_a_cell_stay_in_its_column() -> None:
    table = Table(
        "Bus time", ("bus", ">needed", ""), [("can", "1 ms", "SYNC\nsum"), ("b", "2", "")]
    )
    assert list(plain_lines(table)) == [
        "Bus time",
        "  bus  needed",
        "  can    1 ms  SYNC",
        "               sum",
        "  b         2",
    ]
