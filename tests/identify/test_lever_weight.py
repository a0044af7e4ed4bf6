"""`identify RECORDING --lever --gravity`: the weight of a lever, as a rig's `load` states it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from tautwave.cli import main
from tautwave.models.load import LoadParams, load_effort
from tautwave.session.identification.lever import LeverResult, identify_lever

T = 1e-3
INERTIA, VISCOUS, COULOMB = 0.02, 0.05, 0.1
LOAD = LoadParams(0.05, -0.6, 0.25)


def written(
    folder: Path, reach: float, load: LoadParams = LOAD, names: str = "angle_rad,motor_nm"
) -> Path:
    """Write how a lever that a motor moves by `reach` rad carries a load; the motor's effort."""
    t = T * np.arange(12_000)
    x, v, a = (np.zeros_like(t) for _ in range(3))
    for hz, share in ((0.31, 0.7), (0.83, 0.3)):
        w = 2.0 * np.pi * hz
        x += reach * share * np.sin(w * t)
        v += reach * share * w * np.cos(w * t)
        a -= reach * share * w * w * np.sin(w * t)
    carried = np.array([load_effort(load, one) for one in x.tolist()])
    effort = INERTIA * a + VISCOUS * v + COULOMB * np.sign(v) - carried
    rng = np.random.default_rng(7)
    effort += rng.normal(scale=2e-3, size=len(t))
    path = folder / "lever.csv"
    np.savetxt(path, np.column_stack([t, x + rng.normal(scale=1e-5, size=len(t)), effort]), "%.12g",
               ",", header=f"time_s,{names}", comments="")  # fmt: skip
    return path


def within(found: LeverResult) -> None:
    fit = found.fit
    assert fit.weight is not None
    for estimate, truth in zip((fit.bias, *fit.weight), LOAD, strict=True):
        assert estimate.value == pytest.approx(truth, abs=5e-3)
        assert estimate.lower - 2e-3 < truth < estimate.upper + 2e-3
    assert fit.inertia.value == pytest.approx(INERTIA, rel=0.02)
    assert fit.coulomb.value == pytest.approx(COULOMB, rel=0.05)


def test_a_weight_is_found_beside_inertia_and_friction(tmp_path: Path) -> None:
    path = written(tmp_path, 1.4)
    found = identify_lever(path, gravity=True)
    within(found)
    assert found.fit.explained > 0.999
    assert found.snippet.splitlines()[-1].startswith("load: {constant: 0.05")
    plain = identify_lever(path)
    assert plain.fit.explained < 0.9
    assert any("--gravity finds a weight" in note for note in plain.notes)
    assert plain.fit.weight is None


def test_over_a_small_angle_a_weight_is_not_told_from_a_constant(tmp_path: Path) -> None:
    found = identify_lever(written(tmp_path, 0.05), gravity=True)
    assert found.snippet.splitlines()[-1] == "# load: not known from this, see the notes"
    assert any("is not told from a constant" in note for note in found.notes)


@pytest.mark.slow
def test_a_lever_without_a_weight_has_none(tmp_path: Path) -> None:
    found = identify_lever(written(tmp_path, 1.4, LoadParams(0.0, 0.0, 0.0)), gravity=True)
    assert found.fit.weight is not None
    assert max(abs(one.value) for one in found.fit.weight) < 5e-3
    assert found.knows_weight


def test_what_does_not_turn_has_no_such_weight(tmp_path: Path) -> None:
    path = written(tmp_path, 0.1, names="position_m,motor_n")
    words = ["identify", str(path), "--lever", "--gravity", "--out", str(tmp_path / "x")]
    done = CliRunner().invoke(main, words)
    assert (done.exit_code, done.output.count("\n")) == (2, 1)
    assert "is linear, and its weight is the same everywhere" in done.output
    done = CliRunner().invoke(main, ["identify", str(path), "--gravity"])
    assert "--gravity requires --lever" in done.output
