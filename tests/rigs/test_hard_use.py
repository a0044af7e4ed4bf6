"""Levers that are swung hard with almost no noise declared: tanks keep their reserve."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tautwave.analysis.wave_port.effort_step import COARSEST
from tautwave.certificate.verdict import certify
from tautwave.controller.records import AxisState
from tautwave.couplings.wave.port import (
    OWED_PERIODS,
    PORT_STARVED,
    PORT_STARVED_COARSE,
    PORT_STARVED_NOISY,
    PORT_STARVED_PLAIN,
    WaveEnd,
    judge_port,
    listen_to,
)
from tautwave.laws.observer import plain_observer
from tautwave.rig import command_delays
from tautwave.rig.controller import end_constants
from tautwave.simulation import simulate
from tests.certificate.rigs import rig

pytest.importorskip("numba")

SIDES = ("master", "slave")
QUIET = [f"{side}.axes.lever.position_noise=0" for side in SIDES]
ENVIRONMENT = "simulation.environment.lever"

LITTLE_FRICTION = [
    f"simulation.axes.{side}.lever={{damping: 2.0e-3, coulomb: 1.0e-3}}" for side in SIDES
]
SPRING = f"{ENVIRONMENT}={{type: spring, stiffness: 6, position: 0}}"


def played(hertz: float, reach: float, seconds: float, *changes: str):
    swing = f"{{type: multisine, ramp_s: 0.5, components: [[{hertz}, {reach}, 0.0]]}}"
    given = [f"simulation.hand.lever.reference={swing}", f"duration_s={seconds}", *QUIET, *changes]
    return simulate(rig(*given, name="bench-1dof-2khz"), engine="compiled")


def swung(hertz: float, reach: float, *changes: str) -> float:
    """Return the least that a tank held [J, beyond its reserve] in six seconds."""
    run = played(hertz, reach, 6.0, *changes)
    assert run.error is None
    return min(float(run[f"lever.port_{side}.stored"].min()) for side in SIDES)


def test_a_stiff_spring_moved_fast() -> None:
    """Its tank lost 0.6 mW and was empty after 17 s: its observer lags behind a ramping push."""
    assert swung(3.0, 0.25, f"{ENVIRONMENT}={{type: spring, stiffness: 3, position: 0}}") > -1e-3


def test_a_heavier_device_swung_freely() -> None:
    assert swung(3.0, 0.25, f"{ENVIRONMENT}={{type: free}}") > -1e-4


def test_steps_of_the_effort() -> None:
    """Truncation takes half a step times the speed from an end that absorbs; it is carried over."""
    steps = [f"{side}.axes.lever.effort_quantum=5.0e-3" for side in SIDES]
    friction = "simulation.axes.slave.lever.damping=0.03"
    assert swung(2.0, 0.3, f"{ENVIRONMENT}={{type: free}}", friction, *steps) > -1e-3


def test_a_coarse_step_of_the_effort() -> None:
    """A third of the limit, on levers that nothing brakes: they limit-cycle, and are followed."""
    step = [f"{side}.axes.lever.effort_quantum=0.3" for side in SIDES]
    slick = [f"simulation.axes.{side}.lever.coulomb=0" for side in SIDES]
    run = played(0.05, 0.2, 20.0, f"{ENVIRONMENT}={{type: free}}", *step, *slick)
    assert run.error is None
    assert min(float(run[f"lever.port_{side}.stored"].min()) for side in SIDES) > -1e-3
    assert np.abs(run["lever.position_error"]).max() < 0.02


def test_a_step_too_coarse_for_the_port_is_refused_with_the_greatest() -> None:
    """Half of 0.05 N m s/rad times 15 rad/s."""
    sizes = [f"{side}.axes.lever.effort_quantum=0.376" for side in SIDES]
    found = certify(rig(*sizes, name="bench-1dof-2khz"))
    assert not found.passed
    assert all("at most 0.375 works" in why for why in found.sentences())


def held(*changes: str) -> tuple[float, float]:
    """Return the master's effort in a press, and its chatter about 50 ms' mean [N m]."""
    press = "{type: minimum_jerk, waypoints: [[0.0, 0.0], [0.8, 0.3]]}"
    wanted = (f"simulation.hand.lever.reference={press}", "duration_s=5", *changes)
    run = simulate(rig(*wanted, name="bench-1dof-2khz"), engine="compiled")
    assert run.error is None
    late = run["master.lever.port_effort"][-4000:]
    smooth = np.convolve(late, np.full(100, 0.01), "same")
    return float(late.mean()), float((late - smooth)[100:-100].std())


FAULTS = {
    "one sample in twenty is lost": "missing_probability: 0.05",
    "three slots are skipped at one in a hundred": "overrun_probability: 0.01, overrun_slots: 3",
}


@pytest.mark.parametrize("faults", FAULTS.values(), ids=FAULTS)
def test_a_held_force_does_not_feel_what_the_host_loses(faults: str) -> None:
    """With null waves for such slots it was lost within 15 s, and half of it was chatter before."""
    clean, quiet = held()
    mean, chatter = held(f"simulation.faults={{{faults}}}")
    assert mean == pytest.approx(clean, rel=0.05)
    assert chatter < 1.8 * quiet


def test_the_mean_of_a_held_effort_is_exact() -> None:
    step = 5.0e-3
    press = "{type: minimum_jerk, waypoints: [[0.2, 0.0], [0.7, 0.1176]]}"
    changes = [f"simulation.hand.lever.reference={press}", "duration_s=6", *QUIET]
    for side in SIDES:
        changes.append(f"{side}.axes.lever.encoder_quantum=0")
        changes.append(f"simulation.axes.{side}.lever.coulomb=0")
    means = []
    for quantum in (0.0, step):
        own = [f"{side}.axes.lever.effort_quantum={quantum}" for side in SIDES]
        run = simulate(rig(*changes, *own, name="bench-1dof-2khz"), engine="compiled")
        effort = run["slave.lever.port_effort"][(run["time_s"] > 3.0) & (run["time_s"] < 5.0)]
        means.append(float(effort.mean()))
    assert means[1] == pytest.approx(means[0], abs=0.01 * step)


def test_an_empty_tank_is_no_reason_to_stop_where_the_other_lever_still_follows() -> None:
    run = played(5.0, 0.15, 50.0, SPRING, *LITTLE_FRICTION)
    assert run.error is None
    assert run["lever.port_master.stored"].min() < -0.98 * 0.01
    error = run["lever.position_error"]
    early, late = error[10_000:20_000], error[85_000:95_000]
    assert np.std(late) < 1.02 * np.std(early)


def test_a_lever_that_is_moved_and_no_longer_followed_ends_the_run() -> None:
    loud = [f"simulation.axes.{side}.lever.position_noise=5.0e-4" for side in SIDES]
    run = played(3.0, 0.1, 20.0, f"{ENVIRONMENT}={{type: free}}", *loud)
    assert "lost its coupling" in str(run.error)
    assert run["time_s"][-1] < 4.0


def test_the_coarsest_step_is_a_share_of_what_the_impedance_makes_of_the_fastest_motion() -> None:
    made = rig(name="bench-1dof-2khz")
    for axis in ("master.lever", "slave.lever"):
        k = end_constants(made, axis, command_delays(made)[axis])
        fastest = made.axes[axis].velocity_limit
        assert fastest is not None
        assert k.coarse == pytest.approx(COARSEST * k.port.impedance * fastest)


@pytest.mark.parametrize(
    ("share", "gap", "before", "port_starved"),
    [
        (0.05, 1.0, 1.0, True),
        (0.05, 1.0, 1.02, False),  # it is being repaid
        (0.05, 1.0, -1.0, False),  # it comes and goes
        (0.2, 1.0, -1.0, True),  # whichever way: next to nothing follows
        (5e-4, 1.0, 1.0, False),
        (0.05, 0.03, 0.03, False),  # nobody feels it
    ],
)
def test_what_a_lost_coupling_is(
    share: float, gap: float, before: float, port_starved: bool
) -> None:
    """Of waves of 1 W over a second, of which `share` was cut, and means of what is owed."""
    made = rig(name="bench-1dof-2khz")
    k = end_constants(made, "slave.lever", command_delays(made)["slave.lever"])
    few = OWED_PERIODS * made.period_s * 2000.0 * 10.0
    s = AxisState(end=WaveEnd(cut_before=True, gap_before=before * few))
    s.end.wanted_sum, s.end.cut_sum, s.end.gap_sum = 2000.0, 2000.0 * share, gap * few
    judge_port(s, k)
    assert (s.alarm == PORT_STARVED) is port_starved


@pytest.mark.parametrize(
    ("changed", "noise", "cause", "number"),
    [
        ({}, 4.0e-5, PORT_STARVED, 0.1),
        ({}, 3.0e-4, PORT_STARVED_NOISY, 3.0e-4),
        ({"step": 0.8}, 3.0e-4, PORT_STARVED_COARSE, 0.375),
        ({"observer": plain_observer(5e-4, 1.1e-3)}, 4.0e-5, PORT_STARVED_PLAIN, 0.1),
        ({"observer": plain_observer(5e-4, 1.1e-3)}, 3.0e-4, PORT_STARVED_NOISY, 3.0e-4),
    ],
)
def test_what_took_the_energy(
    changed: dict[str, Any], noise: float, cause: int, number: float
) -> None:
    """By declared steps, then by the samples of a second; the bench has a leak for 4.5e-5 rad."""
    made = rig(name="bench-1dof-2khz")
    k = end_constants(made, "slave.lever", command_delays(made)["slave.lever"])
    k = k._replace(**changed)
    s = AxisState(end=WaveEnd(cut_before=True))
    samples = 0.3 * np.sin(0.01 * np.arange(2000)) + np.random.default_rng(1).normal(0, noise, 2000)
    for displacement in np.diff(samples).tolist():
        listen_to(s, displacement, 1.0)
    s.end.wanted_sum, s.end.cut_sum = 2000.0, 500.0
    judge_port(s, k)
    assert s.alarm == cause
    assert s.found == 25.0
    assert s.allowed == pytest.approx(number, rel=0.05)


def test_a_second_after_missing_samples_is_listened_to_anew() -> None:
    """Displacements of two periods beside those of one are no noise."""
    s = AxisState(end=WaveEnd())
    for count in (1.0, 1.0, 1.0, 2.0, 1.0, 1.0, 1.0):
        listen_to(s, count * 1e-3, count)
    assert s.end.third_sum == 0.0
    assert s.end.third_count == 2
