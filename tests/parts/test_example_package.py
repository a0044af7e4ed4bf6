"""The example package, installed as anybody's: listed, checked, run, the same to the bit."""

from __future__ import annotations

import json
import shutil
import site
import subprocess
import sys
import tomllib
import venv
from importlib.metadata import EntryPoint, EntryPoints, entry_points
from pathlib import Path

import numpy as np
import pytest

from tautwave import load_rig, registry, simulate

GROUPS = (registry.COUPLINGS, registry.CONTROLS, registry.DRIVERS, registry.SIMULATORS)
EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "tautwave-example-parts"

SCRIPT = """
import json, sys
import numpy as np
from pathlib import Path
from tautwave import check, load_rig, read_recording, run, simulate
from tautwave.config import rig_schema
from tautwave.registry import HANDS, ENVIRONMENTS, list_parts

reported = {"schema": sorted(rig_schema()["$defs"])}
reported["parts"] = [part.name for group in (HANDS, ENVIRONMENTS) for part in list_parts(group)]
for file in sys.argv[2:]:
    rig, out = load_rig(file), Path(sys.argv[1]) / Path(file).stem
    found = check(rig)
    reported["plan"] = {item.element: item.reason for item in found.plan if item.state == "in"}
    verdicts = found.certificate["verdicts"]
    result = run(rig, duration_s=0.4, clock="fake", out=out, allow_uncertified=True)
    live = read_recording(out / "recording.mcap")
    books = json.loads((out / "summary.json").read_text())
    reported[rig.name] = {
        "plan": {item.element: item.reason for item in found.plan if item.state == "in"},
        "passive": verdicts["passive"],
        "stable": verdicts["coupled_stable"],
        "residual": books["energy_j"]["residual"] / books["energy_j"]["gross_flow"],
        "elements": sorted(books["pairs"]["lever"]["elements"]),
        "again": load_rig(out / "rig.yaml") == load_rig(file, ["duration_s=0.4"]),
        "same": [
            all(np.array_equal(made[name], live[name], equal_nan=True) for name in made.columns)
            for made in (simulate(rig, duration_s=0.4, engine=e) for e in ("python", "compiled"))
        ],
    }
print(json.dumps(reported))
"""


@pytest.fixture(scope="module")
def python(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the Python of a venv with the package, and everything that is installed here."""
    pytest.importorskip("hatchling")
    pytest.importorskip("pip")
    folder = tmp_path_factory.mktemp("venv")
    venv.create(folder, with_pip=False)
    python = folder / "bin" / "python"
    (packages,) = folder.glob("lib/python*/site-packages")
    lines = [f"import site; site.addsitedir({path!r})" for path in site.getsitepackages()]
    (packages / "here.pth").write_text("\n".join(lines) + "\n")
    source = folder / "source"
    shutil.copytree(EXAMPLE, source)
    command = [
        *(sys.executable, "-m", "pip", "--python", str(python), "install", "--no-index"),
        *("--no-deps", "--no-build-isolation", "--quiet", "--disable-pip-version-check"),
        str(source),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return python


@pytest.mark.parametrize("name", ["fluid.yaml", "pd.yaml"])
def test_what_it_declares_is_found_and_its_rigs_run(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its entry points as `pyproject.toml` has them, without an installation."""
    declared = tomllib.loads((EXAMPLE / "pyproject.toml").read_text())["project"]["entry-points"]
    points = [EntryPoint(*one, group) for group, each in declared.items() for one in each.items()]
    monkeypatch.syspath_prepend(str(EXAMPLE))
    points += [one for group in GROUPS for one in entry_points().select(group=group)]
    monkeypatch.setattr(registry, "entry_points", lambda: EntryPoints(points))
    run = simulate(load_rig(EXAMPLE / name), duration_s=0.1, engine="python")
    assert run.error is None
    at = {column: run.data[:, k] for k, column in enumerate(run.columns)}
    assert np.ptp(at["true.master.lever.position"]) > 1e-4  # the hand that trembles


@pytest.mark.slow
@pytest.mark.nightly
def test_it_runs_as_any_other(python: Path, tmp_path: Path) -> None:
    pytest.importorskip("numba")
    rigs = [str(EXAMPLE / name) for name in ("fluid.yaml", "pd.yaml")]
    command = [str(python), "-c", SCRIPT, str(tmp_path), *rigs]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    reported = json.loads(done.stdout.splitlines()[-1])
    assert reported["parts"] == ["tremor", "fluid"]
    assert {"fluid.part", "tremor.part", "pd_injection.coupling"} <= set(reported["schema"])
    for name in ("example parts", "PD with damping injection"):
        run = reported[name]
        assert run["again"] is True
        assert run["same"] == [True, True], name
        assert run["residual"] == pytest.approx(0.0, abs=1e-9)
        assert run["plan"]["hand on master.lever"] == "part tremor"
    fluid, pd = reported["example parts"], reported["PD with damping injection"]
    assert fluid["plan"]["environment of slave.lever"].startswith("part fluid, runs in Python")
    kept = "part fluid, which slave.lever touches, also keeps it stable"
    assert kept in fluid["stable"]["conditions"]
    assert pd["passive"]["passed"] is True
    assert pd["passive"]["conditions"] == ["continuous time stands for sampled"]
    assert pd["stable"]["passed"] is False
    assert "law pd_injection has no linear model" in pd["stable"]["reason"]
