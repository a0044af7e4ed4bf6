"""The plain scene is exact, and every way to run it gives its bits."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import example, given
from hypothesis import strategies as st

from tautwave.errors import ConfigError
from tautwave.models.integrators.schemes import DORMAND_PRINCE, EXACT
from tautwave.models.plant import plant_step
from tautwave.models.plant_params import plant_cache
from tests.lab.command import lab
from tests.lab.plain import scene as plain_scene
from tests.lab.plain.gcc import compile_text
from tests.lab.plain.lanes import (
    SCALAR,
    _timed,
    _ways,
    as_records,
    lanes,
    plain_aims,
    plain_rows,
    plain_sets,
)
from tests.lab.plain.lanes_text import LANES
from tests.lab.plain.scene import Plain, meet_wall, plain_set, run_plain
from tests.lab.plain.truth import plain_plants, plain_truth

gcc = pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")


def energy(p: Plain, x: float, v: float) -> float:
    deep = max(x - p.wall, 0.0)
    return 0.5 * p.mass * v * v + 0.5 * p.stiffness * deep * deep


@pytest.mark.slow
@gcc
def test_every_way_gives_the_bits_of_plain_python(tmp_path: Path) -> None:
    sets, aims = plain_sets(2 * LANES), plain_aims(1200)
    _, results = _timed(_ways(tmp_path), as_records(sets), aims, 1)
    assert len(results) >= 2
    out = [0.0] * (4 * LANES)
    run_plain(sets, aims.tolist(), [0.0] * 100, [], out, [2 * LANES, 1200, 0])
    for way, found in results.items():
        assert found.tobytes() == np.array(out).tobytes(), way


@pytest.mark.slow
@pytest.mark.parametrize("at", [0, 24, 47])
@pytest.mark.parametrize(("scheme", "most"), [(EXACT, 1e-13), (DORMAND_PRINCE, 1e-12)])
def test_it_is_exact(at: int, scheme: int, most: float, monkeypatch: pytest.MonkeyPatch) -> None:
    met = []

    def counting(p: Plain, x: float, v: float, force: float) -> tuple[float, float]:
        met.append(x)
        return meet_wall(p, x, v, force)

    monkeypatch.setattr(plain_scene, "meet_wall", counting)
    p, aims = plain_sets(48)[at], plain_aims(4000)
    found = plain_rows(p, aims)
    truth = plain_truth(p, aims.tolist(), scheme, 1e-13)
    assert len(met) >= 8
    assert (np.abs(found - truth).max(axis=0) <= most * np.ptp(truth, axis=0)).all()


def test_without_the_events_it_would_not_be(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the mode frozen for a period costs: the scene as it would be without `meet_wall`."""

    def frozen(p: Plain, x: float, v: float, force: float) -> tuple[float, float]:
        deep = x - p.wall
        if deep > 0.0:
            off = deep - force / p.stiffness
            return x + p.turn * off + p.lever * v, v + p.turn * v - p.swing * off
        return x + p.period * v + p.give * force, v + p.gain * force

    monkeypatch.setattr(plain_scene, "meet_wall", frozen)
    p, aims = plain_sets(48)[47], plain_aims(4000)
    found = plain_rows(p, aims)
    truth = plain_truth(p, aims.tolist(), EXACT, 0.0)
    assert np.abs(found - truth).max(axis=0)[2] > 1e-3 * np.ptp(truth[:, 2])


def of_size(most: float) -> st.SearchStrategy[float]:
    """Zero, or not so small that a square of it underflows."""
    return st.floats(-most, most).map(lambda value: value if abs(value) > 1e-12 else 0.0)


motions = of_size(2e-3), of_size(2.0), of_size(300.0)


@example(5e-324, 0.0, 0.0, 5e3)
@given(*motions, st.sampled_from([200.0, 5e3, 1e6]))
def test_a_meeting_is_the_plant_s(deep: float, v: float, force: float, stiffness: float) -> None:
    p = plain_set(1e-3, 6.0, 0.4, 0.4, 0.0, stiffness)
    _, plant = plain_plants(p)
    want = plant_step(plant, plant_cache(plant, 1e-3), deep, v, 0, force, 0.0, 0.0, 1e-3)
    x, speed = meet_wall(p, deep, v, force)
    scale = abs(v) + 1e-3 * abs(force) / p.mass + p.rate * abs(deep)
    assert abs(speed - want[1]) <= 1e-12 * scale + 1e-300  # of a depth with few bits, too
    assert abs(x - want[0]) <= 1e-15 * scale + 1e-18


@given(*motions)
def test_a_meeting_keeps_the_energy(deep: float, v: float, force: float) -> None:
    p = plain_set(1e-3, 6.0, 0.4, 0.4, 0.0, 5e3)
    x, speed = meet_wall(p, deep, v, force)
    given_, held = energy(p, deep, v), energy(p, x, speed)
    most = given_ + held + abs(force * (x - deep))
    assert abs(held - given_ - force * (x - deep)) <= 1e-13 * most + 1e-25


def test_no_two_sets_are_alike() -> None:
    sets = plain_sets(48)
    assert len({p.impedance for p in sets}) == 48
    for p in sets:
        # The wall's exact step turns position and velocity without loss.
        turned = (1.0 + p.turn) ** 2 + p.lever * p.swing
        assert math.isclose(turned, 1.0, abs_tol=1e-14)


@pytest.mark.slow
@gcc
def test_the_suite_says_what_it_compared() -> None:
    suite = lanes(sets=2 * LANES, steps=300, rounds=1, tell=lambda _: None)
    rows = {row[0]: row for row in suite.tables[0].rows}
    assert rows[SCALAR][2] == 1.0
    assert {row[3] for row in rows.values()} == {"yes"}
    assert all(goal.measured is not None for goal in suite.goals[:1])
    assert suite.goals[2].met


@gcc
def test_what_gcc_says_of_a_text_it_refuses_is_reported(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"gcc refuses the text: /.*kernel\.c:1"):
        compile_text("int f( {", tmp_path, ["-shared"])


def test_without_gcc_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shutil.which", lambda *_: None)
    done = CliRunner().invoke(lab, ["lanes", "--json"])
    assert done.exit_code == 0, done.output
    for goal in json.loads(done.stdout)["goals"]:
        assert (goal["met"], goal["why_not"]) == (None, "needs gcc")
