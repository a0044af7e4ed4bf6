"""Sets side by side give the bits of sets one after the other, and a scene that is one."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest
from click.testing import CliRunner

from tautwave.bench.lanes import LANES, PARAMETERS, lanes, parameters, scene_text
from tautwave.cli import main

gcc = pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")


@gcc
def test_lanes_give_the_same_bits() -> None:
    suite = lanes(sets=2 * LANES, steps=300, rounds=1, tell=lambda _: None)
    assert [row[2] for row in suite.tables[0].rows] == ["yes", "yes"]
    assert suite.goals[0].measured is not None


def test_no_two_sets_are_alike() -> None:
    p = parameters(48)
    assert p.shape == (len(PARAMETERS), 48)
    assert len(np.unique(p[PARAMETERS.index("b")])) == 48
    # The wall's exact step turns position and velocity without loss.
    determinant = p[10] * p[13] - p[11] * p[12]
    assert np.allclose(determinant, 1.0, atol=1e-14)
    assert "side_by_side" in scene_text()


def test_without_gcc_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shutil.which", lambda *_: None)
    done = CliRunner().invoke(main, ["bench", "lanes", "--json"])
    assert done.exit_code == 0, done.output
    goal = json.loads(done.stdout)["goals"][0]
    assert (goal["met"], goal["why_not"]) == (None, "needs gcc")
