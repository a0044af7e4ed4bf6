"""Ports, couplings and the loop: what the proofs cover, and what the exact loop says."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tautwave.analysis.ports.loop_modes import least_damped
from tautwave.analysis.ports.sampled_loop import Device, close_loop
from tautwave.analysis.walls.sampled import SampledWall
from tautwave.analysis.walls.stability import wall_mode
from tautwave.analysis.wave_port.admittance_loop import Outside, admittance_end
from tautwave.certificate.belief import declared_delays
from tautwave.certificate.loops import believed_end
from tautwave.laws.servo.admittance import admittance_params, greatest_stiffness, rigid_port
from tests.analysis.ends import port_end, reflecting_end, site_of
from tests.certificate.rigs import NO_QUANTUM, NO_WALLS, PAIR, certified, element, rig, wall

BARE = (*NO_WALLS, *NO_QUANTUM, f"{PAIR}.wave_filter_hz=")


# -- wave ports -----------------------------------------------------------------------------------


@pytest.mark.parametrize("periods", [0, 1, 3])
def test_a_wave_port_is_passive_for_whole_command_delays(periods: int) -> None:
    late = f"buses.arm.options={{command_delay_s: {periods * 1e-3}}}"
    certificate = certified(*NO_WALLS, *NO_QUANTUM, late, "loop.overrun_limit=5")
    port = element(certificate, "slave.lever port")
    assert port.passive.state == "passed"
    assert port.numbers["gain"] <= 1.0 + 1e-6
    assert certificate.verdicts["passive_quantised"].passed


def test_a_share_of_a_period_is_not_covered() -> None:
    certificate = certified(*NO_WALLS, "buses.arm.options={command_delay_s: 0.0014}")
    port = element(certificate, "slave.lever port")
    assert not certificate.passed
    assert "act 0.4 ms later than a whole number of periods" in port.passive.reason
    assert element(certificate, "master.lever port").passive.passed


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("simulation.axes.slave.lever.inertia=9.0e-4", "simulated inertia 0.0009 is below"),
        ("simulation.axes.slave.lever.command_delay_s=0.001", "commands act after 0.001 s"),
    ],
)
def test_a_simulation_that_contradicts_a_belief_fails(change: str, words: str) -> None:
    assert words in certified(*NO_WALLS, change).sentences()[0]


def test_an_assumed_mass_makes_it_conditional() -> None:
    inertia = "{value: 1.5e-3, lower: 1.0e-3, source: assumed}"
    verdict = certified(f"slave.axes.lever.inertia={inertia}").verdicts["passive"]
    assert verdict.state == "conditional"
    assert "inertia of slave.lever" in verdict.conditions[0]


def test_noise_in_a_line_that_loses_nothing_is_refused_with_the_filter_to_add() -> None:
    port = element(certified(*NO_WALLS, f"{PAIR}.wave_filter_hz="), "slave.lever port")
    assert "add coupling.pairs.lever.wave_filter_hz: 100" in port.passive.reason
    matched = (f"{PAIR}.wave_filter_hz=", f"{PAIR}.matched_slave=true")
    port = element(certified(*NO_WALLS, *matched), "slave.lever port")
    assert "wave_filter_hz" not in port.passive.reason


@pytest.mark.slow
def test_matched_ends_filters_scaling_and_the_line_are_passive() -> None:
    changes = ("matched_slave=true", "matched_master=true", "force_scale=3.0")
    certificate = certified(*(f"{PAIR}.{change}" for change in changes))
    assert certificate.passed
    kinds = {e.kind: e.passive.passed for e in certificate.elements}
    assert kinds == dict.fromkeys(("wall", "port", "line", "filter", "scaling"), True)
    assert "power scaled by 3" in element(certificate, "scaling of lever").passive.reason


@pytest.mark.slow
def test_encoder_steps_are_paid_for_and_so_not_passive_with_them() -> None:
    port = element(certified(*NO_WALLS), "slave.lever port")
    assert not port.passive_quantised.passed
    assert port.numbers["leak"] > 0.0


# -- admittance ports -----------------------------------------------------------------------------


def test_an_admittance_port_needs_its_bound_and_a_prompt_drive() -> None:
    name, key = "bench-admittance-loopback", "simulation.axes.slave.lever.velocity_time_constant_s"
    slow = element(certified(name=name), "slave.lever port")
    assert not slow.passive.passed
    assert "time constant of 2 ms" in slow.passive.reason
    prompt = element(certified(f"{key}=1.0e-4", name=name), "slave.lever port")
    assert prompt.passive.state == "conditional"
    assert "known from its samples only" in prompt.passive.conditions[-1]
    assert 0.0 < prompt.numbers["reserve"] < prompt.numbers["seen_j"]
    assert "reaches its velocity within one period" in prompt.passive.conditions[0]
    damped = "simulation.environment.lever={type: wall, position: 0.1, stiffness: 1, damping: 0.1}"
    found = element(certified(f"{key}=1.0e-4", damped, name=name), "slave.lever port")
    assert not found.passive.passed
    assert "the proof assumes a pure spring as environment" in found.passive.reason
    late = "buses.arm.options.command_delay_s=4.0e-4"
    found = element(certified(f"{key}=1.0e-4", late, name=name), "slave.lever port")
    assert not found.passive.passed
    assert "act 0.4 ms later than a whole number of periods" in found.passive.reason
    bound = "slave.axes.lever.environment_stiffness_upper"
    for value, words in (("0", "no guarantee"), ("0.5", "has 1 N m/rad, more than")):
        found = element(
            certified(f"{key}=1.0e-4", f"{bound}={value}", name=name), "slave.lever port"
        )
        assert not found.passive.passed
        assert words in found.passive.reason


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_the_plain_admittance_port_loses_stability_where_the_closed_form_says(delay: int) -> None:
    period, impedance = 1e-3, 0.03
    limit = greatest_stiffness(period, impedance, delay)
    law = admittance_params(period, impedance, 0.0, delay)
    port = rigid_port(period, impedance, filter_gain=1.0, reserve=1.0, leak=0.0)
    for factor, stable in ((0.999, True), (1.001, False)):
        outside = Outside(stiffness=factor * limit)
        end = admittance_end(outside, port, law, delay_periods=delay)
        mode = least_damped(end, reflecting_end(0.0), 0, period)
        assert (mode.radius < 1.0) is stable


# -- position coupling ----------------------------------------------------------------------------


def test_a_delayed_position_coupling_says_what_it_needs_and_passes_where_that_is() -> None:
    certificate = certified(name="bench-position-coupling")
    assert certificate.passed  # it requires coupled_stable
    verdict = certificate.verdicts["passive"]
    assert not verdict.passed
    [numbers] = [e.numbers for e in certificate.elements]
    assert numbers["needed"] == pytest.approx(
        1.5e-3 + 2.0 * 4e-3, rel=1e-4
    )  # K T + 2 B, at Nyquist
    rich = [f"{side}.axes.lever.damping=1.0" for side in ("master", "slave")]
    rich += [f"simulation.axes.{side}.lever.damping=1.0" for side in ("master", "slave")]
    assert certified(*rich, name="bench-position-coupling").verdicts["passive"].passed


def test_a_position_coupling_loses_stability_with_delay() -> None:
    certificate = certified("coupling.delay_s=0.05", name="bench-position-coupling")
    assert not certificate.passed
    [sentence] = certificate.sentences()
    assert "unstable" in sentence
    assert "0.143 kg, 5 N s/m, 538 N/m at a lever arm of 0.075 m" in sentence


# -- the loop -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("delay", "gain"), [(0.0, 1.0), (2.0, 0.3), (1.4, 0.5)])
def test_a_pressed_wall_in_the_loop_is_the_wall_of_the_wall_analysis(
    delay: float, gain: float
) -> None:
    period = 1e-3
    sampled = SampledWall(300.0, 0.4, period, delay, period / gain - period)
    device = Device(0.2, 0.5, 20.0)
    whole = math.floor(delay)
    site = site_of(period, 0.1, whole, delay - whole, gain=gain)
    site = site._replace(wall_stiffness=300.0, wall_damping=0.4)
    end = port_end(device._replace(command_delay=delay), site, 1e-12)  # next to no port
    roots = np.linalg.eigvals(close_loop(end, reflecting_end(0.0), 0))
    moving = roots[np.abs(roots - 1.0) > 1e-7]
    assert np.abs(moving).max() == pytest.approx(wall_mode(sampled, device).radius, rel=1e-9)


def test_a_wall_too_stiff_is_unstable_and_said_to_be() -> None:
    for stiffness, stable in ((5.0, True), (12.0, False)):
        certificate = certified(wall(stiffness), "require=coupled_stable")
        assert certificate.passed is stable
    [sentence] = certificate.sentences()
    assert "in contact with the slave's wall" in sentence
    assert "Lower the wall's stiffness" in sentence
    walls = [case for case in certificate.loops[0].cases if "slave's wall" in case.contact]
    assert any(not case.stable and case.radius > 1.0 for case in walls)


@pytest.mark.slow
def test_an_unstable_contact_with_the_environment_is_no_fault_of_a_local_wall() -> None:
    steel = "simulation.environment.lever={type: wall, position: 0.15, stiffness: 5.0e+3}"
    changes = (*BARE, steel, f"{PAIR}.wave_impedance=5", "require=coupled_stable")
    [sentence] = certified(*changes).sentences()
    assert "in contact with the simulation's wall" in sentence
    assert "Lower wave_impedance 5" in sentence


def test_the_hand_is_the_simulations_else_the_seeds() -> None:
    heavy = certified("simulation.hand.lever.mass=0.5").loops[0]
    assert heavy.hand.startswith("the simulation's hand: 0.5 kg")
    nobody = certified("simulation={}").loops[0]
    assert nobody.hand == ("a typical hand: 0.143 kg, 5 N s/m, 538 N/m at a lever arm of 0.075 m")


def test_a_long_line_is_stable_by_the_small_gain_of_its_ends() -> None:
    loop = certified("coupling.delay_s=3.0").loops[0]
    assert loop.verdict.passed
    assert any(math.isnan(case.radius) for case in loop.cases)


def test_the_end_of_a_rig_has_its_wave_filter_and_scale() -> None:
    bench = rig(f"{PAIR}.force_scale=4.0")
    delays = declared_delays(bench)
    slave = believed_end(bench, "slave.lever", delays, "lower")
    assert "filtered_wave" in slave.states


@pytest.mark.parametrize(("longest", "judged"), [(9, False), (10, True)])
def test_modes_are_computed_up_to_the_longest_line(
    longest: int, judged: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tautwave.certificate.loops.LONGEST", longest)
    found = certified("coupling.delay_s=0.005", name="bench-1dof-2khz")
    radii = [case.radius for case in found.loops[0].cases]
    assert all(math.isfinite(radius) is judged for radius in radii)


@pytest.mark.usefixtures("without_advice")
@pytest.mark.parametrize(
    "change",
    [
        "simulation.axes.slave.lever.damping=1.0e-3",
        "simulation.axes.slave.lever.inertia=1.0e-4",
        f"{PAIR}.wave_filter_hz=",
    ],
)
def test_a_port_that_is_refused_is_named_once(change: str) -> None:
    found = element(certified(change), "slave.lever port")
    assert not found.passive.passed
    assert found.passive.reason.split("slave.lever port")[0] == ""
    assert found.passive.reason.count("slave.lever port: ") == 1
