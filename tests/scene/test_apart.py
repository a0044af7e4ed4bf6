"""The core without the package of scenes: it asks for none, and says what a scene needs."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from tautwave import registry
from tautwave.config import load_rig, rig_schema
from tautwave.config.shipped import examples
from tautwave.config.text.yaml12 import parse_yaml
from tautwave.errors import ConfigError
from tests.scene.apart import without_scenes

ROOT = Path(__file__).parents[2]
CONFIGS = ROOT / "configs"
BARE = [
    example
    for example in examples()
    if {"buses"} <= (keys := parse_yaml(example.path.read_text()).value.keys())
    and "scene" not in keys
]
"""The shipped rigs without a scene."""

FEW = ("bench-1dof-loopback", "bench-foam-loopback", "arms-loopback")
TAUTWAVE = [sys.executable, "-c", "from tautwave.cli import main; main()"]
NEEDS = "a rig with a scene needs the package tautwave_scenes, which is not installed here: pip"


@pytest.fixture
def absent(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make the package look as if it were not installed."""
    monkeypatch.setitem(sys.modules, "tautwave_scenes", None)
    monkeypatch.setattr(registry, "control_hooks", registry.control_hooks.__wrapped__)


@pytest.mark.usefixtures("absent")
@pytest.mark.parametrize("name", ["scene-granular", "scene-tissue"])
def test_a_scene_names_what_to_install_in_one_sentence(name: str) -> None:
    path = CONFIGS / f"{name}.yaml"
    line = 1 + path.read_text().splitlines().index("scene:")
    with pytest.raises(ConfigError) as refused:
        load_rig(path)
    (problem,) = refused.value.problems
    assert problem.startswith(f"{path}:{line}: scene: {NEEDS}")


@pytest.mark.usefixtures("absent")
def test_other_mistakes_are_told_beside_it() -> None:
    with pytest.raises(ConfigError) as refused:
        load_rig(CONFIGS / "scene-granular.yaml", ["rate=5", "master.axes.finger={}"])
    told = "\n".join(refused.value.problems)
    assert NEEDS in told
    assert "unknown key 'rate'" in told
    assert "master.axes.finger.bus: required key is missing" in told


@pytest.mark.usefixtures("absent")
def test_the_schema_has_the_key_without_its_blocks() -> None:
    schema = rig_schema()
    assert schema["properties"]["scene"]["anyOf"][0]["type"] == "object"
    assert not {"Scene", "Scene3d", "ControlKeys"} & schema["$defs"].keys()
    json.dumps(schema)


def test_a_package_that_does_not_import_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    point = type("Point", (), {"module": "json", "value": "json:plugin", "dist": None})
    point.load = lambda self: json.plugin  # type: ignore[attr-defined]
    point.name, point.extras = "scene", ()  # type: ignore[attr-defined]
    monkeypatch.setattr(
        registry, "entry_points", lambda: SimpleNamespace(select=lambda group: [point()])
    )
    with pytest.raises(ConfigError, match=r"control 'scene' \(json:plugin\) does not import"):
        registry.load_control("scene")


def commands(path: Path, out: Path) -> list[list[str]]:
    rig = load_rig(path)
    found = [["check", str(path)]]
    if rig.simulation is not None and rig.site is None:
        span = repr(max(0.05, 20.0 * rig.period_s))
        words = ["--clock", "fake", "--duration", span, "--out", str(out), "--allow-uncertified"]
        found += [["run", str(path), *words, "--quiet"], ["report", str(out)]]
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [pytest.param(e.name, marks=[] if e.name in FEW else [pytest.mark.nightly]) for e in BARE],
)
def test_a_rig_without_a_scene_asks_for_none_of_it(tmp_path: Path, name: str) -> None:
    """In no process of a check, a run and its report."""
    environment, asked = without_scenes(tmp_path)
    path = next(example.path for example in BARE if example.name == name)
    for words in commands(path, tmp_path / "run"):
        done = subprocess.run(
            [*TAUTWAVE, *words],
            env=environment, capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode in (0, 3, 6), done.stderr
    assert not asked.exists(), asked.read_text()


@pytest.mark.slow
def test_its_rows_are_those_of_an_installation_with_scenes(tmp_path: Path) -> None:
    environment, asked = without_scenes(tmp_path)
    code = (
        "import hashlib, tautwave; "
        f"rig = tautwave.load_rig({str(CONFIGS / 'bench-1dof-loopback.yaml')!r}); "
        "rows = tautwave.simulate(rig, duration_s=0.2, engine='python'); "
        "print(hashlib.sha256(rows.data.tobytes()).hexdigest())"
    )
    found = {
        subprocess.run(
            [sys.executable, "-c", code], env=given, capture_output=True, text=True, check=True
        ).stdout
        for given in (environment, None)
    }
    assert len(found) == 1
    assert not asked.exists()


@pytest.mark.slow
def test_commands_refuse_a_scene_with_the_sentence(tmp_path: Path) -> None:
    environment, _ = without_scenes(tmp_path)
    kept = tmp_path / "kept"
    rig = str(CONFIGS / "scene-resonator.yaml")
    words = ["run", rig, "--clock", "fake", "--duration", "0.05", "--out", str(kept), "--quiet"]
    subprocess.run([*TAUTWAVE, *words], check=True, capture_output=True)
    for words in (["check", rig], ["report", str(kept)], ["check", str(kept / "rig.yaml")]):
        done = subprocess.run(
            [*TAUTWAVE, *words], env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 2
        assert NEEDS in done.stderr
        assert len(done.stderr.strip().splitlines()) == 1
