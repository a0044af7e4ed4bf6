"""Whole runs through loop, driver and simulated devices, against closed forms."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from tautwave.config import load_rig
from tautwave.rig import Assembly, command_delays
from tautwave.rig.controller import site_params
from tautwave.session.facts import pair_facts
from tests.rigs.running import Run, Tree, pair_of, rig_of, run_rig, tree, unfiltered

CONFIGS = Path(__file__).parents[2] / "configs"
LOOSE = {"coupling.pairs.a.wave_impedance": 1e-14}
"""A coupling that transmits nothing to speak of."""


def known(value: float, true: float | None = None) -> Tree:
    return {"value": value, "lower": value, "source": "x"}


def test_mass_spring_damper_in_the_hand() -> None:
    """The hand pulls the master from rest to 0.01 m: 143 g on 0.5 kg, 5 N s/m, 538 N/m."""
    run = run_rig(
        tree(
            LOOSE,
            {
                "simulation.axes": {"master.a": {"damping": 1.0}},
                "simulation.hand.a": {"reference": {"type": "hold", "position": 0.01}},
                "duration_s": 2.0,
            },
        )
    )
    m, c, k, goal = 0.5 + 0.143, 5.0 + 1.0, 538.0, 0.01
    flow = expm(np.array([[0.0, 1.0], [-k / m, -c / m]]) * 1e-3)
    state, worst = np.array([-goal, 0.0]), 0.0
    for x, v in zip(run["true.master.a.position"], run["true.master.a.velocity"], strict=True):
        worst = max(worst, abs(x - goal - state[0]) / goal, abs(v - state[1]) / 0.3)
        state = flow @ state
    assert worst <= 1e-9
    # And the textbook's envelope, once.
    zeta, omega = c / (2 * math.sqrt(k * m)), math.sqrt(k / m)
    damped = omega * math.sqrt(1 - zeta**2)
    t = 0.25
    decay = math.exp(-zeta * omega * t)
    swing = math.cos(damped * t) + zeta / math.sqrt(1 - zeta**2) * math.sin(damped * t)
    expected = goal * (1.0 - decay * swing)
    assert run["true.master.a.position"][250] == pytest.approx(expected, abs=1e-9 * goal)


def throw(built: Assembly) -> None:
    built.simulators[1].axes[0].physics.v = 0.5


@pytest.mark.parametrize("zeta", [0.0, 0.2])
@pytest.mark.parametrize("side", ["above", "below"])
def test_bounce_on_a_wall(zeta: float, side: str) -> None:
    """W1 and W2 of theory 4.5, the wall at a place that no sample hits."""
    m, k = 0.5, 2000.0
    omega, c = math.sqrt(k / m), 2.0 * zeta * math.sqrt(k * m)
    way = 1.0 if side == "above" else -1.0
    wall = {"type": "wall", "stiffness": k, "damping": c, "position": way * 0.0101234, "side": side}

    def toss(built: Assembly) -> None:
        built.simulators[1].axes[0].physics.v = 0.5 * way

    run = run_rig(tree(LOOSE, {"simulation.environment.a": wall, "duration_s": 0.2}), change=toss)
    x, v = way * run["true.slave.a.position"], way * run["true.slave.a.velocity"]
    entry = 0.0101234 / 0.5
    damped = omega * math.sqrt(1.0 - zeta**2)
    # A wall that only pushes lets go when the force, not the depth, is zero.
    release = math.atan2(2 * zeta * math.sqrt(1 - zeta**2), 2 * zeta**2 - 1.0) / damped
    leave = math.exp(-zeta / math.sqrt(1 - zeta**2) * math.atan2(
        2 * zeta * math.sqrt(1 - zeta**2), 2 * zeta**2 - 1.0))  # fmt: skip
    for n in range(len(x)):
        t = n * 1e-3 - entry
        if t <= 0.0:
            assert x[n] == pytest.approx(0.5 * n * 1e-3, abs=1e-11)
        elif t < release:
            depth = 0.5 / damped * math.exp(-zeta * omega * t) * math.sin(damped * t)
            assert x[n] - 0.0101234 == pytest.approx(depth, abs=1e-11)
    assert v[-1] == pytest.approx(-0.5 * leave, rel=1e-9)
    if zeta == 0.2:
        assert leave == pytest.approx(0.5717400276, abs=1e-9)


def staircase(samples: int, delay: int, slave_mass: float, **changes: object) -> Run:
    """A master too heavy to be slowed pulls the line at 0.1 m/s; nothing else moves it."""
    heavy = known(1e13)
    options = {"command_delay_s": delay * 1e-3}
    data = tree(
        {
            "master.axes.a.inertia": heavy,
            "slave.axes.a.inertia": known(slave_mass),
            "buses.hand.options": options,
            "buses.arm.options": options,
            "coupling.delay_s": samples * 1e-3,
            "duration_s": 0.4,
            **changes,
        }
    )

    def pull(built: Assembly) -> None:
        built.simulators[0].axes[0].physics.v = 0.1

    return run_rig(unfiltered(data), change=pull)


@pytest.mark.parametrize("delay", [0, 1, 2])
@pytest.mark.parametrize("samples", [0, 1, 20])
def test_delayed_line_against_a_clamp_is_a_staircase(samples: int, delay: int) -> None:
    """D11 through the whole stack: 1, 3, 5, 7 N; a step lasts twice the delay the facts tell."""
    run = staircase(samples, delay, 1e13)
    tau = pair_facts(rig_of(_data(samples, delay)), "a", _delays(run)).coupling_delay_s
    trip = round(2 * tau / 1e-3)
    assert trip == 2 * (samples + 1 + delay)
    efforts = run["master.a.port_effort"]
    # The first sample knows no velocity yet.
    expected = [2.0 * (k // trip) + 1.0 for k in range(len(efforts) - 1)]
    first = int(np.argmax(efforts > 0.5))
    assert first == 1
    # The wave that met the first effort left one command delay later than the one of a period
    # in which nothing acted: the steps are those of the closed form from then on.
    settled = efforts[first:]
    changes = np.flatnonzero(np.diff(settled) > 1.0) + 1
    assert np.all(np.diff(changes) == trip)
    levels = sorted({round(value, 6) for value in settled})
    assert levels == [pytest.approx(2.0 * n + 1.0, abs=1e-9) for n in range(len(levels))]
    assert len(levels) == len(set(expected)) or abs(len(levels) - len(set(expected))) <= 1
    clamp = run["slave.a.port_effort"]
    assert sorted({round(-value, 6) for value in clamp})[:4] == pytest.approx([0.0, 2.0, 4.0, 6.0])


def _data(samples: int, delay: int) -> Tree:
    options = {"command_delay_s": delay * 1e-3}
    data = tree(
        {
            "coupling.delay_s": samples * 1e-3,
            "buses.hand.options": options,
            "buses.arm.options": options,
        }
    )
    return unfiltered(data)


def _delays(run: Run) -> dict[str, object]:
    return {name: bus.driver.command_delay for bus in run.assembly.buses for name in bus.axes}


def test_a_wave_into_a_matched_slave_returns_nothing() -> None:
    run = staircase(20, 0, 1e15, **{"coupling.pairs.a.matched_slave": True})
    arrived = np.abs(run["slave.a.wave_in"]).max()
    assert arrived > 0.1
    assert np.abs(run["slave.a.wave_out"]).max() <= 1e-12 * arrived
    assert run["master.a.port_effort"][1:] == pytest.approx(1.0, abs=1e-9)


# -- standstill ----------------------------------------------------------------------------------


def contact_and_release(
    end: float, quantum: float, b: float, samples: int, **changes: object
) -> Run:
    """Nine contacts in a minute, then `end` until it stands still."""
    way, t = [[0.5, 0.0]], 1.0
    for _ in range(9):
        way += [[t + 1.0, 0.05], [t + 3.0, 0.05], [t + 4.0, -0.02], [t + 6.0, -0.02]]
        t += 6.2
    way.append([t + 1.0, end])
    axis = {"damping": 2.0}
    return run_rig(
        tree(
            {
                "rate_hz": 500.0,
                "duration_s": 75.0,
                "coupling.delay_s": samples / 500.0,
                "coupling.pairs.a.wave_impedance": b,
                **FILTERED,
                "master.axes.a.encoder_quantum": quantum,
                "slave.axes.a.encoder_quantum": quantum,
                "simulation.axes": {"master.a": axis, "slave.a": axis},
                "simulation.hand.a": {"reference": {"type": "minimum_jerk", "waypoints": way}},
                "simulation.environment.a": {
                    "type": "wall", "stiffness": 2000.0, "damping": 20.0, "position": 0.02,
                },
                **changes,
            }
        )
    )  # fmt: skip


FILTERED = {
    "coupling.pairs.a.wave_filter_hz": 50.0,
    "coupling.pairs.a.pole_master": 0.5,
    "coupling.pairs.a.pole_slave": 0.5,
}


def left_over(run: Run) -> tuple[float, float]:
    """Return x_m - x_s less the standing offset at the end, and what tanks have not sent [m].

    The standing offset is F (tau + a period + both filters' lag) / b; a wave integral that a tank
    could not pay for yet stays a position error.
    """
    samples = pair_of(run.assembly).params.samples
    keys = rig_of(
        tree({"rate_hz": 500.0, "coupling.delay_s": samples / 500,
              "coupling.pairs.a.wave_impedance": 20.0, **FILTERED})
    )  # fmt: skip
    (params, master), (_, slave) = pair_of(run.assembly).axes.values()
    facts = pair_facts(keys, "a", _delays(run))
    force = 0.5 * (run["master.a.port_effort"][-1] - run["slave.a.port_effort"][-1])
    offset = force * facts.offset_per_effort
    unsent = (master.end.gap - slave.end.gap) / params.end.port.root
    return float(run["a.position_error"][-1] - offset), unsent


@pytest.mark.slow
@pytest.mark.nightly
def test_a_minute_of_contact_leaves_no_offset_once_released() -> None:
    run = contact_and_release(0.0, 0.0, 20.0, 10)
    assert np.abs(run["true.slave.a.environment_effort"]).max() > 1.0
    assert abs(run["true.master.a.velocity"][-1]) < 1e-5
    assert left_over(run)[0] == pytest.approx(left_over(run)[1], abs=1e-9)
    coarse = contact_and_release(0.0, 1e-5, 20.0, 10)
    assert abs(coarse["a.position_error"][-1]) <= 2e-5  # a step of either encoder


@pytest.mark.slow
def test_a_minute_of_contact_ending_pressed_leaves_what_is_explained() -> None:
    run = contact_and_release(0.05, 0.0, 20.0, 10)
    assert run["true.slave.a.environment_effort"][-1] < -3.0
    assert abs(run["true.master.a.velocity"][-1]) < 1e-5
    error, predicted = left_over(run)
    assert error == pytest.approx(predicted, abs=1e-9)


def test_commands_are_in_steps_of_what_an_axis_takes() -> None:
    keys = ("effort_quantum=0.001", "velocity_quantum=0.002")
    changes = [f"{side}.axes.lever.{key}" for side in ("master", "slave") for key in keys]
    rig = load_rig(CONFIGS / "bench-admittance-loopback.yaml", changes)
    delays = command_delays(rig)
    master, slave = (
        site_params(rig, name, delays[name]) for name in ("master.lever", "slave.lever")
    )
    assert (master.limit.effort_quantum, master.velocity_quantum) == (1e-3, 0.0)
    assert (slave.limit.effort_quantum, slave.velocity_quantum) == (0.0, 2e-3)
