"""Axes that a brake holds: where a load leaves them, what they slip under, what they may supply."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from tautwave.certificate import certify
from tautwave.certificate.belief import declared_delays
from tautwave.config import Rig, load_rig
from tautwave.config.keys.operate import Operate
from tautwave.errors import ConfigError
from tautwave.laws.rest.brake import BrakeParams, device_takes, passive_stiffness
from tautwave.rig import build_rig
from tautwave.rig.operated.brakes import brake_params, braked_axes
from tautwave.runtime.operate.operated import OperatedControl
from tautwave.runtime.operate.rest.holds import Holds, damping_capital
from tautwave.runtime.operate.states import STATES
from tautwave.session.operating import with_operation
from tautwave.simulation.memory import run_in_memory
from tautwave.types import CommandDelay
from tests.runtime.operating import BARE, FREE, STANDING, STILL, Operated, bench, operate

CONFIGS = Path(__file__).parents[2] / "configs"
NOISY = CONFIGS / "bench-1dof-2khz-noisy.yaml"
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
@pytest.mark.nightly
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


def test_a_stop_or_a_new_hold_on_the_way_to_a_place_brakes_where_the_axis_is() -> None:
    offset = ("coupling.pairs.lever.offset=0.45", "coupling.pairs.lever.engage_tolerance=0.01")
    for word in ("stop", "hold", "rest\n1.51 hold"):
        done = operate(braked(0.3, 0.0, STILL, *offset), f"0.05 engage\n1.5 {word}", 2.5)
        sent = done.columns["slave.lever.commanded"][1498:2200]
        at = done.columns["slave.lever.position"]
        assert np.abs(sent).max() < 0.03, word  # of 0.33
        assert np.ptp(at[1498:2200]) < 0.03
        assert np.abs(at[1498]) > 0.2


def test_an_axis_in_fault_gets_no_effort_whatever_pulls_or_holds_it() -> None:
    offset = ("coupling.pairs.lever.offset=0.45", "coupling.pairs.lever.engage_tolerance=0.01")
    done = operate(braked(0.3, 0.0, STILL, *offset), "0.05 engage", 0.8)
    control = done.control
    assert control.alignment.pulls
    control.state.end = 10**6  # far from the ramp at the end
    control._rest(900)
    assert control.axes[1].command != 0.0
    control.dead.add(1)
    control._rest(901)
    assert control.axes[1].command == 0.0
    control.alignment.clear()
    control._rest(902)
    assert control.axes[1].command == 0.0


def test_what_is_held_stays_held_from_one_state_to_the_next() -> None:
    """No step of effort, no other place: clutched, held, at another scale, aligning again."""
    keys = ("operate.scales=[0.5]", "coupling.pairs.lever.engage_tolerance=0.5")
    rig = braked(0.3, 0.02, STILL, *keys)
    script = "0.05 hold\n4 scale 0.5\n4.1 scale 1\n4.2 engage\n4.9 clutch\n8 hold"
    done = operate(rig, script, 9.0)
    assert [state for _, state in done.words()] == [
        "holding", "holding", "holding", "aligning", "engaged", "clutched", "holding",
    ]  # fmt: skip
    sag, at = 0.02 / params(rig).stiffness, positions(done)
    sent = done.columns["slave.lever.commanded"]
    aligned = int(np.argmax(done.columns["operation.state"] == STATES.index("engaged")))
    assert at[3900:aligned] == pytest.approx(at[3900], abs=0.02 * sag)
    assert sent[3900 : aligned - 5] == pytest.approx(-0.02, rel=0.05)
    assert at[7900:] == pytest.approx(at[7900], abs=0.02 * sag)
    assert within_its_joules(done)


def test_lost_samples_leave_the_spring_s_effort_where_it_was() -> None:
    lost = "simulation.faults={missing_probability: 0.3}", "loop.missing_limit=20", "seed=3"
    rig = braked(0.3, 0.02, STILL, *lost)
    done = operate(rig, "0 hold", 4.0)
    at = positions(done)[-1000:]
    assert at == pytest.approx(0.02 / params(rig).stiffness, rel=0.05)
    assert done.columns["slave.lever.commanded"][-1200:-RAMP] == pytest.approx(-0.02, rel=0.05)
    assert done.words() == [("hold", "holding")]


def test_a_hold_that_supplied_what_it_may_is_damped_only_and_says_so() -> None:
    rig = braked(0.3, 0.0, STILL)
    done = operate(rig, "0 hold", 0.1)
    s, p = done.control.axes[1], done.control.params[1]
    brake = params(rig)
    holds = Holds([p], [brake.quantum], [brake])
    s.position, s.port_energy, s.velocity = 0.1, 0.0, 0.5
    assert holds.granted(0) == damping_capital(p, brake.quantum)  # before anything is braked
    assert holds.effort(0, 0, s, p) == 0.0  # where it is, it rests
    granted = brake.capital + brake.reserve
    assert holds.granted(0) == granted
    s.position = 0.15
    effort = holds.effort(0, 4, s, p)
    assert effort == pytest.approx(
        brake.stiffness * 0.05 + brake.damping * brake.gain * 0.05 / (4 * brake.period)
    )
    granted += device_takes(brake, 0.05, 4) + 4 * brake.period * brake.power
    assert holds.granted(0) == pytest.approx(granted, rel=1e-12)
    s.count = p.blind - 1
    assert holds.effort(0, 5, s, p, valid=False) == pytest.approx(brake.stiffness * 0.05)
    s.count = p.blind
    assert holds.effort(0, 6, s, p, valid=False) == 0.0
    s.position = 0.25
    assert holds.effort(0, 6, s, p) == 0.0  # a new place
    assert holds.effort(0, 7, s, p, braked=False) == 2e-3 * 0.5
    s.port_energy = -0.99 * granted
    assert holds.effort(0, 8, s, p) == 0.0  # it was led meanwhile, so this is its place
    s.port_energy = -1.01 * granted
    assert holds.effort(0, 9, s, p) == 2e-3 * 0.5
    assert holds.news == [0]
    s.position = 0.3
    assert holds.effort(0, 10, s, p) == 2e-3 * 0.5
    s.port_energy -= 1.01 * damping_capital(p, brake.quantum)
    assert holds.effort(0, 11, s, p) == 0.0
    holds.renew()
    s.port_energy = 0.0
    assert holds.effort(0, 12, s, p) == 0.0
    s.position = 0.31
    assert holds.effort(0, 13, s, p) > 0.01


def test_a_brake_that_supplied_what_it_may_is_a_fault() -> None:
    rig = braked(0.3, 0.0, STILL, "coupling.pairs.lever.engage_tolerance=0.5")
    built = with_operation(rig, build_rig(rig, clock="fake", duration_s=1.0), [], [])
    control = built.control
    assert isinstance(control, OperatedControl)
    control.holds.news = [1]
    run_in_memory(built)
    (entry,) = control.journal.entries
    assert (entry.word, entry.state) == ("fault", "holding")
    assert entry.text == (
        "slave.lever: its brake has supplied all it may; samples were lost, or the host stalled"
    )


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
    assert found.passive.margin == pytest.approx(damping / 3.0)
    assert numbers["hold_w"] == pytest.approx(2.0 * damping * (2.094e-5 / period) ** 2)
    shown = 10.0 * damping * 2.094e-5**2 / period
    assert numbers["hold_j"] == pytest.approx(0.33**2 / numbers["stiffness"] + shown, rel=1e-9)
    held = (2 + rig.overrun_limit) * period
    assert numbers["stalled_j"] == pytest.approx(0.33 * held * (15 + 0.5 * 0.33 * held / 1e-3))
    assert "resists being moved with up to 0.33 N m, at 1.33 N m/rad" in found.sentences[0]
    coarse = params(braked(0.3, 0.0, "slave.axes.lever.effort_quantum=0.01"))
    drive = 3.0 * 2.094e-5 * 0.01 / period + 0.75 * 0.01**2 / damping
    assert coarse.power == pytest.approx(numbers["hold_w"] + drive)
    helped = braked(0.3, 0.0, "slave.axes.lever.compensation={viscous: 0.5}")
    (same,) = [one for one in certify(helped).elements if one.name == f"brake of {SLAVE}"]
    assert same.numbers == numbers  # what compensates friction does not act at rest
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
    late = brake_params(smaller, SLAVE, CommandDelay(0, 0.00025))
    assert late is not None
    assert late.device == pytest.approx(2e-3 - 1.5 * 1e-3, rel=0.02)


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
    p = params(rig)
    assert p.stiffness == pytest.approx(0.25)
    assert 2.0 * p.damping * p.gain * 15 / p.period == pytest.approx(0.5 * 15)


def test_a_late_command_softens_it_and_axes_that_take_velocities_have_none() -> None:
    rig = braked(0.3, 0.0)
    late = brake_params(rig, SLAVE, CommandDelay(1, 0.0005))
    assert late is not None
    assert late.stiffness == pytest.approx(passive_stiffness(2e-3, 1e-3, 1.5))
    prompt = params(rig)
    held = 0.33 * 1.5e-3  # and for so much longer an effort acts
    assert late.reserve - prompt.reserve > 15 * held
    assert late.damping < prompt.damping
    admittance = load_rig(CONFIGS / "bench-admittance-loopback.yaml")
    keys = admittance.model_copy(update={"operate": Operate(hold_effort_share=0.3)})
    assert braked_axes(keys) == ["master.lever"]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("damping.lower=0", "a brake needs damping.lower of slave.lever; add it, or"),
        ("velocity_limit=null", "a brake needs velocity_limit of slave.lever; add it, or"),
        ("effort_quantum=0.1", "would be held with 0.33, less than 4 steps of its effort_quantum"),
    ],
)
def test_a_brake_without_its_numbers_is_refused(change: str, said: str) -> None:
    with pytest.raises(ConfigError, match=f"hold_effort_share.*{said}"):
        braked(0.3, 0.0, f"slave.axes.lever.{change}", "require=coupled_stable")
