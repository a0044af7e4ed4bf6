"""Walls of a rig: each verdict's pass and fail, with the numbers of the closed forms."""

from __future__ import annotations

import json
import math

import pytest

from tautwave.certificate import certify
from tautwave.certificate.walls import wall_claims
from tautwave.config import simulation_of
from tests.certificate.rigs import NO_QUANTUM, PAIR, certified, element, friction_of, rig, wall

LATE = "buses.arm.options={command_delay_s: 0.001}"
T, DAMPING = 1e-3, 2e-3  # of the rig: the believed lower bound counts, not the value 3e-3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "limit"),
    [
        ((), 2.0 * DAMPING / T),
        ((LATE,), DAMPING / (1.5 * T)),  # K T (1/2 + 1)
        (("buses.arm.options={command_delay_s: 0.003}",), DAMPING / (3.5 * T)),
        (("rate_hz=2000",), 4.0 * DAMPING / T),
        (("slave.axes.lever.damping={value: 3.0e-3, lower: 1.0e-3, source: x}",), 1e-3 / (0.5 * T)),
    ],
)
def test_the_greatest_passive_spring_is_that_of_theory(
    changes: tuple[str, ...], limit: float
) -> None:
    for factor, passes in ((1.0 - 1e-6, True), (1.0 + 1e-6, False)):
        found = element(certified(wall(factor * limit), *changes), "slave wall")
        assert found.passive.passed is passes
        assert found.numbers["passive_stiffness"] == pytest.approx(limit, rel=1e-8)
        assert (found.passive.margin or 0.0) > 0.0 if passes else (found.passive.margin or 0) < 0


def test_a_wall_that_fails_is_reported_with_the_hand_it_fails_against() -> None:
    reported = "slave wall: unstable with this hand on the device: m = "
    assert any(
        line.startswith(reported) for line in element(certified(wall(9.0)), "slave wall").sentences
    )
    passing = element(certified(wall(3.0)), "slave wall")
    assert not any(line.startswith(reported) for line in passing.sentences)


@pytest.mark.slow
def test_the_velocity_filter_of_the_loop_is_counted() -> None:
    """K T / 2 + B T / (T + 2 tau)."""
    changes = (wall(2.0, 3e-3), "slave.axes.lever.velocity_filter_s=0.002")
    found = element(certified(*changes), "slave wall")
    assert found.numbers["needed_damping"] == pytest.approx(1e-3 + 3e-3 / 5.0, rel=1e-9)
    assert found.passive.passed
    assert not element(certified(wall(2.0, 3e-3)), "slave wall").passive.passed


def test_a_share_of_a_period_takes_more_than_the_linear_rule() -> None:
    late = "buses.arm.options={command_delay_s: 0.0004}"
    found = element(certified(wall(2.0), late), "slave wall")
    linear = 2.0 * T * (0.5 + 0.4)
    assert 1.01 * linear < found.numbers["needed_damping"] < 1.08 * linear


def test_it_says_what_spoils_it_and_what_helps() -> None:
    certificate = certified(wall(5.0), LATE)
    sentence, *_ = certificate.sentences()
    assert not certificate.passed
    assert "slave wall: K = 5 N m/rad is 3.75 x the passive limit 1.33" in sentence
    assert "one period of delay costs 3 x of it" in sentence
    assert "Lower K to 1.33, or raise the rate to 3.76 kHz, or add 0.0055 N m s/rad" in sentence


@pytest.mark.slow
def test_a_linear_axis_has_linear_units_and_the_pair_in_its_name() -> None:
    change = "coupling.pairs.slide.wall_master.stiffness=2000"
    sentence, *_ = certified(change, name="bench-2axis-loopback").sentences()
    assert sentence.startswith("master wall of slide: K = 2000 N/m is 2 x the passive limit 1000")


def test_wall_and_port_share_the_damping() -> None:
    certificate = certified(wall(3.0, 4e-4))
    port = element(certificate, "slave.lever port")
    assert port.numbers["damping_of_wall"] == pytest.approx(1.9e-3)
    assert port.numbers["damping_left"] == pytest.approx(1e-4)
    assert port.passive.passed
    whole = element(certified(wall(4.0)), "slave.lever port")
    assert "wall and load use 0.002 N m s/rad of the device's guaranteed 0.002" in (
        whole.passive.reason
    )


def test_what_a_wall_may_owe_is_known_without_command_delay_only() -> None:
    """What makes it pay is exact for efforts that act at once."""
    assert set(wall_claims(rig())) == {"master.lever", "slave.lever"}
    assert set(wall_claims(rig(LATE))) == {"master.lever"}, "the slave's commands are late"


