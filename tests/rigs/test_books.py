"""Energy books of whole runs: they close, and they hold what theory says."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

from tautwave.rig import Assembly
from tests.examples import tried
from tests.rigs.closing import (
    ALL,
    CLIPPED,
    CONTACT,
    EXACT,
    FRICTION,
    MISHAPS,
    MOTION,
    SENSORS,
    WALLS,
    assert_closed,
    check_any,
    delay,
    impedance,
    line,
    port_bound,
)
from tests.rigs.drawing import rigs
from tests.rigs.running import Run, Tree, books, pair_of, run_rig, tree

# -- they close --------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("samples", "b", "features"),
    [
        (0, 10.0, ()), (0, 1.0, ALL), (1, 1.0, (WALLS, FRICTION)), (1, 3000.0, (SENSORS, CLIPPED)),
        (7, 100.0, (WALLS, MISHAPS)), (50, 10.0, (CLIPPED, WALLS, FRICTION)),
        (50, 300.0, ALL), (500, 30.0, (MISHAPS, SENSORS, WALLS)),
    ],
)  # fmt: skip
def test_a_minute_of_contact_closes(samples: int, b: float, features: tuple[Tree, ...]) -> None:
    changes = (MOTION, CONTACT, *features, line(samples, 250.0), impedance(b), {"duration_s": 60.0})
    run = run_rig(tree(*changes, {"loop.missing_limit": 1000}))
    assert run.result.cycles + run.result.missed_cycles == 15_000
    environment = run["true.slave.a.environment_effort"]
    assert np.count_nonzero(np.diff(environment != 0.0)) > 10  # contacts and releases
    assert_closed(run)


@pytest.mark.sparse(3)
@pytest.mark.parametrize("samples", [0, 1, 7, 50, 500])
@pytest.mark.parametrize("b", [0.3, 3.0, 30.0, 300.0, 3000.0])
def test_every_delay_and_impedance_closes(samples: int, b: float) -> None:
    features = ALL if (samples + round(b)) % 2 else (WALLS, FRICTION)
    run = run_rig(
        tree(MOTION, CONTACT, *features, line(samples), impedance(b), {"duration_s": 1.0})
    )
    assert_closed(run)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("samples", "b"),
    [(0, 0.3), (50, 3.0), (500, 300.0)],
)
@pytest.mark.nightly
def test_a_minute_at_one_kilohertz_closes(samples: int, b: float) -> None:
    features = ALL if (samples + round(b)) % 2 else (WALLS, FRICTION)
    more = {"duration_s": 60.0, "loop.missing_limit": 1000}
    run = run_rig(tree(MOTION, CONTACT, *features, line(samples), impedance(b), more))
    assert_closed(run)


@pytest.mark.sparse(4)
@pytest.mark.parametrize("features", [(), ALL], ids=["clean", "everything"])
@pytest.mark.parametrize("periods", [0, 1, 2, 5])
def test_whole_periods_of_command_delay_are_exact_without_gaps(
    periods: int, features: tuple[Tree, ...]
) -> None:
    run = run_rig(tree(MOTION, CONTACT, *features, line(7), delay(periods)))
    found = assert_closed(run)
    if periods == 0 or not features:
        assert found.uncertainty == 0.0
    else:
        # Samples are missing while different commands act: an interval, and it holds the truth.
        assert 0.0 < abs(found.sensing_gap) < found.uncertainty
    if not features:
        # Noise-free, the controller knows exactly what its motors did.
        assert abs(found.sensing_gap) <= EXACT * found.gross_flow


@pytest.mark.sparse(3)
@pytest.mark.parametrize("periods", [0, 1, 3])
@pytest.mark.parametrize("probability", ["missing_probability", "overrun_probability"])
def test_gaps_are_booked_with_the_efforts_that_acted_in_them(
    probability: str, periods: int
) -> None:
    """Over a missing sample the command stays, so even there the books know what acted.

    With a command delay, efforts under way change inside the gap, and a mean effort times the
    whole displacement is no longer exact; the books do not say so yet (`uncertainty` stays 0).
    """
    mishap = {f"simulation.faults.{probability}": 0.05, "simulation.faults.overrun_slots": 4}
    run = run_rig(tree(MOTION, CONTACT, WALLS, line(7), delay(periods), mishap))
    found = assert_closed(run)
    assert run.result.missed_cycles + sum(run.result.lost) > 20
    limit = EXACT if periods == 0 else 1e-2
    assert abs(found.sensing_gap) <= limit * found.gross_flow


@pytest.mark.parametrize("periods", [0.3, 1.5])
def test_a_remainder_of_command_delay_is_an_interval(periods: float) -> None:
    run = run_rig(tree(MOTION, CONTACT, FRICTION, line(7), delay(periods)))
    found = assert_closed(run)
    assert found.uncertainty > 0.0
    assert abs(found.sensing_gap) <= found.uncertainty


@pytest.mark.parametrize("rate", [1000.0, 3000.0, 700.0])
@pytest.mark.parametrize("periods", [1, 2, 3, 7])
def test_a_whole_number_of_periods_has_no_remainder(rate: float, periods: int) -> None:
    options = {"command_delay_s": periods / rate}
    run = run_rig(tree(MOTION, {"rate_hz": rate, "duration_s": 0.05, "buses.arm.options": options}))
    assert run.assembly.buses[1].driver.command_delay == (periods, 0.0)
    assert books(run).uncertainty == 0.0


@pytest.mark.sparse(6)
@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(("scale", "force"), [(3.0, None), (0.25, None), (1.0, 4.0), (2.0, 0.1)])
def test_scaling_closes_too(scale: float, force: float | None, sign: int) -> None:
    changes: Tree = {
        "coupling.pairs.a.position_scale": scale,
        "coupling.pairs.a.force_scale": force,
        "coupling.pairs.a.sign": sign,
        "coupling.pairs.a.wave_filter_hz": 80.0,
    }
    run = run_rig(tree(MOTION, CONTACT, WALLS, line(7), changes, {"duration_s": 2.0}))
    assert_closed(run)
    # It does scale: the slave's motion is the master's times scale and sign, free of contact.
    free = run_rig(tree(MOTION, line(1), impedance(50.0), changes, {"duration_s": 2.0}))
    master, slave = free["true.master.a.position"], free["true.slave.a.position"]
    slope = float(np.dot(master, slave) / np.dot(master, master))
    assert slope == pytest.approx(sign * scale, rel=0.3)
    ratio = (force if force is not None else 1.0 / scale) * scale
    assert 1.0 / pair_of(free.assembly).params.weight == pytest.approx(ratio)


def test_the_line_holds_what_its_books_say() -> None:
    run = run_rig(tree(MOTION, CONTACT, line(50)))
    pair = pair_of(run.assembly)
    waves = np.array(pair.control.table[pair.params.line :])
    held = 0.5 * pair.params.period * float(np.sum(waves * waves))
    assert held > 0.0
    assert run["a.line.stored"][-1] == pytest.approx(held, rel=1e-9)


def test_admittance_axes_close_as_intervals() -> None:
    changes: Tree = {
        "slave.axes.a": {
            "bus": "arm", "id": 1, "kind": "linear", "causality": "admittance",
            "effort_limit": 100.0, "velocity_limit": 2.0, "environment_stiffness_upper": 400.0,
        },
        "simulation.environment.a": {"type": "spring", "stiffness": 300.0, "position": 0.0},
    }  # fmt: skip
    run = run_rig(tree(MOTION, line(7), changes))
    found = assert_closed(run)
    assert found.uncertainty > 0.0
    assert abs(found.sensing_gap) <= found.uncertainty


# -- what elements generate --------------------------------------------------------------------


@pytest.mark.sparse(6)
@pytest.mark.parametrize("samples", [0, 7, 50])
@pytest.mark.parametrize("b", [1.0, 30.0, 1000.0])
def test_a_port_generates_no_more_than_its_bound(samples: int, b: float) -> None:
    for features in ((), (SENSORS,), (CLIPPED, FRICTION), (WALLS, CLIPPED)):
        run = run_rig(tree(MOTION, CONTACT, *features, line(samples), impedance(b)))
        found = assert_closed(run)
        for side in ("master", "slave"):
            assert found.generated[f"port_{side}"] <= port_bound(run, side), (features, side)


def test_saturation_inside_a_wall_is_the_walls() -> None:
    """A wall far stiffer than the motor is strong takes next to nothing out of the port's tank."""
    wall = {"position": 0.01, "stiffness": 2e5}
    run = run_rig(
        tree(MOTION, line(7), CLIPPED, {"coupling.pairs.a.wall_master": wall, "duration_s": 2.0})
    )
    found = assert_closed(run)
    assert run["master.a.wall_effort"].max() <= 3.0
    reserve = pair_of(run.assembly).axes["master"][0].end.port.reserve
    assert found.generated["port_master"] <= 0.05 * reserve


