"""Slow buses against closed forms: velocity, force, stiffness, modes, drift, rest in contact."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from tautwave.certificate import certify
from tautwave.certificate.loops import pair_loop
from tautwave.certificate.rates import slow_costs
from tautwave.config import load_rig
from tautwave.laws.port import port_effort
from tautwave.report.run.rundir import Run
from tautwave.report.run.verdicts import verdicts
from tautwave.rig import Assembly, command_delays, one_way_delay
from tautwave.rig.controller import end_constants
from tautwave.session import check
from tautwave.summary import summary_of
from tautwave.sweep.predict import pair_mode
from tests.rigs.closing import assert_passive, impedance, line, slow
from tests.rigs.running import Tree, books, pair_of, rig_of, run_rig, tree, unfiltered

CONFIGS = Path(__file__).parents[2] / "configs"


def known(value: float) -> Tree:
    return {"value": value, "lower": value, "source": "x"}


# -- closed forms --------------------------------------------------------------------------------


@pytest.mark.sparse(4)
@pytest.mark.parametrize(
    ("master", "slave", "samples"), [(1, 10, 5), (10, 1, 5), (3, 7, 7), (1, 50, 0)]
)
def test_constant_velocity_passes_exactly(master: int, slave: int, samples: int) -> None:
    """A master too heavy to be slowed, matched: the free slave ends up at its very speed."""
    data = tree(
        slow(master, slave),
        line(samples),
        {
            "master.axes.a.inertia": known(1e9),
            "coupling.pairs.a.matched_master": True,
            "duration_s": 8.0,
        },
    )

    def pull(built: Assembly) -> None:
        built.simulators[0].axes[0].physics.v = 0.1

    run = run_rig(data, change=pull)
    assert run["true.slave.a.velocity"][-1] == pytest.approx(0.1, abs=1e-9)
    assert run["slave.a.port_effort"][-1] == pytest.approx(0.0, abs=1e-9)
    for side, divisor in (("master", master), ("slave", slave)):
        if divisor > 1:  # and in the steady state the converters lose nothing
            lost = run[f"a.converter_{side}.dissipated"]
            assert lost[-1] - lost[-1000] <= 1e-15 * books(run).gross_flow


@pytest.mark.sparse(8)
@pytest.mark.parametrize(
    ("master", "slave", "samples"), [(1, 10, 5), (10, 1, 5), (3, 7, 5), (4, 6, 0), (1, 50, 5)]
)
def test_constant_force_passes_exactly_and_stands_off_by_f_tau_over_b(
    master: int, slave: int, samples: int
) -> None:
    """Pressed on a spring until it rests: one effort on the line, and tau is what the facts say."""
    data = tree(
        slow(master, slave),
        line(samples),
        {
            "duration_s": 15.0,
            "simulation.axes": {"master.a": {"damping": 4.0}, "slave.a": {"damping": 8.0}},
            "simulation.hand.a.reference": {
                "type": "minimum_jerk", "waypoints": [[0.5, 0.0], [2.0, 0.05]],
            },
            "simulation.environment.a": {"type": "spring", "stiffness": 300.0, "position": 0.0},
        },
    )  # fmt: skip
    data = unfiltered(data)
    run, rig = run_rig(data), rig_of(data)
    sides = pair_of(run.assembly).axes
    # A port that is held still gives a share of the line's effort (facts: held_share).
    efforts = [
        sign * state.port_effort * (1.0 + 10.0 * params.site.period * (1 + delay) / 0.4)
        for sign, (params, state), delay in ((1.0, sides["master"], int(master > 1)),
                                             (-1.0, sides["slave"], int(slave > 1)))
    ]  # fmt: skip
    assert efforts[0] > 1.0
    assert efforts[0] == pytest.approx(efforts[1], rel=1e-6)
    tau = one_way_delay(rig, "a", command_delays(rig))
    (params, one), (_, two) = sides["master"], sides["slave"]
    unsent = (one.end.gap - two.end.gap) / params.end.port.root
    assert run["a.position_error"][-1] - unsent == pytest.approx(efforts[0] * tau / 10.0, rel=1e-5)


@pytest.mark.sparse(4)
@pytest.mark.parametrize(
    ("master", "slave", "samples"), [(1, 10, 5), (10, 1, 25), (1, 50, 0), (10, 10, 6)]
)
def test_a_clamp_feels_as_stiff_as_the_certificate_says(
    master: int, slave: int, samples: int
) -> None:
    """Pulled against a clamp the effort rises by 2 b v per round trip: b / tau per metre.

    It rises in stairs, so it is looked at over whole round trips, and those of the buses.
    """
    data = tree(
        slow(master, slave),
        line(samples),
        {
            "master.axes.a.inertia": known(1e13),
            "slave.axes.a.inertia": known(1e13),
            "duration_s": 4.0,
        },
    )

    def pull(built: Assembly) -> None:
        built.simulators[0].axes[0].physics.v = 0.1

    run, rig = run_rig(data, change=pull), rig_of(data)
    tau = one_way_delay(rig, "a", command_delays(rig))
    trip = round(2.0 * tau / 1e-3)
    # A slow side's sample is a period of its bus old and waits n - 1 slots, its command another n.
    assert trip == 2 * samples + sum(3 * n - 1 if n > 1 else 1 for n in (master, slave))
    whole = math.lcm(trip, master, slave)
    effort = run["master.a.port_effort"]
    slope = (effort[-1] - effort[-1 - whole]) / (0.1 * whole * 1e-3)
    side = "slave" if slave > 1 else "master"
    reported = slow_costs(rig, f"{side}.a", command_delays(rig))["rigid_stiffness"][0]
    assert reported == pytest.approx(slope, rel=1e-6)


@pytest.mark.slow
def test_the_modes_of_the_certificate_are_those_of_the_run() -> None:
    """A spring at 100 Hz behind a filtered line at 1 kHz: least damped pole of the free swing."""
    data = tree(
        slow(1, 10),
        line(5),
        {
            "coupling.pairs.a.wave_filter_hz": 40.0,
            "master.axes.a": {**known_axis("hand", 1.0)},
            "slave.axes.a": {**known_axis("arm", 2.0)},
            "simulation.hand.a": {
                "mass": 0.143, "stiffness": 538.0, "damping": 5.0,
                "reference": {"type": "hold", "position": 0.0},
            },
            "simulation.environment.a": {"type": "spring", "stiffness": 200.0, "position": 0.0},
            "duration_s": 10.0,
        },
    )  # fmt: skip

    def pull(built: Assembly) -> None:
        built.simulators[1].axes[0].physics.v = 0.3

    run, rig = run_rig(data, change=pull), rig_of(data)
    [case] = [
        case
        for case in pair_loop(rig, "a", command_delays(rig)).cases
        if case.mass == "value" and "spring" in case.contact
    ]
    x = run["true.slave.a.position"][2500:9000:10]
    past = np.column_stack([x[at : len(x) - 4 + at] for at in range(4)])
    found = np.linalg.lstsq(past, x[4:], rcond=None)[0]
    roots = np.roots([1.0, *(-found[::-1])])
    worst = roots[np.argmax(np.abs(roots))]
    assert abs(worst) == pytest.approx(case.radius, rel=1e-5)
    assert abs(np.angle(worst)) / (2.0 * np.pi * 0.01) == pytest.approx(case.frequency, rel=1e-4)
    # And a sweep predicts the same: belief and truth are alike here.
    assert pair_mode(rig, "a").radius == pytest.approx(case.radius, rel=1e-9)


def known_axis(bus: str, damping: float) -> Tree:
    return {
        "bus": bus, "id": 1, "kind": "linear", "inertia": known(0.5), "damping": damping,
        "effort_limit": 1000.0, "velocity_limit": 20.0,
    }  # fmt: skip


# -- drift ---------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("master", "slave", "quantum"),
    [(1, 5, 1e-5), (5, 1, 0.0), (5, 1, 1e-5), (3, 7, 1e-5), (1, 25, 0.0), (1, 25, 1e-5)],
)
def test_no_position_drifts_over_contacts(master: int, slave: int, quantum: float) -> None:
    """Pressed and released twice: when all rests, master and slave stand where they stood."""
    way, t = [[0.5, 0.0]], 1.0
    for _ in range(2):
        way += [[t + 1.0, 0.05], [t + 3.0, 0.05], [t + 4.0, -0.02], [t + 6.0, -0.02]]
        t += 6.2
    way.append([t + 1.0, 0.0])
    axis = {"damping": 2.0}
    run = run_rig(
        tree(
            slow(master, slave),
            line(10, 500.0),
            impedance(20.0),
            {
                "duration_s": 24.0,
                "master.axes.a.encoder_quantum": quantum,
                "slave.axes.a.encoder_quantum": quantum,
                "simulation.axes": {"master.a": axis, "slave.a": axis},
                "simulation.hand.a": {"reference": {"type": "minimum_jerk", "waypoints": way}},
                "simulation.environment.a": {
                    "type": "wall", "stiffness": 2000.0, "damping": 20.0, "position": 0.02,
                },
            },
        )
    )  # fmt: skip
    assert np.abs(run["true.slave.a.environment_effort"]).max() > 1.0
    assert abs(run["a.position_error"][-1]) <= quantum + 1e-7


# -- stable where certified ----------------------------------------------------------------------


@pytest.mark.slow
def test_the_shipped_rig_is_certified_and_rests_in_contact() -> None:
    rig = load_rig(CONFIGS / "bench-multirate-loopback.yaml")
    assert certify(rig).passed
    run = run_rig(rig)
    assert_passive(run, "lever")
    assert run.result.lost == (0, 0)
    # Pressed on the environment, and on the arm's own wall: it comes to rest in both.
    for begin, end, column in (
        (2.6, 3.0, "true.slave.lever.environment_effort"),
        (7.8, 8.0, "slave.lever.wall_effort"),
    ):
        pushed = run[column][(run["time_s"] >= begin) & (run["time_s"] < end)]
        assert np.abs(pushed).min() > 0.005
        assert np.ptp(pushed) <= 0.2 * np.abs(pushed).mean()


@pytest.mark.slow
def test_check_and_report_say_what_the_slow_bus_costs(tmp_path: Path) -> None:
    rig = load_rig(CONFIGS / "bench-multirate-loopback.yaml")
    found = check(rig)
    assert dict(found.facts)["rate"].endswith("bus arm every 10 cycles, 100 Hz")
    [element] = [e for e in found.certificate["elements"] if e["kind"] == "converter"]
    cost = element["sentences"][-1]
    for part in ("20 ms (6)", "0.8582 N m/rad at the master (1.848)", "1.333 N m/rad (40)"):
        assert part in cost
    certificate = {**found.certificate, "elements": {element["name"]: element}}
    run = Run(tmp_path, {}, "", summary_of({"certificate": certificate})[0])
    [verdict] = [reported for reported in verdicts(run) if reported.topic == "Certificate"]
    assert cost in verdict.sentences


@pytest.mark.slow
@pytest.mark.parametrize(
    ("divisor", "stiffness", "certified"),
    [(10, 600.0, True), (10, 1500.0, True), (10, 3000.0, False), (5, 3000.0, True),
     (50, 100.0, True)],
)  # fmt: skip
def test_contact_rests_where_the_loop_is_certified(
    divisor: int, stiffness: float, certified: bool
) -> None:
    """A 1 kHz master presses a slow slave on a wall without damping: rest, or knocking for ever.

    It comes to rest as fast as the least damped mode of the certificate in contact says.
    """
    data = tree(
        slow(1, divisor),
        line(5),
        {
            "coupling.pairs.a.wave_filter_hz": 400.0 / divisor,  # below half the slow rate
            "master.axes.a": known_axis("hand", 1.0),
            "slave.axes.a": known_axis("arm", 4.0),
            "simulation.hand.a": {
                "mass": 0.143, "stiffness": 538.0, "damping": 5.0,
                "reference": {
                    "type": "minimum_jerk", "waypoints": [[0.2, 0.0], [0.6, 0.04], [9.0, 0.04]],
                },
            },
            "simulation.environment.a": {
                "type": "wall", "stiffness": stiffness, "position": 0.01,
            },
            "duration_s": 8.0,
        },
    )  # fmt: skip
    rig = rig_of(data)
    loop = pair_loop(rig, "a", command_delays(rig))
    assert loop.verdict.passed is certified
    run = run_rig(data)
    speed = np.abs(run["true.slave.a.velocity"])
    early, late = speed[3000:4000].max(), speed[7000:].max()
    pushed = run["true.slave.a.environment_effort"][-1000:]
    if certified:
        [radius] = {case.radius for case in loop.cases if "wall" in case.contact}
        assert late / early == pytest.approx(radius ** (4000 // divisor), rel=0.2)
        assert pushed.max() < -0.5
    else:
        assert late > 1e-3
        assert pushed.max() == 0.0
    assert_passive(run)  # even then nothing is invented


def test_a_slow_port_looks_ahead_to_the_middle_of_the_period_in_which_it_acts() -> None:
    """A command of a slow bus waits for the next exchange: 1.5 of its periods, not of the loop."""
    rig = load_rig(CONFIGS / "bench-multirate-loopback.yaml")
    delays = command_delays(rig)
    port = end_constants(rig, "slave.lever", delays["slave.lever"]).port
    speed, push = 0.3, 7.0
    effort = port_effort(port, math.inf, speed, push, 0.0, 0.0)
    own = 1.0 + port.impedance * 0.01 / (2.0 * rig.axes["slave.lever"].inertia.lower)
    assert effort == pytest.approx(port.impedance * (speed + 1.5 * 0.01 * push) / own)


@pytest.mark.slow
def test_a_slow_wall_beyond_its_limit_buzzes_and_the_certificate_said_so() -> None:
    rig = load_rig(CONFIGS / "bench-multirate-loopback.yaml")
    costs = slow_costs(rig, "slave.lever", command_delays(rig))
    slow_limit, fast_limit = costs["wall_stiffness"]
    assert slow_limit == pytest.approx(0.02 / (0.01 * 1.5), rel=1e-6)  # b > K T (1/2 + 1)
    assert fast_limit == pytest.approx(0.02 / (0.001 * 0.5), rel=1e-6)
    stiff = [
        load_rig(
            CONFIGS / "bench-multirate-loopback.yaml",
            ["coupling.pairs.lever.wall_slave.stiffness=8", *more],
        )
        for more in ([], ["buses.arm.divisor=1"])
    ]
    slow_rig, fast_rig = stiff
    assert not certify(slow_rig).passed
    assert certify(fast_rig).passed
    made = [books(run_rig(rig), "lever").generated["wall_slave"] for rig in stiff]
    assert made[0] > 20.0 * made[1]
