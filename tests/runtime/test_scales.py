"""Another scale of an operated rig's pairs: under load, or by letting go."""

from __future__ import annotations

import numpy as np
import pytest

from tautwave.couplings.wave.claim import claim_of
from tautwave.couplings.wave.port import tune
from tautwave.rig.scales import end_energy, pair_scale, scaled
from tautwave.rig.ways import command_delays
from tautwave.runtime.operate import states as st
from tautwave.runtime.operate.rescaling import take_scale
from tautwave.session.checking import check
from tests.runtime.operating import BARE, FREE, Operated, bench, operate

WAY = "simulation.hand.lever.reference={type: minimum_jerk, waypoints: "
PRESS = f"{WAY}[[0, 0], [0.5, 0], [0.9, 0.25], [9, 0.25]]}}"
SPRING = "simulation.environment.lever={type: spring, stiffness: 2, position: 0}"


def pressing(script: str, duration_s: float, *keys: str) -> Operated:
    done = operate(
        bench(PRESS, SPRING, *BARE, "operate.scales=[0.5, 2]", *keys), script, duration_s
    )
    assert done.result.error is None
    assert np.abs(done.residual()).max() <= 1e-12
    return done


def test_forces_fall_as_fast_as_they_may_before_a_scale_changes() -> None:
    """What the old scale still commands must not act on the new one's books."""
    rate = [f"{side}.axes.lever.effort_rate_limit=1.0" for side in ("master", "slave")]
    law = "coupling={law: position, pairs: {lever: {stiffness: 2, damping: 0.02}}}"
    done = pressing("0.1 engage\n1.5 scale 0.5", 2.0, *rate, law)
    assert done.control.journal.entries[3].word == "parted"
    effort = done.columns["slave.lever.commanded"]
    assert abs(effort[1495]) > 0.02  # it takes 20 slots to fall
    assert np.abs(np.diff(effort)).max() <= 1.0e-3 + 1e-12


def test_a_scale_changes_under_load_and_the_force_stays() -> None:
    done = pressing("0.1 engage\n1.5 scale 0.5\n1.7 scale 2", 1.9, "coupling.delay_s=0.02")
    assert done.words() == [
        ("engage", "aligning"), ("aligned", "engaged"), ("scale", "engaged"), ("scale", "engaged"),
    ]  # fmt: skip
    assert done.control.journal.engagements == 1  # nothing is filled again
    effort = done.columns["slave.lever.commanded"]
    assert abs(effort[1499]) > 0.1
    assert np.abs(effort[1500:1850] - effort[1499]).max() < 0.002
    # the tank keeps its joules where the scale rises, and what that is in the pair's is lost
    stored = done.columns["lever.port_slave.stored"]
    assert stored[1501] - stored[1498] == pytest.approx(0.0, abs=2e-5)
    assert stored[1701] < stored[1698] - 1e-3


def test_the_greatest_claim_of_all_scales_has_the_greatest_of_each_term() -> None:
    """A port may begin with the reserve of one scale and end with that of another."""
    rig = bench(*BARE)
    delays = command_delays(rig)
    found = [claim_of(scaled(rig, scale), "slave.lever", delays) for scale in (4, 2, 1, 0.5, 0.1)]
    for name in ("reserve", "leak", "feigned", "under_way"):
        terms = [getattr(claim, name) for claim in found]
        assert terms == sorted(terms)


def test_what_was_tuned_stays_at_another_scale() -> None:
    control = pressing("0.1 engage", 0.2).control
    p = control.params[1]
    end = tune(p.end, control.axes[1].end, "wave_filter_hz", 40.0, p.site.period)
    control.retune(1, p._replace(end=end, ceiling=0.5 * p.ceiling))
    take_scale(control, control.operation.scales[0.5], holding=False)
    after = control.params[1]
    assert after.ceiling == 0.5 * p.ceiling
    assert after.end.port.filter_gain == end.port.filter_gain < p.end.port.filter_gain
    assert after.end.port.impedance == 2.0 * p.end.port.impedance


def test_a_tank_that_is_nearly_empty_lets_go_for_another_scale() -> None:
    """Ten changes to and fro leave a thousandth of a tank that is not refilled."""
    script = "\n".join(f"{1.0 + 0.001 * k:.3f} scale {(1, 0.5)[k % 2]}" for k in range(20))
    words = pressing(f"0.1 engage\n{script}", 1.1).words()
    assert words.count(("parted", "aligning")) >= 1
    said = [one for one in words if one[0] == "scale"]
    assert said.count(("scale", "engaged")) > 4


@pytest.mark.slow
def test_check_certifies_every_scale_and_states_the_greatest_claims() -> None:
    found = check(bench("operate={scales: [0.5]}"))
    assert found.exit_code == 3  # as it is for `run`
    (why,) = found.failures
    assert why.startswith("bench-1dof at scale 0.5: slave.lever port: ")
    poles = [f"coupling.pairs.lever.pole_{side}=0.2" for side in ("master", "slave")]
    found = check(bench("operate={scales: [0.5]}", *poles))
    alone = check(bench(*poles))
    assert found.failures == []
    assert found.claims[0] == alone.claims[0]
    assert found.claims[1].claim_j > alone.claims[1].claim_j  # the slave's, at half the scale


def test_a_scale_changes_in_one_slot_and_nothing_jumps() -> None:
    way = "[[0, 0], [1, 0], [4, 0.25]]"
    slow = f"simulation.hand.lever.reference={{type: minimum_jerk, waypoints: {way}}}"
    rig = bench(slow, FREE, *BARE, "operate.scales=[0.5, 2]", "coupling.delay_s=0.02")
    done = operate(rig, "0.1 engage\n2.0 scale 0.5\n3.0 scale 3\n3.2 scale 1", 4.0)
    assert done.result.error is None
    assert done.words()[2:] == [("scale", "engaged")] * 3
    assert done.control.journal.entries[3].text == "scale: one of 1, 0.5, 2 (got '3')"
    assert np.abs(done.residual()).max() <= 1e-12
    scale, state = done.columns["operation.scale"], done.columns["operation.state"]
    assert set(np.unique(scale)) == {0.5, 1.0}
    assert set(state[1500:]) == {float(st.STATES.index(st.ENGAGED))}
    error = done.columns["lever.position_error"]
    assert np.abs(np.diff(error))[[1999, 3199]].max() < 2e-4  # the slave is where it was
    master, slave = (done.columns[f"{side}.lever.position"] for side in ("master", "slave"))
    ratio = (slave[3150] - slave[2600]) / (master[3150] - master[2600])
    assert ratio == pytest.approx(0.5, abs=0.05)
    assert np.abs(np.diff(slave)).max() < 1e-3  # no jump at a change


def test_an_energy_of_a_pair_is_another_of_its_slaves_device() -> None:
    rig = bench("coupling.pairs.lever.position_scale=2.0", "coupling.pairs.lever.force_scale=2.0")
    power = pair_scale(rig.coupling.pairs["lever"]).power
    assert power != 1.0
    assert end_energy(rig, "master.lever", 3.0) == 3.0
    assert end_energy(rig, "slave.lever", 3.0) == 3.0 * power
