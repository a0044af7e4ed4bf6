"""Recordings in place of a device, a hand or an environment."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tautwave import load_rig, simulate
from tautwave.config import Rig
from tautwave.errors import ConfigError
from tautwave.motion import wanted_motion
from tests.rigs.running import run_rig

CONFIGS = Path(__file__).parents[2] / "configs"
PERIOD, COUNT = 5e-4, 900
TIMES = PERIOD * np.arange(COUNT)
MASTER = 0.1 + 0.05 * np.cos(9.0 * TIMES) + 0.02 * TIMES
SLAVE = MASTER - 0.004
PUSH = 0.05 * np.sin(40.0 * TIMES) - 0.02


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "bench.csv"
    rows = np.column_stack([TIMES + 3.0, MASTER, SLAVE, PUSH])
    head = "time_s,x_master,x_slave,f"
    np.savetxt(path, rows, delimiter=",", header=head, comments="", fmt="%.17g")
    return path


def replayed(file: Path, *changes: str, repeat: bool = False, seconds: float = 0.4) -> Rig:
    once = "" if repeat else ", repeat: false"
    device = f"{{id: 1, file: {file}, position: x_master{once}}}"
    push = f"{{type: recorded, file: {file}, effort: f, position: x_slave{once}}}"
    keys = [
        f"buses.played={{driver: replay, options: {{devices: [{device}]}}}}",
        "master.axes.lever.bus=played",
        "simulation.hand={}",
        f"simulation.environment.lever={push}",
        f"duration_s={seconds}",
    ]
    return load_rig(CONFIGS / "bench-1dof-2khz.yaml", [*keys, *changes])


def test_an_axis_moves_as_recorded_and_the_books_close(file: Path) -> None:
    run = run_rig(replayed(file))
    rows = len(run["time_s"])
    np.testing.assert_allclose(run["true.master.lever.position"], MASTER[:rows], atol=1e-15)
    np.testing.assert_array_equal(
        run["master.lever.position"], run["true.master.lever.position"]
    )  # neither noise nor steps
    motor, hand = (run[f"plant.master.lever.{it}_work"] for it in ("motor", "hand"))
    np.testing.assert_array_equal(hand, -motor)
    assert abs(motor[-1]) > 1e-4
    held, acting = run["true.master.lever.hand_effort"], run["master.lever.commanded"]
    np.testing.assert_allclose(held[1:], -acting[:-1], atol=1e-15)
    # the slave begins where it was recorded, and is pushed
    assert run["true.slave.lever.position"][0] == SLAVE[0]
    np.testing.assert_allclose(run["true.slave.lever.environment_effort"], PUSH[:rows], atol=1e-15)
    slave = {it: run[f"plant.slave.lever.{it}"] for it in (
        "motor_work", "kinetic", "viscous_loss", "coulomb_loss", "environment_loss"
    )}  # fmt: skip
    given = slave["motor_work"] - slave["kinetic"] - slave["viscous_loss"]
    left = given - slave["coulomb_loss"] - slave["environment_loss"]
    assert np.max(np.abs(left)) < 1e-12
    moved = np.diff(run["true.slave.lever.position"])
    np.testing.assert_allclose(
        slave["environment_loss"][1:], -np.cumsum(PUSH[: rows - 1] * moved), atol=1e-12
    )


@pytest.mark.parametrize("engine", ["python", pytest.param("compiled", marks=pytest.mark.slow)])
def test_simulations_are_the_live_run_to_the_bit(file: Path, engine: str) -> None:
    rig = replayed(file, repeat=True, seconds=0.6)
    live, done = run_rig(rig), simulate(rig, engine=engine)
    assert done.columns == tuple(live.columns)
    np.testing.assert_array_equal(done.data, live.table)


def test_nothing_jumps_where_a_recording_is_repeated(file: Path) -> None:
    run = simulate(replayed(file, repeat=True, seconds=1.2), engine="python")
    steps = np.abs(np.diff(run["true.master.lever.position"]))
    assert abs(MASTER[-1] - MASTER[0]) > 0.07
    assert steps.max() < 1e-3
    assert np.any(steps[-COUNT // 2 :] > 0.0)  # it does go on
    stands = simulate(replayed(file, seconds=0.6), engine="python")
    assert stands["true.master.lever.position"][-1] == MASTER[-1]
    assert stands["true.slave.lever.environment_effort"][-1] == 0.0


def test_the_other_axis_begins_where_the_coupling_would_have_it(file: Path) -> None:
    pair = "coupling.pairs.lever"
    changes = [f"{pair}.sign=-1", f"{pair}.position_scale=0.5", f"{pair}.offset=0.02"]
    changes += [f"{pair}.engage_tolerance=0.01", "simulation.environment={}"]
    rig = replayed(file, *changes)
    assert rig.simulation is not None
    start = {name: keys.start_position for name, keys in rig.simulation.axes.items()}
    assert start["master.lever"] == MASTER[0]
    assert start["slave.lever"] == pytest.approx(-0.5 * (MASTER[0] - 0.02))
    run = simulate(rig, engine="python")
    assert abs(run["lever.position_error"][0]) < 2e-4
    given = replayed(file, "simulation.axes.slave.lever.start_position=0.01")
    assert given.simulation is not None
    assert given.simulation.axes["slave.lever"].start_position == 0.01


@pytest.mark.parametrize("damping", [0.0, 0.03])
def test_what_was_wanted_is_found_from_motion_and_effort(damping: float) -> None:
    """A grip pulls its own mass and the device along; both signals are slow."""
    mass, stiffness = 8e-4, 3.0
    t = 1e-3 * np.arange(4000)
    wanted = 0.2 * np.sin(2.0 * np.pi * 0.9 * t) + 0.05 * np.cos(2.0 * np.pi * 2.3 * t)
    x = np.empty_like(t)
    at, speed, effort = wanted[0], 0.0, np.empty_like(t)
    rate = np.gradient(wanted, 1e-3)
    device = 2e-3  # kg m2, with 0.02 N m s/rad
    for k in range(len(t)):
        x[k] = at
        grip = stiffness * (wanted[k] - at) + damping * (rate[k] - speed)
        bent = (grip - 0.02 * speed) / (mass + device)
        effort[k] = grip - mass * bent
        speed += 1e-3 * bent
        at += 1e-3 * speed
    found = wanted_motion(x, effort, 1e-3, mass, damping, stiffness, filter_hz=25.0)
    inner = slice(300, -300)
    apart = np.std(found[inner] - wanted[inner])
    assert apart < 0.02 * np.std(x[inner] - wanted[inner])


def test_an_intent_moves_the_hand_and_not_the_device(file: Path) -> None:
    reference = f"{{type: intent, file: {file}, position: x_master, effort: f, repeat: false}}"
    rig = load_rig(
        CONFIGS / "bench-1dof-2khz.yaml",
        [f"simulation.hand.lever.reference={reference}", "duration_s=0.3"],
    )
    run = simulate(rig, engine="python")
    assert run["true.master.lever.position"][0] == MASTER[0]
    square = 0.075**2
    wanted = wanted_motion(
        MASTER, PUSH, PERIOD, 0.143 * square, 5.0 * square, 538.0 * square, filter_hz=20.0
    )
    rows = len(run["time_s"])
    np.testing.assert_allclose(run["true.master.lever.reference"], wanted[:rows], atol=1e-9)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("simulation.hand.lever={lever_arm: 1, reference: {type: hold, position: 0}}",
         "nothing else moves master.lever"),
        ("master.axes.lever.id=7", "none has the id 7 of master.lever; it has 1"),
        ("buses.played.options.devices.0.position=x", "there is no column 'x'; available: time_s"),
        ("buses.played.options.devices.0.file=no.csv", "no.csv: the recording cannot be read"),
        ("simulation.environment.lever.effort=g", "has no column 'g'"),
    ],
)  # fmt: skip
def test_what_cannot_be_replayed_is_refused_in_a_sentence(
    file: Path, change: str, said: str
) -> None:
    with pytest.raises(ConfigError) as refused:
        simulate(replayed(file, change), engine="python")
    assert said in str(refused.value)


def test_no_motion_is_made_up_over_a_gap(file: Path) -> None:
    lines = file.read_text().splitlines()
    gap = round(0.1 / PERIOD)
    file.write_text("\n".join(lines[:200] + lines[200 + gap :]))
    with pytest.raises(ConfigError, match=r"row 200: nothing was recorded for 0\.1 s") as refused:
        simulate(replayed(file), engine="python")
    assert "fill the gap or cut" in str(refused.value)
