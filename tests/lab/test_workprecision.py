"""Work-precision: what is measured is right; how long it took is never asserted."""

from __future__ import annotations

import csv
import importlib
import json
import math
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from tautwave.bench.precision.figure import energy_figure, error_figure
from tautwave.bench.precision.points import Point, Scene, pareto
from tautwave.errors import ConfigError
from tautwave.models.foam import FoamParams
from tautwave.models.integrators.schemes import DISCRETE_GRADIENT, EXACT, RK4
from tautwave.models.plant_params import FlowCache, PlantCache, PlantParams, plant_cache
from tests.lab.command import lab
from tests.lab.peers import mujoco as peers_mujoco
from tests.lab.peers import scipy_control as peers
from tests.lab.timing import cheapest, cpu_time
from tests.lab.workprecision import contact, runs
from tests.lab.workprecision import linear as workprecision_linear

module = importlib.import_module("tests.lab.workprecision.suite")  # hidden by its function


def point(error: float, cpu_s: float, method: str = "rk4", **more: Any) -> Point:
    return Point("wall", method, 1e-3, error, 1e-9, cpu_s, **more)


POINTS = (point(1e-2, 1e-4), point(1e-4, 1e-3), point(1e-3, 2e-3), point(math.inf, 1e-5))
SCENE = Scene("wall", "a scene; error: of it", POINTS, POINTS[1], "rk4: because", ("a note",))


def test_the_front_holds_what_nothing_beats() -> None:
    assert pareto(POINTS) == [POINTS[0], POINTS[1]]
    assert cheapest(POINTS, 1e-3) == POINTS[1]
    assert cheapest(POINTS, 1e-6) is None


def test_peers_are_compared_at_no_smaller_error() -> None:
    slow = point(2e-4, 0.5, "MuJoCo RK4", peer=True)
    scene = SCENE._replace(points=(*POINTS, slow))
    ((peer, best, ratio),) = module._ratios(scene)
    assert (peer, best, ratio) == (slow, POINTS[1], 500.0)
    (goal,) = module._peer_goals(scene)
    assert goal.met
    assert goal.measured == 500.0


def plainly(entry: Any) -> Any:
    """Run a loop as plain Python on records of objects."""

    def run(plants: Any, table: Any, starts: Any, out: Any, sizes: Any, t: float) -> int:
        kind = PlantCache if entry is runs.run_exact else FoamParams
        found = entry(
            [PlantParams(*plants[0].item())],
            [_nested(kind, table[0].item())],
            starts.tolist(),
            out,
            [sizes[0], sizes[1], 1],
            t,
        )
        return int(found)

    return run


def _nested(kind: Any, values: Any) -> Any:
    if kind is PlantCache:
        parts = (*values[:4], FlowCache(*values[4]), FlowCache(*values[5]))
        return kind(*parts)
    return kind(*values)


@pytest.mark.parametrize(
    ("scene", "scheme", "steps", "most"),
    [
        (contact.WALL, EXACT, 7, 1e-14),
        (contact.WALL, RK4, 101, 1e-4),
        (contact.HERTZ, DISCRETE_GRADIENT, 101, 4e-4),
    ],
)
def test_a_throw_ends_where_the_closed_form_says(
    scene: contact.ContactScene, scheme: int, steps: int, most: float
) -> None:
    out, spent = contact.run_method(scene, scheme, steps, 0.0, plainly, 1)
    error, energy = scene.errors(out)
    assert error < most
    assert spent > 0.0
    if scheme == DISCRETE_GRADIENT:
        assert energy < 1e-13


def test_a_wrong_end_is_an_error() -> None:
    out, _ = contact.run_method(contact.WALL, EXACT, 7, 0.0, plainly, 1)
    out[0::2] += 1e-3 * contact.WALL.contact_s
    assert contact.WALL.errors(out)[0] == pytest.approx(1e-3, rel=1e-6)


def test_the_resonator_s_exponential_is_scipys() -> None:
    linalg = pytest.importorskip("scipy.linalg")
    for t in (1e-5, 1e-3, 0.1):
        want = linalg.expm(workprecision_linear.system() * t)
        got = workprecision_linear.balanced(t)
        scale = np.array([1.0, 1.0, 2000.0, 2000.0])
        assert np.abs((got - want) * scale / scale[:, None]).max() < 2e-12


@pytest.mark.parametrize(
    ("entry", "low", "high"),
    # Symplectic Euler's first-order part is small here: its phase is of second order.
    [(runs.run_pair_euler, 1.0, 2.1), (runs.run_pair_rk4, 3.8, 4.2)],
)
def test_two_masses_converge_at_the_scheme_s_order(entry: Any, low: float, high: float) -> None:
    errors = []
    for n in (2000, 4000):
        state = workprecision_linear.START.tolist()
        entry(workprecision_linear.PAIR.tolist(), state, n, workprecision_linear.SPAN_S / n)
        errors.append(workprecision_linear.errors(np.array(state))[0])
    assert low < math.log2(errors[0] / errors[1]) < high