@pytest.mark.slow
def test_passivity_control_stands_in_for_damping() -> None:
    control, free = "passivity_control: true", "slave.axes.lever.effort_rate_limit="
    limited = element(certified(wall(40.0, 0.0, control)), "slave wall").passive
    assert not limited.passed
    assert "effort_rate_limit allows a drop of only 0.7 per period; raise that to 1100" in (
        limited.reason
    )
    certificate = certified(wall(40.0, 0.0, control), "slave.axes.lever.effort_rate_limit=2000")
    found = element(certificate, "slave wall")
    assert found.passive.state == "conditional"
    assert "Hannaford and Ryu" in found.passive.reason
    assert "at least 0.001" in found.passive.reason
    assert certificate.verdicts["passive"].state == "conditional"
    assert element(certificate, "slave.lever port").numbers["damping_of_wall"] == 0.0
    late = element(certified(wall(40.0, 0.0, control), free, LATE), "slave wall")
    assert not late.passive.passed
    assert "only without command delay" in late.passive.reason
    light = "simulation.axes.slave.lever.inertia=9.0e-4"
    wrong = certified(wall(40.0, 0.0, control), free, light)
    assert not element(wrong, "slave wall").passive.passed


@pytest.mark.parametrize(
    ("change", "state"),
    [
        ("effort_rate_limit=58", "passed"),  # 15 rad/s * (3 + 2 * 4e-4 / T) = 57 N m/s
        ("effort_rate_limit=56", "conditional"),
        ("velocity_limit=", "conditional"),
        ("effort_rate_limit=", "passed"),
    ],
)
def test_a_limit_on_the_rate_of_effort_must_not_hold_the_wall_up(change: str, state: str) -> None:
    found = element(certified(f"slave.axes.lever.{change}"), "slave wall")
    assert found.passive.state == state


@pytest.mark.slow
def test_an_encoder_step_without_friction_passes_no_wall() -> None:
    found = element(certified(wall(1e-3)), "slave wall")
    assert found.passive.passed
    assert not found.passive_quantised.passed
    assert 0.0 < found.numbers["activity_j"] < 1e-12
    smooth = certified(*NO_QUANTUM)
    assert element(smooth, "slave wall").passive_quantised.passed
    assert smooth.verdicts["passive_quantised"].passed


@pytest.mark.parametrize(("factor", "passes"), [(1.001, True), (0.999, False)])
def test_coulomb_friction_that_is_given_covers_the_step(factor: float, passes: bool) -> None:
    quantum, stiffness = 2.094e-5, 3.0
    friction = factor * 0.5 * stiffness * quantum
    found = element(certified(wall(stiffness), friction_of(friction)), "slave wall")
    assert found.passive_quantised.passed is passes
    assert ("also passive with the encoder's step" in found.passive_quantised.reason) is passes
    given = certify(rig(wall(stiffness)), coulomb={"slave.lever": friction})
    assert element(given, "slave wall").passive_quantised.passed is passes


def test_the_simulation_has_the_friction_that_is_believed_and_may_break_it() -> None:
    believed = friction_of("{value: 3.0e-3, lower: 1.0e-3, source: identified}")
    free = "simulation.axes.slave.lever={}"
    assert simulation_of(rig(believed, free), "slave.lever").coulomb == 3e-3
    found = element(certified(believed, wall(3.0)), "slave wall")
    assert found.passive_quantised.state == "passed"
    truth = "simulation.axes.slave.lever.coulomb=0.5e-3"
    found = element(certified(believed, truth, wall(3.0)), "slave wall")
    assert found.passive.passed
    assert "simulated Coulomb friction 0.0005 is below coulomb.lower 0.001" in (
        found.passive_quantised.reason
    )


def test_an_assumed_friction_makes_it_conditional() -> None:
    believed = friction_of("{value: 3.0e-3, lower: 1.0e-3, source: assumed}")
    found = element(certified(believed, wall(3.0)), "slave wall")
    assert found.passive.state == "passed"
    assert found.passive_quantised.state == "conditional"
    assert "Coulomb friction of slave.lever" in found.passive_quantised.conditions[0]


@pytest.mark.parametrize("source", ["assumed", "an assumption of 2024"])
def test_an_assumed_damping_makes_it_conditional(source: str) -> None:
    keys = f"{{value: 3.0e-3, lower: 2.0e-3, source: {source}}}"
    verdict = certified(f"slave.axes.lever.damping={keys}").verdicts["passive"]
    assert verdict.state == "conditional"
    assert any("damping of slave.lever" in c and source in c for c in verdict.conditions)


def test_a_simulation_that_contradicts_the_damping_fails() -> None:
    certificate = certified("simulation.axes.slave.lever.damping=1.0e-3")
    assert not certificate.passed
    assert "simulated damping 0.001 is below damping.lower 0.002" in certificate.sentences()[0]


def test_a_wall_on_an_admittance_axis_is_not_covered() -> None:
    change = f"{PAIR}.wall_slave={{position: 0.2, stiffness: 1.0}}"
    found = element(certified(change, name="bench-admittance-loopback"), "slave wall")
    assert not found.passive.passed
    assert "admittance axis" in found.passive.reason


