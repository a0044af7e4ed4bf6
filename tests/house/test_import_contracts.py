"""The floors hold, and each contract of pyproject.toml notices when they do not."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("src/tautwave", "src/tautwave_scenes", "drivers/tautwave_drivers", "sim/tautwave_sim")
CONTRACTS = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"][
    "contracts"
]

# contract, module that gets the line, the line
PLANTED = [
    ("floors", "src/tautwave/laws/planted.py", "import tautwave.models"),
    ("floors", "src/tautwave/contracts.py", "import tautwave.registry"),
    ("floors", "src/tautwave/config/planted.py", "import tautwave.controller"),
    ("floors", "src/tautwave/controller/planted.py", "import tautwave.runtime"),
    ("floors", "src/tautwave/report/planted.py", "import tautwave.session"),
    ("floors", "src/tautwave/certificate/planted.py", "import tautwave.report"),
    ("floors", "src/tautwave/stray.py", "EXHAUSTIVE = True"),
    ("floors", "src/tautwave/formats.py", "import tautwave.files"),
    ("floors", "src/tautwave/wording.py", "import tautwave.registry"),
    ("floors", "src/tautwave/session/planted.py", "import tautwave.testing"),
    ("floors", "src/tautwave/canvas/planted.py", "import tautwave.simulation"),
    ("floors", "src/tautwave/sweep/planted.py", "import tautwave.certificate"),
    ("drivers", "drivers/tautwave_drivers/cia402/planted.py", "import tautwave_drivers.modbus"),
    ("drivers", "drivers/tautwave_drivers/dynamixel/planted.py", "import tautwave_drivers.canopen"),
    ("drivers", "drivers/tautwave_drivers/stray.py", "EXHAUSTIVE = True"),
    ("simulators", "sim/tautwave_sim/modbus/planted.py", "import tautwave_sim.canopen"),
    ("simulators", "sim/tautwave_sim/physics.py", "import tautwave_sim.axis"),
    ("rig-files", "src/tautwave/config/keys/planted.py", "import tautwave.config.checks"),
    ("rig-files", "src/tautwave/config/text/planted.py", "import tautwave.config.load"),
    ("scenes", "src/tautwave_scenes/networks/planted.py", "import tautwave_scenes.networks3d"),
    ("scenes", "src/tautwave_scenes/certificate/planted.py", "import tautwave_scenes.report"),
    ("scenes", "src/tautwave_scenes/stray.py", "EXHAUSTIVE = True"),
    (
        "networks",
        "src/tautwave_scenes/networks/schemes/planted.py",
        "import tautwave_scenes.networks.live",
    ),
    (
        "networks",
        "src/tautwave_scenes/networks/network.py",
        "import tautwave_scenes.networks.compiling",
    ),
    ("below-the-commands", "src/tautwave_scenes/bench/planted.py", "import tautwave.cli"),
    ("pure", "src/tautwave_scenes/models/planted.py", "import numpy"),
    ("live", "src/tautwave_scenes/runtime/planted.py", "import tautwave.config"),
    ("siblings", "src/tautwave_scenes/planted.py", "import tautwave_sim"),
    ("roads", "src/tautwave/rig/planted.py", "import tautwave_scenes"),
    ("mathematics", "src/tautwave/analysis/exact/planted.py", "import tautwave.analysis.walls"),
    ("mathematics", "src/tautwave/analysis/walls/planted.py", "import tautwave.analysis.maps"),
    (
        "parts",
        "src/tautwave/couplings/position/planted.py",
        "import tautwave.couplings.wave.keys",
    ),
    ("outside", "src/tautwave/testing/planted.py", "import tautwave.session"),
    ("pure", "src/tautwave/laws/planted.py", "import numpy"),
    ("pure", "src/tautwave/models/planted.py", "from time import monotonic_ns"),
    ("controller", "src/tautwave/controller/planted.py", "import tautwave.config"),
    ("controller", "src/tautwave/controller/planted.py", "def late():\n    import numpy"),
    ("floors", "src/tautwave/allowance/planted.py", "import tautwave.config"),
    ("floors", "src/tautwave/registry.py", "import tautwave.allowance"),
    ("allowance", "src/tautwave/allowance/planted.py", "import tautwave.laws"),
    ("allowance", "src/tautwave/allowance/planted.py", "import pydantic"),
    ("floors", "src/tautwave/link/planted.py", "import tautwave.controller"),
    ("link", "src/tautwave/link/planted.py", "import socket"),
    ("link", "src/tautwave/link/planted.py", "import tautwave.config"),
    ("live", "src/tautwave/runtime/planted.py", "import tautwave.analysis"),
    ("live", "src/tautwave/runtime/planted.py", "import tautwave.config"),
    ("live", "src/tautwave/runtime/planted.py", "def late():\n    import scipy.linalg"),
    ("floors", "src/tautwave/couplings/wave/planted.py", "import tautwave.runtime"),
    ("floors", "src/tautwave/couplings/wave/keys.py", "import tautwave.certificate"),
    ("couplings", "src/tautwave/certificate/planted.py", "import tautwave.couplings.wave.keys"),
    ("siblings", "sim/tautwave_sim/planted.py", "import tautwave_drivers"),
    ("siblings", "drivers/tautwave_drivers/planted.py", "import tautwave_sim"),
    ("plugins", "drivers/tautwave_drivers/planted.py", "import tautwave.runtime"),
    ("plugins", "sim/tautwave_sim/planted.py", "import tautwave.session"),
    ("roads", "src/tautwave/planted_registry.py", "import tautwave_sim"),
    ("roads", "src/tautwave/runtime/planted.py", "import serial"),
]

ROUNDS = 5
"""Violations planted together: a run of the linter takes a second."""


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """Return a copy of the packages with the contracts beside them."""
    ignore = shutil.ignore_patterns("__pycache__", "*.nbi", "*.nbc")
    for package in PACKAGES:
        shutil.copytree(ROOT / package, tmp_path / package, ignore=ignore)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


def broken_contracts(tree: Path) -> tuple[set[str], str]:
    """Names of the contracts that lint-imports calls broken, and all that it printed."""
    path = os.pathsep.join(str((tree / package).parent) for package in PACKAGES)
    done = subprocess.run(
        [
            sys.executable,
            "-c",
            "import sys; from importlinter.cli import lint_imports_command as main; main()",
            "--no-cache",
        ],
        cwd=tree,
        env=os.environ | {"PYTHONPATH": path, "NO_COLOR": "1", "COLUMNS": "200"},
        capture_output=True,
        text=True,
        check=False,
    )
    output = done.stdout + done.stderr
    assert "Traceback" not in output, output
    broken = set(re.findall(r"^(.+?) BROKEN\b", output, re.MULTILINE))
    assert bool(broken) == bool(done.returncode), output
    return broken, output


def test_the_tree_keeps_every_contract(tree: Path) -> None:
    broken, output = broken_contracts(tree)
    assert not broken, output
    assert f"{len(CONTRACTS)} kept, 0 broken" in output


def plant(tree: Path, module: str, line: str) -> None:
    planted = tree / module
    before = planted.read_text() if planted.exists() else ""
    planted.write_text(f"{before}\n{line}\n")


@pytest.mark.slow
def test_violations_planted_together_break_every_contract(tree: Path) -> None:
    for _, module, line in PLANTED:
        plant(tree, module, line)
    broken, output = broken_contracts(tree)
    assert broken == {entry["name"] for entry in CONTRACTS}, output


def section(output: str, contract: str) -> str:
    """What is printed of a contract that is broken."""
    name = next(entry["name"] for entry in CONTRACTS if entry["id"] == contract)
    return (
        output.partition("Broken contracts")[2].partition(f"\n{name}\n---")[2].partition("\n---")[0]
    )


@pytest.mark.slow
@pytest.mark.parametrize("turn", range(ROUNDS))
def test_a_planted_violation_breaks_its_contract(tree: Path, turn: int) -> None:
    planted = PLANTED[turn::ROUNDS]
    for _, module, line in planted:
        plant(tree, module, line)
    _, output = broken_contracts(tree)
    for contract, module, line in planted:
        name = ".".join(Path(module).with_suffix("").parts[1:])
        imported = re.search(r"(?:import|from) (tautwave[\w.]*|\w+)", line)
        chain = f"{name} -> {imported[1]}" if imported else name.rpartition(".")[2]
        assert chain in section(output, contract), f"{contract}: no {chain} in:\n{output}"


def test_every_contract_has_a_planted_violation() -> None:
    assert {entry["id"] for entry in CONTRACTS} == {contract for contract, _, _ in PLANTED}


def test_contributing_has_the_floors_as_they_are_checked() -> None:
    floors = next(entry["layers"] for entry in CONTRACTS if entry["id"] == "floors")
    text = (ROOT / "CONTRIBUTING.md").read_text().partition("## The floors")[2]
    shown = re.findall(r"^ {4}(\w+(?: \| \w+)*) {2,}", text.partition("\n## ")[0], re.MULTILINE)
    commands, *below = (layer.strip("()") for layer in floors)
    assert shown == ["tautwave_drivers | tautwave_sim", commands, "tautwave_scenes", *below]
