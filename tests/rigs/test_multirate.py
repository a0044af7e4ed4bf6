"""Rigs with slow buses: nothing is invented, nothing drifts, and it is stable where certified."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tautwave.analysis.conversion import hold_matrix, pick_matrix
from tautwave.certificate import certify
from tautwave.certificate.loops import pair_loop
from tautwave.certificate.rates import slow_costs
from tautwave.config import load_rig
from tautwave.laws.port import port_debt
from tautwave.offline.sweep_predict import pair_mode
from tautwave.rig import Assembly, command_delays, one_way_delay
from tautwave.runtime import rates
from tests.rigs.drawing import rigs
from tests.rigs.running import Run, Tree, books, forgiven, rig_of, run_rig, tree
from tests.rigs.test_books import (
    ALL,
    CLOSED,
    CONTACT,
    EXACT,
    FRICTION,
    MISHAPS,
    MOTION,
    SENSORS,
    assert_closed,
    impedance,
    line,
)

CONFIGS = Path(__file__).parents[2] / "configs"


def slow(master: int, slave: int) -> Tree:
    return {"buses.hand.divisor": master, "buses.arm.divisor": slave}


def known(value: float) -> Tree:
    return {"value": value, "lower": value, "source": "x"}


def port_bound(run: Run, side: str, name: str) -> float:
    """Return what a port may have generated [J, pair]: forgiven noise and `port_debt`."""
    pair = next(at.pair for at in run.assembly.pairs if at.pair.name == name)
    site = getattr(pair, side)
    weight = 1.0 if side == "master" else pair.weight
    port = site.params.port
    fastest = np.abs(np.diff(run[f"{side}.{name}.position"])).max(initial=0.0) / port.period
    delay = len(site._pipe) + (1 if site._late else 0)
    owed = port_debt(port, delay, fastest, site.gross_flow)
    # A velocity filter's prediction lags as well; at any one rate with a command delay, too.
    owed *= 1.0 if site.params.gain == 1.0 else 2.0
    return forgiven(run, side, name) + weight * owed


def assert_passive(run: Run, name: str = "a", bounded: bool = True) -> None:
    """The books close; converters generate nothing; the pair no more than ports and walls may."""
    found = assert_closed(run, name)
    allowed = 0.0
    for element, energy in found.generated.items():
        if element.startswith("converter"):
            assert energy <= EXACT * found.gross_flow
            lost = run[f"{name}.{element}.dissipated"]
            assert np.all(np.diff(lost) >= 0.0)
        if element.startswith("port"):
            side = element.removeprefix("port_")
            bound = port_bound(run, side, name) * (1.0 + 1e-9) + 1e-15
            if bounded:
                assert energy <= bound
            allowed += max(bound, energy)
        if element.startswith("wall"):
            allowed += energy  # a sampled wall leaks what the device's damping has to cover
    taken = sum(run[f"{side}.{name}.port_energy"] for side in ("master", "slave"))
    assert taken.min() >= -allowed - CLOSED * found.gross_flow


# -- any rig -------------------------------------------------------------------------------------


@st.composite
def slow_rigs(draw: st.DrawFn, cycles: int) -> Tree:
    """Random rigs of `drawing.rigs` whose buses have divisors of 1 to 50."""
    data = draw(rigs(cycles=cycles))
    ratios = st.one_of(st.just(1), st.integers(2, 10), st.integers(2, 50))
    divisors = {"master": draw(ratios), "slave": draw(ratios)}
    for side, bus in (("master", "hand"), ("slave", "arm")):
        divisor = divisors[side]
        data["buses"][bus]["divisor"] = divisor
        for pair in data["coupling"]["pairs"].values():
            wall = pair.get(f"wall_{side}")
            if wall is not None:  # to the edge of stability at that rate
                wall["stiffness"] /= divisor**2
                wall["damping"] /= divisor
    nyquist = 500.0 / divisors["master"]
    for hand in data["simulation"]["hand"].values():
        for component in hand["reference"]["components"]:
            component[0] = min(component[0], 0.9 * nyquist)
    return data


def check_any(data: Tree) -> None:
    run = run_rig(data)
    faults = data["simulation"]["faults"]
    held = faults["missing_probability"] > 0.0 or faults["overrun_probability"] > 0.0
    for name in data["coupling"]["pairs"]:
        if books(run, name).gross_flow < 1e-12:
            continue  # nothing moved
        limited = any("effort_rate_limit" in data[s]["axes"][name] for s in ("master", "slave"))
        # Else efforts act on that nobody planned.
        assert_passive(run, name, bounded=not (held or limited))


@settings(max_examples=25, suppress_health_check=list(HealthCheck))
@given(slow_rigs(cycles=400))
def test_no_rig_with_slow_buses_generates_energy(data: Tree) -> None:
    check_any(data)


@pytest.mark.slow
@pytest.mark.timeout(900)  # shrinking a counterexample takes its time
@settings(max_examples=300, suppress_health_check=list(HealthCheck))
@given(slow_rigs(cycles=1500))
def test_many_rigs_with_slow_buses_generate_no_energy(data: Tree) -> None:
    check_any(data)


@pytest.mark.parametrize(
    ("master", "slave", "samples", "b", "features"),
    [
        (1, 10, 0, 10.0, ()), (1, 10, 7, 3.0, ALL), (10, 1, 7, 100.0, (MISHAPS,)),
        (3, 7, 5, 30.0, (SENSORS, FRICTION)), (7, 3, 50, 30.0, ALL), (50, 49, 20, 10.0, (MISHAPS,)),
    ],
)  # fmt: skip
def test_ten_seconds_of_contact_close(
    master: int, slave: int, samples: int, b: float, features: tuple[Tree, ...]
) -> None:
    more = {"duration_s": 10.0, "loop.missing_limit": 1000}
    # The slow master's hand is slow as well, and its walls are not for 20 Hz.
    calm = {"coupling.pairs.a.wall_master": None, "coupling.pairs.a.wall_slave": None}
    hand = {"simulation.hand.a.reference.components": [[0.5, 0.04, 0.0], [2.3, 0.02, 1.0]]}
    changes = (MOTION, CONTACT, *features, line(samples), impedance(b), slow(master, slave))
    run = run_rig(tree(*changes, more, calm, hand))
    environment = run["true.slave.a.environment_effort"]
    assert np.count_nonzero(np.diff(environment != 0.0)) > 5  # contacts and releases
    assert_passive(run, bounded=not features or MISHAPS not in features)


@pytest.mark.parametrize(("master", "slave"), [(1, 10), (10, 1), (3, 7), (1, 50)])
def test_the_controller_knows_what_slow_motors_did(master: int, slave: int) -> None:
    """Without noise or gaps both books agree to the last bit, in the slots where a bus is read."""
    hand = {"simulation.hand.a.reference.components": [[0.5, 0.04, 0.0], [2.3, 0.02, 1.0]]}
    run = run_rig(tree(MOTION, CONTACT, line(7), slow(master, slave), hand, {"duration_s": 3.0}))
    flow = books(run).gross_flow
    for side, divisor in (("master", master), ("slave", slave)):
        served = np.arange(len(run.table)) % divisor == divisor - 1
        sent = run[f"{side}.a.port_energy"][served]
        motor = run[f"plant.{side}.a.motor_work"][served]
        assert np.abs(sent + motor).max() <= EXACT * flow
    assert books(run).uncertainty == 0.0


def test_a_slow_admittance_slave_closes_as_an_interval() -> None:
    changes: Tree = {
        "slave.axes.a": {
            "bus": "arm", "id": 1, "kind": "linear", "causality": "admittance",
            "effort_limit": 100.0, "velocity_limit": 2.0, "environment_stiffness_upper": 400.0,
        },
        "simulation.environment.a": {"type": "spring", "stiffness": 300.0, "position": 0.0},
        "duration_s": 2.0,
    }  # fmt: skip
    data = tree(MOTION, line(7), changes, slow(1, 10))
    run = run_rig(data)
    found = assert_closed(run)
    assert found.generated["converter_slave"] == 0.0
    assert abs(found.sensing_gap) <= found.uncertainty
    # Its drive of 2 ms settles within the 10 ms of its bus: certified, which at 1 ms it is not.
    assert certify(rig_of(data)).verdicts["passive"].passed
    quick = certify(rig_of(tree(MOTION, line(7), changes)))
    assert not quick.verdicts["passive"].passed


def test_free_masses_gain_nothing_at_any_ratio() -> None:
    """Thrown and left alone, the kinetic energy of both is at no time more than at the start."""
    for master, slave, samples, b in [(1, 10, 5, 10.0), (10, 1, 0, 3.0), (3, 7, 2, 30.0),
                                      (1, 50, 20, 5.0), (49, 50, 1, 2.0)]:  # fmt: skip

        def throw(built: Assembly) -> None:
            built.simulators[0].axes[0].physics.v = 0.3

        data = tree(slow(master, slave), line(samples), impedance(b), {"duration_s": 5.0})
        run = run_rig(data, change=throw)
        kinetic = sum(run[f"plant.{side}.a.kinetic"] for side in ("master", "slave"))
        assert kinetic.max() <= 0.5 * 0.5 * 0.3**2 * (1.0 + 1e-9)
        for energy in books(run).generated.values():
            assert energy <= 1e-12


def test_picking_instead_of_averaging_fails_the_same_books(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It can fail: every n-th wave instead of the mean generates, and the account says so."""
    assert pick_matrix(10).shape == hold_matrix(10).T.shape

    def pick(count: int, mean: float, wave: float) -> tuple[float, float]:
        return wave, 0.0

    monkeypatch.setattr(rates, "gather_wave", pick)
    run = run_rig(tree(MOTION, CONTACT, line(7), slow(1, 10), {"duration_s": 3.0}))
    with pytest.raises(AssertionError):
        assert_passive(run)


