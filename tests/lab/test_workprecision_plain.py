"""The plain scene beside MuJoCo: its errors, and goals that say what each side is charged for."""

from __future__ import annotations

import math

import pytest

from tautwave.bench.precision.points import Point, Scene
from tautwave.models.integrators.schemes import EXACT
from tautwave.models.plant_params import plant_cache
from tests.lab.peers import mujoco as peers_mujoco
from tests.lab.plain.lanes import plain_aims, plain_rows
from tests.lab.plain.truth import plain_error, plain_plants, plain_truth
from tests.lab.workprecision.plain import (
    ALONE,
    NAME,
    PLAIN,
    SET,
    START,
    WHOLE,
    Charge,
    charges,
    devices_alone,
    mujoco_goals,
    mujoco_table,
    plain_scene,
    run_devices,
)
from tests.lab.workprecision.rigs import WAVE_WALL


def point(method: str, step: float, error: float, cpu_s: float) -> Point:
    peer = method.startswith("MuJoCo")
    return Point("wave", method, step, error, math.nan, cpu_s, False, peer)


SCENE = Scene(
    "wave",
    "a scene",
    (
        point("exact", 1e-3, 1e-14, 1e-4),
        point("symplectic_euler", 1e-3, 1e-3, 5e-5),
        point("MuJoCo Euler", 1e-3, 2e-3, 1e-3),
        point("MuJoCo RK4", 1e-4, 1e-5, 0.1),
        point("MuJoCo RK4", 1e-5, math.inf, 1.0),
    ),
    None,
    "",
)


def test_each_point_meets_the_cheapest_that_errs_no_more() -> None:
    rows = mujoco_table([Charge(SCENE, WHOLE)]).rows
    assert [(row[2], row[6], row[9]) for row in rows] == [
        ("MuJoCo Euler", "symplectic_euler", 20.0),
        ("MuJoCo RK4", "exact", 1000.0),
    ]


def test_goals_are_at_both_ends_and_say_the_charge() -> None:
    cheap, accurate = mujoco_goals([Charge(SCENE, ALONE, 1e-5)])
    assert (cheap.measured, cheap.met) == (100.0, True)
    assert accurate.measured == pytest.approx(1e4)
    assert cheap.name.endswith("MuJoCo Euler 1 ms, its cheapest (errors 1e-03, 2e-03)")
    assert "MuJoCo RK4 0.1 ms, its most accurate" in accurate.name
    assert ALONE in cheap.name
    assert list(mujoco_goals([Charge(SCENE._replace(points=SCENE.points[:2]), WHOLE)])) == []


@pytest.mark.slow
def test_mujoco_closes_the_same_loop() -> None:
    pytest.importorskip("mujoco")
    aims = plain_aims(1500)
    oracle = plain_truth(SET, aims.tolist(), EXACT, 0.0)
    assert plain_error(plain_rows(SET, aims), oracle) < 1e-12
    found = {
        (p.method, round(1e6 * p.step_s)): p.error
        for p in peers_mujoco.mujoco_plain("plain", SET, aims.tolist(), (1, 10), oracle, 1)
    }
    assert found["MuJoCo Euler", 1000] < 0.1
    assert found["MuJoCo Euler", 100] < 0.2 * found["MuJoCo Euler", 1000]
    # It ends at the stiffness of its least solimp, a ten-thousandth beside the one asked for.
    assert 1e-6 < found["MuJoCo RK4", 100] < 1e-3


def test_only_the_slave_has_a_wall() -> None:
    master, slave = plain_plants(SET)
    assert (master.wall_stiffness, slave.wall_stiffness) == (0.0, SET.stiffness)
    assert (master.mass, slave.mass) == (SET.mass_1, SET.mass)


def test_devices_alone_move() -> None:
    plants = plain_plants(SET)
    caches = [plant_cache(plant, 1e-3) for plant in plants]
    state = [0.0] * 4
    given = [0.0, 0.0, 0.0, SET.mass, 0.0, 0.0]
    assert run_devices(plants, caches, given, state, 100, 1e-3) == 100
    assert state == pytest.approx([START + 0.1, 1.0, START + 0.105, 1.1], abs=1e-12)


@pytest.mark.slow
def test_the_scene_as_measured() -> None:
    pytest.importorskip("numba")
    scene = plain_scene((1,), 1)
    own, *peers = scene.points
    assert own.error < 1e-12
    assert all(peer.error > own.error for peer in peers)
    found = list(charges([scene, SCENE._replace(name=WAVE_WALL.name)], 1))
    assert [(charge.scene.name, charge.what) for charge in found] == [
        (NAME, PLAIN),
        (WAVE_WALL.name, WHOLE),
        (WAVE_WALL.name, ALONE),
    ]
    assert devices_alone(WAVE_WALL, 1) > 0.0
