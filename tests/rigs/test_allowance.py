"""What lies between features: nobody counts on what another has spent already."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from tautwave import Stepper
from tautwave.certificate.data import Element
from tautwave.certificate.verdict import certify
from tautwave.config import Rig, load_rig
from tautwave.errors import ConfigError
from tautwave.laws.limit import STOPPED
from tautwave.rig import allowances, axis_allowance, axis_params, command_delays
from tautwave.rig.operated.brakes import brake_params
from tautwave.session.facts import allowance_rows

CONFIGS = Path(__file__).parents[2] / "configs"
SPRING = CONFIGS / "bench-position-coupling.yaml"
WALLED = CONFIGS / "bench-1dof-loopback.yaml"


def element(rig: Rig, kind: str, axis: str) -> Element:
    (found,) = (e for e in certify(rig).elements if e.kind == kind and e.axis == axis)
    return found


def both(key: str) -> list[str]:
    return [f"{side}.axes.lever.{key}" for side in ("master", "slave")]


# A pendulum whose load takes 0.059 of 0.06, and a coupling that needs 0.029 between the two.
PENDULUM = [
    "master.axes.lever.load={sine: 59}", "slave.axes.lever.load={sine: 59}",
    *both("inertia={value: 0.1, lower: 0.1, source: measured}"),
    *both("damping={value: 0.06, lower: 0.06, source: measured}"),
    *both("effort_limit=300"), *both("velocity_limit=5"),
    "coupling.pairs.lever.stiffness=58", "coupling.pairs.lever.damping=0", "require=passive",
    "loop.overrun_limit=10",  # else a stall gives more than any condition covers
    "coupling.engage_ramp_s=0.02",  # else an engagement does
    "simulation.axes={}",
]  # fmt: skip


@pytest.mark.parametrize("delay", [0.0, 0.002], ids=["at once", "delayed"])
def test_a_coupling_gets_what_a_load_leaves_of_the_damping(delay: float) -> None:
    bare = [change for change in PENDULUM if ".load=" not in change]
    more = [f"coupling.delay_s={delay}"]
    if delay:
        more += ["coupling.pairs.lever.stiffness=15"]
    loaded = load_rig(SPRING, [*PENDULUM, *more])
    found = allowances(loaded, command_delays(loaded))["slave.lever"]
    assert found.coupling_damping == pytest.approx(0.06 - found.load_damping)
    assert found.load_damping == pytest.approx(0.059)
    assert element(load_rig(SPRING, [*bare, *more]), "coupling", "lever").passive.passed
    assert not element(loaded, "coupling", "lever").passive.passed


def test_a_stop_leaves_a_load_what_that_takes_of_the_damping() -> None:
    loaded = load_rig(SPRING, PENDULUM)
    delay = command_delays(loaded)["slave.lever"]
    stop = axis_params(loaded, "slave.lever", delay, 0).site.limit.stop_damping
    assert stop == pytest.approx(0.06 - 0.059)
    bare = load_rig(SPRING, [change for change in PENDULUM if ".load=" not in change])
    assert axis_params(bare, "slave.lever", delay, 0).site.limit.stop_damping == 0.06


@pytest.mark.slow
def test_who_shakes_a_loaded_axis_while_it_stops_gets_no_energy() -> None:
    """Its load is carried all the while; damping spent twice gave as much as friction took."""
    changes = [
        "coupling.release_ramp_s=3",
        "coupling.pairs.lever={stiffness: 0.2, damping: 0}",
        "slave.axes.lever.position_range=[-0.5, 0.5]",
        *both("encoder_quantum=0"),
    ]
    rig = load_rig(SPRING, [*PENDULUM, *changes])
    came = 0.02 * np.linspace(0.0, 1.0, 800)
    left = np.linspace(0.02, 0.55, 1500)  # out of its range: a stop begins
    shaken = np.tile([1e-3, 0.0], 400)
    master = np.concatenate([came, np.full(1500, 0.02), 0.02 + shaken])
    slave = np.concatenate([came, left, 0.55 - shaken])
    moved, sent, bits = np.diff(master[-401:]), [], 0.0
    with Stepper(rig, outside=("master", "slave"), duration_s=10.0) as one:
        for places in zip(master, slave, strict=True):
            acting = one.step(dict(zip(one.outside, places, strict=True)))
            sent.append(acting["master.lever"])
        bits = one.rows["master.lever.limited"][-1]
    assert int(bits) & STOPPED
    given = float(np.dot(sent[-401:-1], moved))
    taken = 0.06 * float(np.dot(moved, moved)) / rig.period_s
    assert 0.9 * taken < given <= taken * (1.0 + 1e-9)


CONTROLLED = [
    "coupling.pairs.lever.wall_slave={position: -0.28, stiffness: 20.0, damping: 0.0, "
    "side: below, passivity_control: true}",
    "require=passive",
]


def test_passivity_control_beside_a_load_has_half_of_the_rate() -> None:
    def passive(*more: str) -> tuple[bool, str]:
        found = element(load_rig(WALLED, [*CONTROLLED, *more]), "wall", "slave.lever").passive
        return found.passed, found.reason

    rate, load = "slave.axes.lever.effort_rate_limit={:g}", "slave.axes.lever.load.constant=0.05"
    assert not passive(rate.format(550))[0]
    assert passive(rate.format(1100))[0]
    passed, reason = passive(rate.format(1100), load)
    assert not passed
    assert "allows a drop of only 0.55 per period beside its load; raise that to" in reason
    needed = re.search(r"raise that to ([\d.]+)\.$", reason)
    assert needed is not None
    assert passive(rate.format(float(needed[1])), load)[0]


def test_a_loaded_axis_whose_shares_are_below_a_step_is_refused() -> None:
    base = [*both("effort_quantum=0.001"), *both("effort_rate_limit=1.2")]
    load = ["slave.axes.lever.load={constant: 0.05}"]
    bare = load_rig(SPRING, base)
    assert allowances(bare, command_delays(bare))["slave.lever"].shared_step > 1e-3
    with pytest.raises(ConfigError) as caught:
        certify(load_rig(SPRING, [*base, *load]))
    assert str(caught.value) == (
        "slave.axes.lever.effort_rate_limit: load and coupling get 0.0006 N m a period each, less "
        "than one effort_quantum (0.001), so both would stay 0; give 2 or more (got 1.2)"
    )
    enough = load_rig(SPRING, [*base, *load, "slave.axes.lever.effort_rate_limit=2"])
    assert not allowances(enough, command_delays(enough))["slave.lever"].starved


def test_a_brake_gets_what_a_load_leaves() -> None:
    over = ["operate={hold_effort_share: 0.5}", *both("velocity_limit=15"),
            *both("effort_rate_limit=100")]  # fmt: skip
    rig = load_rig(SPRING, [*over, "slave.axes.lever.load={constant: 0.6}"])
    delay = command_delays(rig)["slave.lever"]
    limit = axis_params(rig, "slave.lever", delay, 0).site.limit
    brake = brake_params(rig, "slave.lever", delay)
    assert brake is not None
    assert brake.stiffness * brake.slip == pytest.approx(0.5 * limit.effort)
    assert limit.effort == pytest.approx(1.1 - 0.66)
    rate = limit.effort_step / brake.period
    spring, damper = brake.stiffness, 2.0 * brake.damping * brake.gain / brake.period
    assert 15.0 * (spring + damper) <= 0.75 * rate * (1.0 + 1e-12)


def test_the_controller_has_what_the_allowance_says() -> None:
    rig = load_rig(SPRING, ["slave.axes.lever.load={constant: 0.3}", *both("effort_rate_limit=80")])
    delay = command_delays(rig)["slave.lever"]
    has = axis_allowance(rig, "slave.lever", delay)
    limit = axis_params(rig, "slave.lever", delay, 0).site.limit
    assert (limit.effort, limit.effort_step) == (has.shared_effort, has.shared_step)
    assert has.shared_rate == 40.0
    assert axis_allowance(rig, "slave.lever", delay) is has


def test_a_load_gets_the_friction_and_damping_that_compensation_leaves() -> None:
    keys = [
        "slave.axes.lever.load={sine: 0.5, constant: 0}", *both("encoder_quantum=1e-4"),
        *both("coulomb={value: 1e-4, lower: 1e-4, source: measured}"),
    ]  # fmt: skip
    shares = "slave.axes.lever.compensation={coulomb: 0.9, viscous: 0.5}"
    plain = load_rig(SPRING, keys)
    less = load_rig(SPRING, [*keys, shares])
    assert element(plain, "load", "slave.lever").passive_quantised.passed
    found = element(less, "load", "slave.lever")
    assert not found.passive_quantised.passed
    assert "of which compensation uses" in found.passive_quantised.reason
    has = allowances(less, command_delays(less))["slave.lever"]
    assert has.loaded_damping == pytest.approx(0.5 * has.damping)
    assert found.numbers["damping_margin"] == pytest.approx(has.loaded_damping - has.load_damping)


def test_the_table_has_alike_axes_once_and_says_who_gets_how_much() -> None:
    rig = load_rig(SPRING, [*both("effort_rate_limit=80"), "slave.axes.lever.load.constant=0.3"])
    rows = allowance_rows(rig, command_delays(rig))
    assert [row[0] for row in rows if row[0]] == ["master.lever", "slave.lever"]
    efforts = [row[2:] for row in rows if row[1] == "effort [N m]"]
    assert efforts == [("1.1", "-", "-", "-", "1.1"), ("1.1", "0.33", "-", "-", "0.77")]
    assert ("rate [N m/s]", "80", "40", "-", "-", "40") in [row[1:] for row in rows]
    alike = load_rig(SPRING, both("effort_rate_limit=80"))
    rows = allowance_rows(alike, command_delays(alike))
    assert [row[0] for row in rows if row[0]] == ["master.lever, slave.lever"]


def test_no_combination_of_features_spends_more_than_an_axis_has() -> None:
    """Load, wall, compensation and brake, alone and together, in every law that takes them."""
    features = {
        "load": ["slave.axes.lever.load={sine: 0.3, constant: 0.1}"],
        "wall": [
            "coupling.pairs.lever.wall_slave={position: 0.3, stiffness: 3.0, damping: 0.0001}"
        ],
        "compensation": [
            "slave.axes.lever.coulomb={value: 0.01, lower: 0.01, source: measured}",
            "slave.axes.lever.compensation={coulomb: 0.5, viscous: 0.3, inertia: 0.2, "
            "inertia_coulomb: 0.4}",
        ],
        "brake": ["operate={hold_effort_share: 1.0}"],
        "account": ["coupling.account={}"],
    }
    base = [*both("velocity_limit=15"), *both("effort_rate_limit=200")]
    for count in range(2 ** len(features)):
        chosen = [name for at, name in enumerate(features) if count >> at & 1]
        rig = load_rig(SPRING, base + [key for name in chosen for key in features[name]])
        delay = command_delays(rig)["slave.lever"]
        has = axis_allowance(rig, "slave.lever", delay)
        site = axis_params(rig, "slave.lever", delay, 0).site
        held = has.load_effort + has.wall_effort + has.compensation_effort + has.coupling_effort
        assert held == pytest.approx(has.effort), chosen
        assert has.load_effort + site.limit.effort <= has.effort * (1.0 + 1e-12), chosen
        assert has.load_step + site.limit.effort_step <= has.effort_step * (1.0 + 1e-12), chosen
        spent = has.load_damping + has.wall_damping + site.compensation.viscous
        assert has.coupling_damping == pytest.approx(max(has.damping - spent, 0.0)), chosen
        paid = site.compensation.coulomb + site.inertia.coulomb + has.load_coulomb
        assert has.coupling_coulomb == pytest.approx(max(has.coulomb - paid, 0.0)), chosen
        brake = brake_params(rig, "slave.lever", delay)
        assert (brake is None) == ("brake" not in chosen or has.brake_damping == 0.0), chosen
        if brake is not None:
            push = brake.stiffness * brake.slip
            assert has.load_effort + push <= has.effort * (1.0 + 1e-12), chosen
            assert brake.device + has.load_damping <= has.damping * (1.0 + 1e-12), chosen