# -- closed forms --------------------------------------------------------------------------------


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
    run, rig = run_rig(data), rig_of(data)
    pair = run.assembly.pairs[0].pair
    # A port that is held still gives a share of the line's effort (facts: held_share).
    efforts = [
        side * site.port_effort * (1.0 + 10.0 * site.params.port.period * (1 + delay) / 0.4)
        for side, site, delay in ((1.0, pair.master, int(master > 1)),
                                  (-1.0, pair.slave, int(slave > 1)))
    ]  # fmt: skip
    assert efforts[0] > 1.0
    assert efforts[0] == pytest.approx(efforts[1], rel=1e-6)
    tau = one_way_delay(rig, "a", command_delays(rig))
    unsent = (pair.master.gap - pair.slave.gap) / pair.master.params.port.root
    assert run["a.position_error"][-1] - unsent == pytest.approx(efforts[0] * tau / 10.0, rel=1e-5)


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
    told = slow_costs(rig, f"{side}.a", command_delays(rig))["rigid_stiffness"][0]
    assert told == pytest.approx(slope, rel=1e-6)


def test_the_modes_of_the_certificate_are_those_of_the_run() -> None:
    """A spring at 100 Hz behind a filtered line at 1 kHz: least damped pole of the free swing."""
    data = tree(
        slow(1, 10),
        line(5),
        {
            "coupling.wave_filter_hz": 60.0,
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
        "effort_limit": 1000.0,
    }  # fmt: skip


# -- drift ---------------------------------------------------------------------------------------


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


def settled(run: Run, name: str, begin: float, end: float) -> float:
    """Return the largest swing of a column over a stretch of time, each end 0.1 s later [1]."""
    time = run["time_s"]
    return float(np.ptp(run[name][(time >= begin) & (time < end)]))


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
