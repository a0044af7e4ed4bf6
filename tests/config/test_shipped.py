"""The rigs in `configs/`: they load, say what they show, and stay within what is passive."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tautwave.config import Pair, Rig, load, load_rig, simulation_of
from tautwave.config.pieces import Parts, pieces_of, take_apart
from tautwave.config.text.document import Document
from tautwave.errors import ConfigError

CONFIGS = sorted((Path(__file__).parents[2] / "configs").glob("*.yaml"))
pytestmark = pytest.mark.installed


@pytest.fixture(params=CONFIGS, ids=lambda path: path.stem)
def path(request: pytest.FixtureRequest) -> Path:
    found: Path = request.param
    return found


@pytest.fixture
def rig(path: Path) -> Rig:
    return load_rig(path)


def test_they_are_there() -> None:
    assert {path.stem for path in CONFIGS} >= {
        "bench-1dof-loopback", "bench-1dof-2khz", "bench-2axis-loopback",
        "bench-admittance-loopback", "bench-foam-loopback", "bench-stiff-wall-loopback",
        "bench-position-coupling", "bench-saturation-loopback", "bench-gripper-loopback",
    }  # fmt: skip


def test_the_first_line_says_what_it_shows(path: Path) -> None:
    first = path.read_text().splitlines()[0]
    assert first.startswith("# ")
    assert len(first) > 40


def _named(name: str) -> Any:
    return pytest.param(name, marks=() if name in FEW else pytest.mark.slow)


FEW = ("bench-foam-loopback", "network-loopback", "scene-net")


@pytest.mark.parametrize("name", [_named(path.stem) for path in CONFIGS])
def test_the_pieces_of_a_valid_rig_are_those_of_its_document(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is not valid is taken apart block by block, and checked by the same rules."""
    both: list[tuple[Parts, Parts]] = []

    def pieces(rig: Rig, document: Document, plugins: Any) -> Parts:
        both.append((pieces_of(rig, document, plugins), take_apart(document, plugins)))
        return both[-1][0]

    monkeypatch.setattr(load, "pieces_of", pieces)
    load_rig(CONFIGS[0].with_name(f"{name}.yaml"), choose=False)
    ((whole, apart),) = both
    if whole.coupling is not None:
        whole = whole._replace(coupling=whole.coupling.model_copy(update={"pairs": {}}))
    for one, other in zip(whole, apart, strict=True):
        assert one == other
        assert repr(one) == repr(other)  # their kinds and order too


def test_belief_is_a_lower_bound_of_the_truth(rig: Rig) -> None:
    for name, axis in rig.axes.items():
        if axis.inertia is not None:
            truth = simulation_of(rig, name)
            assert 0.5 <= axis.inertia.lower / axis.inertia.value <= 0.8
            assert axis.inertia.lower <= truth.inertia <= 2.0 * axis.inertia.value
            assert axis.damping.lower <= truth.damping <= 2.0 * axis.damping.value


def test_the_truth_is_not_the_belief(rig: Rig) -> None:
    assert rig.simulation is None or any(
        axis.inertia is not None and simulation_of(rig, name).inertia != axis.inertia.value
        for name, axis in rig.axes.items()
    )


def test_local_walls_are_passive(rig: Rig) -> None:
    """Colgate and Schenkel: b > K T / 2 + |B|, counted on the damping that is certain."""
    for name, pair in rig.coupling.pairs.items():
        for axis, wall in _walls(rig, name, pair):
            assert axis.damping.lower > wall.stiffness * rig.period_s / 2.0 + wall.damping


def _walls(rig: Rig, name: str, pair: Pair):  # type: ignore[no-untyped-def]
    for side, wall in ((rig.master, pair.wall_master), (rig.slave, pair.wall_slave)):
        if wall is not None:
            yield side.axes[name], wall


def test_recorded_hand_replaces_the_reference(tmp_path: Path) -> None:
    (tmp_path / "hand.csv").write_text("time_s,hand_reference\n0.0,0.0\n0.0005,0.1\n")
    reference = f"{{type: recording, file: {tmp_path}/hand.csv, column: hand_reference}}"
    [bench] = [path for path in CONFIGS if path.stem == "bench-1dof-2khz"]
    rig = load_rig(bench, [f"simulation.hand.lever.reference={reference}"])
    assert rig.simulation is not None
    assert rig.simulation.hand["lever"].reference.type == "recording"
    for environment in [line for line in bench.read_text().splitlines() if "--set 'sim" in line]:
        argument = environment.split("'")[1]
        if "recording" not in argument:
            load_rig(bench, [argument])


HEAVY = (
    "scipy", "numba", "matplotlib", "can", "canopen", "pymodbus", "dynamixel_sdk", "asyncio",
)  # fmt: skip


@pytest.mark.parametrize(
    ("action", "heavy"),
    [("pass", ("numpy", *HEAVY)), ("tautwave.config.load_rig(sys.argv[1])", HEAVY)],
    ids=["import", "load"],
)
def test_nothing_heavy_is_imported(action: str, heavy: tuple[str, ...]) -> None:
    code = f"import sys, tautwave.config; {action}; print({{*{heavy}}} & {{*sys.modules}})"
    [bench] = [path for path in CONFIGS if path.stem == "bench-1dof-loopback"]
    said = subprocess.run(
        [sys.executable, "-c", code, str(bench)], capture_output=True, text=True, check=True
    )
    assert said.stdout == "set()\n"


@pytest.mark.parametrize(
    ("rig", "given", "named"),
    [
        ("bench-canopen-virtual", "can.options.simulator={quueue: 3}", "did you mean 'queue'"),
        ("bench-dynamixel-sim", "servos.options.simulator={faullts: {}}", "unknown key 'faullts'"),
        ("bench-modbus-tcp-sim", "arm.options.simulator={faullts: {}}", "unknown key 'faullts'"),
    ],
)
def test_keys_of_simulated_devices_are_checked_with_the_rig(
    rig: str, given: str, named: str
) -> None:
    """A driver takes its simulator's block as it is; only the simulator knows what is in it."""
    path = next(one for one in CONFIGS if one.stem == rig)
    with pytest.raises(ConfigError, match=named):
        load_rig(path, [f"buses.{given}"])
