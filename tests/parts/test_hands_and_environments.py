"""Hands and environments of others' making, from a single file: keys, motion, books, refusals."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

import numpy as np
import pytest

from tautwave import simulate
from tautwave.certificate import certify
from tautwave.config import load_rig, parse_rig, resolved_yaml
from tautwave.errors import ConfigError, SafetyStop
from tautwave.models.part_contact import PartContact, part_step, part_stored
from tautwave.models.plant_params import PlantParams
from tautwave.rig.truth import axis_model
from tautwave.session.engine import compiled_devices

EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "tautwave-example-parts"


@pytest.fixture
def rig_file(tmp_path: Path) -> Path:
    for part in ("fluid", "tremor"):
        shutil.copy(EXAMPLE / "tautwave_example_parts" / f"{part}.py", tmp_path)
    text = (EXAMPLE / "fluid.yaml").read_text().replace("part: tremor", "part: ./tremor.py")
    path = tmp_path / "rig.yaml"
    path.write_text(text.replace("part: fluid", "part: ./fluid.py"))
    return path


def test_a_file_is_a_part_and_named_by_its_hash_in_the_resolved_rig(rig_file: Path) -> None:
    rig = load_rig(rig_file)
    text = resolved_yaml(rig)
    assert f"part: {rig_file.parent / 'tremor.py'}" in text
    assert text.count("part_sha256: ") == 2
    assert parse_rig(text, rig_file) == rig
    with (rig_file.parent / "fluid.py").open("a") as file:
        file.write("# another text\n")
    assert load_rig(rig_file) != rig
    with pytest.raises(ConfigError, match=r"part_sha256: the text of .*fluid.py has changed"):
        parse_rig(text, rig_file)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("amplitude: 0.01", "amplitude: -1", "hand.lever.amplitude: Input should be greater"),
        ("amplitude: 0.01, ", "", "hand.lever.amplitude: required key is missing"),
        ("viscosity", "viscocity", "lever.viscocity: unknown key 'viscocity'; did you mean 'visco"),
        (
            "./tremor.py",
            "./tremour.py",
            r"hand.lever.part: /.*/tremour.py: cannot be read: No such file or directory$",
        ),
        ("./tremor.py", "tremor!", "hand.lever.part: unknown hand 'tremor!'"),
        ("./tremor.py", "./fluid.py", "hand.lever.part: .*there is no `plugin`, a tautwave Hand"),
        (", lever_arm: 0.075", "", "hand.lever.lever_arm: required key is missing"),
    ],
)
def test_mistakes_name_their_line(old: str, new: str, said: str, rig_file: Path) -> None:
    text = rig_file.read_text()
    assert old in text
    with pytest.raises(ConfigError, match=rf"rig.yaml:(38|40): simulation.*{said}"):
        parse_rig(text.replace(old, new), rig_file)


@pytest.mark.slow
@pytest.mark.nightly
def test_a_hand_part_moves_compiled_as_in_python(rig_file: Path) -> None:
    pytest.importorskip("numba")
    text = rig_file.read_text()
    text = text[: text.index("  environment:")]
    rig = parse_rig(text, rig_file)
    one, two = (simulate(rig, duration_s=0.2, engine=engine) for engine in ("compiled", "python"))
    assert one.data.tobytes() == two.data.tobytes()
    assert np.ptp(one["true.master.lever.reference"]) > 0.01


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("return [float('nan')] * len(times)", "its reference is nan at 0 s"),
        ("return [0.0]", "1 positions for"),
        ("return 1 / 0", "its motion fails: ZeroDivisionError"),
    ],
)
def test_a_hand_part_that_fails_is_refused(body: str, said: str, rig_file: Path) -> None:
    path = rig_file.parent / "tremor.py"
    path.write_text(path.read_text().replace("    draw = random", f"    {body}\n    draw = random"))
    with pytest.raises(ConfigError, match=rf"simulation.hand.lever: part .*: {said}"):
        simulate(load_rig(rig_file), duration_s=0.05, engine="python")


def test_the_books_close_at_an_environment_part(rig_file: Path) -> None:
    run = simulate(load_rig(rig_file), duration_s=1.2)
    assert run.error is None
    assert run["true.slave.lever.position"].max() > 0.15  # it dips in
    loss = [name for name in run.columns if "slave" in name and "environment" in name]
    assert loss
    plant = [name for name in run.columns if name.endswith("residual")]
    for name in plant:
        assert np.abs(run[name]).max() < 1e-9, name


@pytest.mark.slow
def test_the_error_that_a_rig_allows_decides_the_steps_of_a_part(rig_file: Path) -> None:
    text = rig_file.read_text()

    def steps(more: str = "") -> int:
        rig = parse_rig(text.replace("simulation:\n", f"simulation:\n{more}"), rig_file)
        part = axis_model(rig, "slave.lever", 10).part
        assert part is not None
        return part.substeps

    assert steps() == steps("  integrator: {max_error: 1.0e-4}\n")  # where none is given
    coarse, fine = (steps(f"  integrator: {{max_error: {error}}}\n") for error in (1e-8, 1e-8 / 16))
    assert coarse > steps()
    assert fine == 4 * coarse  # of second order


def test_an_environment_part_that_turns_nan_ends_the_run(rig_file: Path) -> None:
    path = rig_file.parent / "fluid.py"
    bad = "    if depth > 0.02:\n        return float('nan')\n"
    head = "def force(p: tuple[float, ...], x: float, v: float) -> float:"
    text = path.read_text()
    at = text.index("    return -p[1]", text.index(head))
    path.write_text(text[:at] + bad + text[at:])
    run = simulate(load_rig(rig_file), duration_s=1.5)
    assert isinstance(run.error, SafetyStop)
    commands = [name for name in run.columns if name.endswith((".commanded", ".command"))]
    assert commands
    assert all(np.isfinite(run[name]).all() for name in commands)


PD = EXAMPLE / "tautwave_example_parts" / "pd_injection.py"


def test_a_law_from_a_file_runs_and_is_named_by_its_hash(tmp_path: Path) -> None:
    shutil.copy(PD, tmp_path / "my_law.py")
    shutil.copy(EXAMPLE / "tautwave_example_parts" / "tremor.py", tmp_path)
    text = (EXAMPLE / "pd.yaml").read_text().replace("part: tremor", "part: ./tremor.py")
    rig = parse_rig(text.replace("law: pd_injection", "part: ./my_law.py"), tmp_path / "rig.yaml")
    again = resolved_yaml(rig)
    assert f"law: {tmp_path / 'my_law.py'}" in again
    assert parse_rig(again, tmp_path / "rig.yaml") == rig
    run = simulate(rig, duration_s=0.05, engine="python")
    assert run.error is None
    # A damper of its own at a device in motion: the port gives more than spring and damper do.
    weaker = parse_rig(again.replace("injection: 0.05", "injection: 0.0"), tmp_path / "rig.yaml")
    other = simulate(weaker, duration_s=0.05, engine="python")
    assert not np.array_equal(run["master.lever.port_effort"], other["master.lever.port_effort"])


def test_a_law_without_a_verdict_is_never_certified(tmp_path: Path) -> None:
    text = PD.read_text().replace("    verdict=elements,\n", "")
    assert text != PD.read_text()
    (tmp_path / "my_law.py").write_text(text)
    rig = (EXAMPLE / "pd.yaml").read_text().replace("law: pd_injection", "part: ./my_law.py")
    rig = rig[: rig.index("  hand:")] + rig[rig.index("  environment:") :]
    for require in ("passive", "passive_quantised", "coupled_stable"):
        found = certify(parse_rig(f"require: {require}\n{rig}", tmp_path / "rig.yaml"))
        assert not found.passed
        said = found.sentences()[0]
        assert "makes no statement about its passivity (its part has no verdict)" in said


PLANT = PlantParams(0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


def _spring(p: tuple[float, ...], x: float, v: float) -> float:
    return -p[0] * x - p[1] * v


def _energy(p: tuple[float, ...], x: float) -> float:
    return 0.5 * p[0] * x * x


def test_a_spring_as_a_part_swings_as_it_should_and_keeps_its_energy() -> None:
    part = PartContact((200.0, 0.0), _spring, _energy)
    x, v = 0.01, 0.0
    held = 0.5 * 200.0 * 1e-4
    period, losses = 1e-3, 0.0
    for _ in range(1000):
        x, v, _, _, _, _, lost = part_step(PLANT, part, x, v, 0.0, 0.0, 0.0, period)
        losses += lost
    kinetic, _, stored = part_stored(PLANT, part, x, v, 0.0)
    assert kinetic + stored == pytest.approx(held, rel=1e-9)
    assert losses == pytest.approx(0.0, abs=1e-9 * held)
    assert x == pytest.approx(0.01 * math.cos(20.0), abs=2e-5)  # midpoint: phase error w^3 T^2 t/12


def test_order_two_and_located_kinks() -> None:
    def wall(p: tuple[float, ...], x: float, v: float) -> float:
        return -p[0] * x if x > 0.0 else 0.0

    def stored(p: tuple[float, ...], x: float) -> float:
        return 0.5 * p[0] * x * x if x > 0.0 else 0.0

    def bounce(steps: int, kinks: tuple[float, ...]) -> float:
        part = PartContact((800.0,), wall, stored, kinks, steps)
        x, v = -0.0103, 1.0
        for _ in range(120):
            x, v, *_ = part_step(PLANT, part, x, v, 0.0, 0.0, 0.0, 1e-3)
        return v

    assert bounce(1, (0.0,)) == pytest.approx(-1.0, abs=1e-9)  # no energy is made at the edge

    def time_of(steps: int) -> float:
        part = PartContact((800.0,), wall, stored, (0.0,), steps)
        x, v, at = -0.01, 1.0, 0.0
        for _ in range(150):
            x, v, *_ = part_step(PLANT, part, x, v, 0.0, 0.0, 0.0, 1e-3)
            at += 1e-3
        return at + x  # it left at speed 1: when, up to a constant

    exact = 0.15 - (0.15 - 0.01 - math.pi / 40.0)  # x = -(t - t_out)
    errors = [abs(time_of(steps) - exact) for steps in (1, 2, 4)]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.2)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.2)


def test_a_compiled_run_leaves_an_environment_part_in_python(rig_file: Path) -> None:
    rig = parse_rig(f"loop: {{engine: compiled}}\n{rig_file.read_text()}", rig_file)
    assert compiled_devices(rig) is None
    text = rig_file.read_text()
    plain = text[: text.index("  environment:")]
    pytest.importorskip("numba")
    assert compiled_devices(parse_rig(f"loop: {{engine: compiled}}\n{plain}", rig_file)) is not None