def bounce(b_device: float, controlled: bool = False, phase: float = 0.5) -> Run:
    """A free slave flies into its own wall, with next to no coupling."""
    data = tree(
        impedance(1e-9),
        {
            "slave.axes.a.inertia": {"value": 0.1, "lower": 0.1, "source": "x"},
            "simulation.axes": {"slave.a": {"damping": b_device, "start_position": -1e-3 * phase}},
            "coupling.pairs.a.wall_slave": {
                "position": 0.0, "stiffness": 1000.0, "passivity_control": controlled,
            },
            "duration_s": 0.06,
        },
    )  # fmt: skip

    def throw(built: Assembly) -> None:
        built.simulators[1].axes[0].physics.v = 1.0

    return run_rig(data, change=throw)


def test_a_bare_wall_generates_what_theory_says_and_a_controlled_one_nothing() -> None:
    start = 0.5 * 0.1
    phases = [(k + 0.5) / 8 for k in range(8)]
    runs = [bounce(0.0, phase=phase) for phase in phases]
    generated = np.mean([books(run).generated["wall_slave"] for run in runs])
    predicted = math.expm1(0.5 * math.pi * math.sqrt(1000.0 / 0.1) * 1e-3) * start
    assert generated == pytest.approx(predicted, rel=0.01)
    gained = np.mean([run["true.slave.a.velocity"][-1] ** 2 for run in runs])
    assert gained == pytest.approx(1.1698, abs=3e-4)
    for phase in phases:
        run = bounce(0.0, controlled=True, phase=phase)
        assert books(run).generated["wall_slave"] <= 1e-12
        assert run["true.slave.a.velocity"][-1] == pytest.approx(-1.0, abs=1e-8)


def test_wall_and_damped_device_together_generate_nothing() -> None:
    """b = K T / 2: what the wall gives, the device's own damping takes, by the plant's books."""
    for phase in (0.1, 0.4, 0.7, 0.95):
        run = bounce(0.5, phase=phase)
        into = -run["plant.slave.a.motor_work"] + run["plant.slave.a.viscous_loss"]
        assert into.min() >= -1e-12
        assert books(run).generated["wall_slave"] > 1e-3  # the wall alone does leak


# -- any rig -----------------------------------------------------------------------------------


@settings(max_examples=tried(25), suppress_health_check=list(HealthCheck))
@given(rigs(cycles=250))
def test_the_books_of_any_rig_close(data: Tree) -> None:
    check_any(data)


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.timeout(900)  # shrinking a counterexample takes its time
@settings(max_examples=80, suppress_health_check=list(HealthCheck))
@given(rigs(cycles=600))
def test_the_books_of_many_rigs_close(data: Tree) -> None:
    check_any(data)