def test_json_has_all_numbers_and_no_infinity() -> None:
    certificate = certified(wall(1.0, 0.1, "derate: true"), *NO_QUANTUM)
    found = json.loads(json.dumps(certificate.as_dict(), allow_nan=False))
    assert set(found["verdicts"]) == {"passive", "passive_quantised", "coupled_stable"}
    [numbers] = [e["numbers"] for e in found["elements"] if e["name"] == "slave wall"]
    assert {"passive_stiffness", "blame", "remedies", "stable_stiffness", "hand"} <= set(numbers)
    assert numbers["remedies"]["rate"] is None  # no rate helps a damper above the device's
    assert math.isfinite(numbers["needed_damping"])


def test_an_effort_step_counts_as_an_encoder_step() -> None:
    changes = (wall(3.0), *NO_QUANTUM, "slave.axes.lever.effort_quantum=1.0e-3")
    for friction, passes in ((0.99e-3, False), (1.01e-3, True)):
        certificate = certified(*changes, friction_of(friction))
        assert element(certificate, "slave wall").passive_quantised.passed is passes


# -- derate ---------------------------------------------------------------------------------------


def test_derate_renders_the_stiffest_passive_wall() -> None:
    certificate = certified(wall(9.0, 4e-4, "derate: true"))
    reported = certificate.walls["slave.lever"]
    assert certificate.passed
    assert (reported["asked_stiffness"], reported["rendered_stiffness"]) == (
        9.0,
        pytest.approx(3.0, 1e-5),
    )
    assert reported["rendered_stiffness"] <= 3.0  # 0.95 * 0.002 = 3.0 T / 2 + 4e-4
    sentences = element(certificate, "slave wall").sentences
    assert "K = 9 N m/rad requested, derated to 3" in sentences[0]


@pytest.mark.slow
def test_derate_leaves_a_certified_wall_alone() -> None:
    reported = certified(wall(2.0, 0.0, "derate: true")).walls["slave.lever"]
    assert reported["rendered_stiffness"] == reported["asked_stiffness"] == 2.0


def test_derate_cannot_save_a_wall_with_too_much_damping() -> None:
    certificate = certified(wall(9.0, 1.0, "derate: true"))
    assert not certificate.passed
    assert certificate.walls["slave.lever"]["rendered_stiffness"] == 9.0


@pytest.mark.slow
def test_derate_follows_the_required_verdict() -> None:
    asked = wall(50.0, 0.0, "derate: true")
    stable = certified(asked, "require=coupled_stable")
    assert stable.passed
    assert stable.walls["slave.lever"]["rendered_stiffness"] > 4.1  # more than the passive limit
    assert not certified(asked, "require=passive_quantised").passed
    quantised = certified(asked, "require=passive_quantised", friction_of(1e-5))
    rendered = quantised.walls["slave.lever"]["rendered_stiffness"]
    assert rendered == pytest.approx(2e-5 / 2.094e-5, rel=1e-5)
    assert element(quantised, "slave wall").passive_quantised.passed


@pytest.mark.sparse(4)
@pytest.mark.parametrize("damping", [0.0, 1e-4])
@pytest.mark.parametrize("step", [0.0, 2.094e-5])
def test_derate_counts_the_steps_of_encoder_and_effort(step: float, damping: float) -> None:
    changes = (
        wall(4.0, damping, "derate: true"),
        "require=passive_quantised",
        f"slave.axes.lever.encoder_quantum={step}",
        "slave.axes.lever.effort_quantum=1.0e-6",
        friction_of(2e-5),
    )
    certificate = certified(*changes)
    rendered = certificate.walls["slave.lever"]["rendered_stiffness"]
    assert element(certificate, "slave wall").passive_quantised.passed
    # What friction leaves, unless the damping left to the port is less.
    stiffer = (f"{PAIR}.wall_slave.stiffness={1.06 * rendered}", f"{PAIR}.wall_slave.derate=false")
    found = element(certified(*changes, *stiffer), "slave wall")
    assert not found.passive_quantised.passed


def test_noise_of_the_encoder_is_stated_and_is_not_passive_when_quantised() -> None:
    """White: (K sigma)^2 T / (2 m); of any colour 33 times that."""
    noisy = ("slave.axes.lever.position_noise=1e-4", *NO_QUANTUM)
    white = ("slave.axes.lever.position_noise_autocorrelation=[]",)
    quiet = element(certified(wall(3.0), *NO_QUANTUM), "slave wall")
    assert quiet.passive_quantised.passed
    assert "noise_w" not in quiet.numbers
    inertia = quiet.numbers["device"]["mass"]
    expected = (3.0 * 1e-4) ** 2 * T / (2.0 * inertia)
    for changes, factor in ((white, 1.0), ((), 33.0)):
        found = element(certified(wall(3.0), *noisy, *changes), "slave wall")
        assert found.passive.passed
        assert not found.passive_quantised.passed
        by_damping = (3.0 * 1e-4) ** 2 / (4.0 * found.numbers["damping_margin"])
        assert found.numbers["noise_w"] == pytest.approx(min(expected * factor, by_damping))
        assert f"generate up to {found.numbers['noise_w']:.3g} W" in found.passive_quantised.reason
        assert found.passive_quantised.reason in found.sentences
