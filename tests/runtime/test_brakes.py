"""Axes that a brake holds: where a load leaves them, what they slip under, what they may supply."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from tautwave.certificate import certify
from tautwave.certificate.belief import declared_delays
from tautwave.config import Rig, load_rig
from tautwave.errors import ConfigError
from tautwave.laws.rest.brake import BrakeParams
from tautwave.rig.operated.brakes import brake_params
from tautwave.runtime.operate.rest.holds import Holds
from tautwave.runtime.operate.states import STATES
from tests.runtime.operating import BARE, FREE, STANDING, STILL, Operated, bench, operate

NOISY = Path(__file__).parents[2] / "configs" / "bench-1dof-2khz-noisy.yaml"
SLAVE = "slave.lever"
RAMP = 200
"""Rows of the release ramp at the end of a run."""


def braked(share: float, load: float, *more: str) -> Rig:
    """Return the bench with brakes and a load at the slave that its rig does not know [N m]."""
    truth = f"simulation.axes={{slave.lever: {{load: {{constant: {load}}}}}}}"
    return bench(FREE, *BARE, f"operate.hold_effort_share={share}", truth, *more)


def params(rig: Rig) -> BrakeParams:
    found = brake_params(rig, SLAVE, declared_delays(rig)[SLAVE])
    assert found is not None
    return found


def within_its_joules(done: Operated) -> bool:
    """Return whether books close, and motors supplied no more than holds might."""
    granted = done.control.granted + done.control.holds.granted_to_all()
    taken = done.columns["lever.operate.absorbed"]
    return bool(taken.min() >= -granted and np.abs(done.residual()).max() < 1e-11)


def positions(done: Operated, side: str = "slave") -> np.ndarray:
    return done.columns[f"{side}.lever.position"][:-RAMP]


def during(done: Operated, state: str, what: str) -> np.ndarray:
    return done.columns[what][done.columns["operation.state"] == STATES.index(state)]


def test_a_load_is_held_where_the_spring_bears_it_and_without_a_brake_it_falls() -> None:
    rig = braked(0.3, 0.02, STILL)
    done = operate(rig, "0 hold", 10.0)
    p = params(rig)
    at = positions(done)
    assert at[-1000:].mean() == pytest.approx(0.02 / p.stiffness, rel=2e-3)
    assert np.ptp(at[-1000:]) <= 1.5 * p.quantum
    assert at.max() < 2.2 * 0.02 / p.stiffness
    assert done.columns["slave.lever.commanded"][-RAMP - 1] == pytest.approx(-0.02, rel=2e-3)
    assert done.words() == [("hold", "holding")]
    assert within_its_joules(done)
    fell = operate(braked(0.0, 0.02, STILL), "0 hold", 1.0)
    assert fell.words() == [("hold", "holding"), ("fault", "holding")]
    assert positions(fell)[-1] > 0.5


def test_it_slips_under_more_than_its_effort_as_fast_as_the_dampers_let_it() -> None:
    rig = braked(0.01, 0.02, STILL, "slave.axes.lever.position_range=[-3, 3]")
    done = operate(rig, "0 hold", 2.0)
    p = params(rig)
    truth = 0.003
    speed = (0.02 - 0.01 * 1.1) / (truth + p.damping)
    at = positions(done)
    assert (at[-1] - at[-501]) / 0.5 == pytest.approx(speed, rel=0.02)
    assert done.words() == [("hold", "holding")]
    assert within_its_joules(done)


def test_masters_are_braked_where_all_hold_and_led_where_slaves_find_their_places() -> None:
    """Free while clutched, damped while aligning, braked while holding; slaves wherever held."""
    offset = ("coupling.pairs.lever.offset=0.2", "coupling.pairs.lever.engage_tolerance=0.01")
    ways = "waypoints: [[0, 0], [1, 0.1], [2, 0], [3.6, 0], [4.2, 0.1]]"
    moving = f"simulation.hand.lever.reference={{type: minimum_jerk, {ways}}}"
    rig = braked(0.3, 0.0, moving, *offset)
    done = operate(rig, "0.05 engage\n3.2 clutch\n3.6 hold", 4.6)
    states = [state for _, state in done.words()]
    assert states[-3:] == ["engaged", "clutched", "holding"]
    speed = during(done, "aligning", "master.lever.velocity")[5:-200]
    sent = during(done, "aligning", "master.lever.commanded")[5:-200]
    assert np.allclose(sent, -2e-3 * speed, atol=1e-9)
    assert not np.any(during(done, "clutched", "master.lever.commanded")[5:])
    k = brake_params(rig, "master.lever", declared_delays(rig)["master.lever"])
    assert k is not None
    at = during(done, "holding", "master.lever.position")[:-RAMP]
    pulled = -during(done, "holding", "master.lever.commanded")[:-RAMP]
    spring = np.polyfit(at, pulled, 1)[0]
    assert spring == pytest.approx(k.stiffness, rel=0.3)
    for state in ("clutched", "holding"):
        moved = during(done, state, "slave.lever.position")
        assert np.ptp(moved) < 0.02
    assert within_its_joules(done)


def test_each_hold_begins_where_the_axis_is_then() -> None:
    rig = braked(0.3, 0.02, STANDING)
    done = operate(rig, "0 hold\n1.0 rest\n1.05 hold", 4.0)
    at, sag = positions(done), 0.02 / params(rig).stiffness
    assert at[1050] > 1.5 * sag  # it fell meanwhile
    assert at[-200:].mean() - at[1050] == pytest.approx(sag, rel=0.02)
    assert done.control.granted > params(rig).capital  # the first hold's
    assert within_its_joules(done)


@pytest.mark.slow
def test_a_minute_of_real_noise_uses_up_no_hold() -> None:
    share = "operate={hold_effort_share: 0.3}"
    truth = "simulation.axes.slave.lever.load={constant: 0.2}"
    rig = load_rig(NOISY, [share, truth, FREE, STILL])
    done = operate(rig, "0 hold", 60.0)
    p = params(rig)
    at = positions(done)[2000:]
    assert done.words() == [("hold", "holding")]
    friction = 0.025
    assert abs(at.mean() - 0.2 / p.stiffness) < friction / p.stiffness
    assert np.all(done.columns["slave.lever.commanded"][2000:-RAMP] < -0.1)
    assert within_its_joules(done)


def test_a_hold_that_supplied_what_it_may_lets_go_until_its_power_has_paid() -> None:
    rig = braked(0.3, 0.0, STILL)
    done = operate(rig, "0 hold", 0.1)
    control = done.control
    s, p = control.axes[1], control.params[1]
    brake = params(rig)._replace(power=1.0)
    holds = Holds([p], [brake.quantum], [brake])
    s.position, s.port_energy = 0.1, 0.0
    assert holds.effort(0, 0, s, p) == 0.0  # where it is, it rests
    s.position = 0.15
    assert holds.effort(0, 1, s, p) > 0.0
    s.port_energy = -(holds.granted(0) + 0.0105)
    given = [holds.effort(0, slot, s, p) != 0.0 for slot in range(2, 22)]
    assert given == [False] * 10 + [True] * 10
    s.port_energy = -(holds.granted(0) + 0.0105)
    assert holds.effort(0, 31, s, p) == 0.0
    assert holds.effort(0, 32, s, p) != 0.0  # slots without a sample are paid as well
    assert holds.effort(0, 33, s, p, braked=False) == pytest.approx(2e-3 * s.velocity)


def test_check_states_what_holds_and_what_it_may_supply() -> None:
    rig = braked(0.3, 0.0)
    certificate = certify(rig)
    (found,) = [one for one in certificate.elements if one.name == f"brake of {SLAVE}"]
    numbers = found.numbers
    damping, period = 2e-3, 1e-3
    assert found.passive.passed
    assert numbers["stiffness"] == pytest.approx(damping / 3.0 / (0.5 * period))
    assert numbers["greatest_effort"] == pytest.approx(0.33)
    assert numbers["needed_damping"] == pytest.approx(damping / 1.5)
    assert numbers["hold_w"] == pytest.approx(2.0 * damping * (2.094e-5 / period) ** 2)
    elastic = 0.5 * 0.33**2 / numbers["stiffness"]
    assert numbers["hold_j"] == pytest.approx(elastic, rel=1e-4)
    held = (2 + rig.overrun_limit) * period
    assert numbers["stalled_j"] == pytest.approx(0.33 * held * (15 + 0.5 * 0.33 * held / 1e-3))
    assert "resists being moved with up to 0.33 N m, at 1.33 N m/rad" in found.sentences[0]
    assert not [one for one in certify(braked(0.0, 0.0)).elements if one.kind == "brake"]


def test_a_load_that_takes_all_the_damping_leaves_none_for_a_brake() -> None:
    load = "slave.axes.lever.load={sine: 2.1}", "slave.axes.lever.position_range=[-0.4, 0.4]"
    rig = braked(0.3, 0.0, *load, "require=coupled_stable")
    (found,) = [one for one in certify(rig).elements if one.name == f"brake of {SLAVE}"]
    assert not found.passive.passed
    assert "leaves no damping for it; raise rate_hz, or remove hold_effort_share" in (
        found.passive.reason
    )
    (other,) = [one for one in certify(rig).elements if one.name == "brake of master.lever"]
    assert other.passive.passed
    smaller = braked(0.3, 0.0, "slave.axes.lever.load={sine: 1.0}", "require=coupled_stable")
    left = params(smaller).device
    assert left == pytest.approx(2e-3 - 1.0 * 1e-3, rel=0.01)


def test_noise_counts_as_the_step_that_is_four_times_its_deviation() -> None:
    quiet, loud = (params(braked(0.3, 0.0, f"slave.axes.lever.position_noise={noise}"))
                   for noise in (1e-6, 1e-5))  # fmt: skip
    assert quiet.quantum == 2.094e-5
    assert loud.quantum == 4e-5
    assert loud.power == pytest.approx(quiet.power * (4e-5 / 2.094e-5) ** 2)


def test_what_is_disturbed_comes_to_rest_with_a_damping_ratio_of_a_quarter() -> None:
    rig = braked(0.3, 0.02, STILL)
    p = params(rig)
    at = positions(operate(rig, "0 hold", 3.0))
    over = at.max() / (0.02 / p.stiffness) - 1.0
    ratio = -math.log(over) / math.hypot(math.pi, math.log(over))
    assert 0.2 < ratio < 0.35


def test_a_low_rate_limit_softens_the_spring() -> None:
    rig = braked(0.3, 0.0, "slave.axes.lever.effort_rate_limit=15")
    assert params(rig).stiffness == pytest.approx(0.5 * 15 / 15)


@pytest.mark.parametrize(
    ("change", "missing"),
    [("damping.lower=0", "damping"), ("inertia=null", "inertia")],
)
def test_a_brake_without_its_numbers_is_refused(change: str, missing: str) -> None:
    with pytest.raises(ConfigError, match=f"hold_effort_share.*a brake needs {missing} of slave"):
        braked(0.3, 0.0, f"slave.axes.lever.{change}", "require=coupled_stable")