def test_the_midpoint_matrix_keeps_the_energy_of_a_lossless_pair(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    lossless = workprecision_linear.PAIR.copy()
    lossless[[2, 5]] = 0.0
    monkeypatch.setattr(workprecision_linear, "PAIR", lossless)
    state = workprecision_linear.START
    for _ in range(200):
        state = workprecision_linear.cayley(1e-3) @ state
    want = workprecision_linear.energy(workprecision_linear.START)
    assert workprecision_linear.energy(state) == pytest.approx(want, rel=1e-11)


@pytest.mark.slow
def test_scipy_throws_as_we_do() -> None:
    pytest.importorskip("scipy")
    for scene in (contact.WALL, contact.HERTZ):
        for found in peers.scipy_contact(scene, (1e-8,), 1):
            assert found.peer
            assert found.error < 1e-6


@pytest.mark.slow
def test_mujoco_has_the_stiffness_asked_for() -> None:
    pytest.importorskip("mujoco")
    for scene in (contact.WALL, contact.HERTZ):
        found = {p.method: p for p in peers_mujoco.mujoco_contact(scene, (331,), 1)}
        assert found["MuJoCo RK4"].error < 1e-5
        assert found["MuJoCo Euler"].error < 1e-4


def test_mujoco_s_explosion_is_no_small_error() -> None:
    pytest.importorskip("mujoco")
    found = {p.method: p for p in peers_mujoco.mujoco_linear((100,), 1)}
    assert math.isinf(found["MuJoCo Euler"].error)


@pytest.mark.slow
def test_python_control_is_exact_on_the_resonator() -> None:
    pytest.importorskip("control")
    assert all(p.error < 1e-10 for p in peers.control_linear((100,), 1))


def test_a_missing_peer_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peers, "find_spec", lambda _: None)
    assert peers.missing("mujoco") == "mujoco is not installed"
    assert list(peers.scipy_linear((1e-3,), 1)) == []


def test_without_numba_it_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "has_numba", lambda: False)
    with pytest.raises(ConfigError, match="fast"):
        module.workprecision()


@pytest.mark.parametrize("took_s", [2e-4, 0.2])
def test_cpu_time_counts_per_simulated_second(
    monkeypatch: pytest.MonkeyPatch, took_s: float
) -> None:
    spent = [0]
    monkeypatch.setattr(time, "thread_time_ns", lambda: spent[0])
    monkeypatch.setattr(sys.modules[cpu_time.__module__], "calibrate", lambda: 1)

    def run() -> None:
        spent[0] += round(1e9 * took_s)

    assert cpu_time(run, 0.5, 2) == pytest.approx(2.0 * took_s)


@pytest.fixture
def tiny(monkeypatch: pytest.MonkeyPatch) -> None:
    """All of it, without compiling anything."""
    monkeypatch.setattr(module, "scenes_of", lambda *_: [SCENE])
    rates = [[500, "discrete_gradient", 200.0, 4e3, 0.8, 1e-15]]
    monkeypatch.setattr(module, "rates", lambda *_: rates)


@pytest.mark.slow
@pytest.mark.usefixtures("tiny")
def test_it_writes_what_it_measured(tmp_path: Path) -> None:
    result = CliRunner().invoke(lab, ["workprecision", "--out", str(tmp_path / "wp"), "--json"])
    assert result.exit_code == 0, result.output
    reported = json.loads((tmp_path / "wp" / "workprecision.json").read_text())
    scene = reported["scenes"][0]
    assert scene["chosen"]["error"] == 1e-4
    assert [p["error"] for p in scene["front"]] == [1e-2, 1e-4]
    assert scene["points"][3]["error"] is None  # it exploded
    with (tmp_path / "wp" / "workprecision.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["error"] for row in rows] == ["0.01", "0.0001", "0.001", "inf"]
    for name in ("workprecision.png", "workprecision-energy.png"):
        assert (tmp_path / "wp" / name).read_bytes().startswith(b"\x89PNG")


def test_the_figure_marks_front_choice_and_real_time() -> None:
    axes = error_figure([SCENE], 1e-4).axes[0]
    lines = {str(line.get_label()): np.asarray(line.get_xydata()) for line in axes.lines}
    stairs = lines["Pareto front of tautwave"]
    assert np.array_equal(stairs, [[3.0, 1e-4], [1e-2, 1e-4], [1e-4, 1e-3]])
    assert np.array_equal(lines["chosen point"], [[1e-4, 1e-3]])
    assert any(np.array_equal(np.asarray(line.get_ydata()), [1.0, 1.0]) for line in axes.lines)
    assert len(lines["rk4"]) == 3  # the one that exploded is not drawn
    assert energy_figure([SCENE]).axes


def test_the_record_tables_hold_what_was_given() -> None:
    cache = plant_cache(contact.WALL.plant, 1e-3)
    table = contact.records(PlantCache, cache)
    assert _nested(PlantCache, table[0].item()) == cache


@pytest.mark.slow
def test_scipy_begins_anew_at_each_edge_of_a_contact(monkeypatch: pytest.MonkeyPatch) -> None:
    integrate = pytest.importorskip("scipy.integrate")
    solve, begun = integrate.solve_ivp, []

    def solve_and_tell(motion: Any, *given: Any, **keys: Any) -> Any:
        begun.append(motion.__name__)
        return solve(motion, *given, **keys)

    monkeypatch.setattr(integrate, "solve_ivp", solve_and_tell)
    assert next(peers.scipy_contact(contact.WALL, (1e-3,), 1)).error < 0.1
    assert begun[:6] == ["free", "pressed", "free"] * 2
