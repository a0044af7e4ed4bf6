"""Rigs with slow buses: nothing is invented, whatever the ratio, phase, loss or motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tautwave.certificate import certify
from tautwave.couplings.wave import law as rates
from tautwave.errors import ConfigError
from tautwave.rig import Assembly
from tautwave.session.identification.identifying import identify_device
from tests.analysis.reference.conversion import hold_matrix, pick_matrix
from tests.certificate.rigs import element
from tests.examples import tried
from tests.rigs.closing import (
    ALL,
    CONTACT,
    EXACT,
    FRICTION,
    MISHAPS,
    MOTION,
    SENSORS,
    SIDES,
    assert_closed,
    assert_passive,
    assert_within_reserves,
    check_any,
    impedance,
    line,
    slow,
)
from tests.rigs.drawing import rigs
from tests.rigs.running import Tree, books, pair_of, rig_of, run_rig, tree

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
            if pair["wave_filter_hz"] is not None:
                pair["wave_filter_hz"] = min(pair["wave_filter_hz"], 490.0 / divisor)
            wall = pair.get(f"wall_{side}")
            if wall is not None:  # to the edge of stability at that rate
                wall["stiffness"] /= divisor**2
                wall["damping"] /= divisor
    nyquist = 500.0 / divisors["master"]
    for hand in data["simulation"]["hand"].values():
        for component in hand["reference"]["components"]:
            component[0] = min(component[0], 0.9 * nyquist)
    return data


@settings(max_examples=tried(25), suppress_health_check=list(HealthCheck))
@given(slow_rigs(cycles=400))
def test_no_rig_with_slow_buses_generates_energy(data: Tree) -> None:
    check_any(data)


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.timeout(900)  # shrinking a counterexample takes its time
@settings(max_examples=20, suppress_health_check=list(HealthCheck))
@given(slow_rigs(cycles=1500))
def test_many_rigs_with_slow_buses_generate_no_energy(data: Tree) -> None:
    check_any(data)


CALM: Tree = {
    "coupling.pairs.a.wave_filter_hz": 2.0,
    **{
        f"{side}.axes.a.{key}": value
        for side in SIDES
        for key, value in (
            ("damping", {"value": 2.0, "lower": 2.0, "source": "test"}),
            ("effort_rate_limit", 1e5),
        )
    },
}
"""What a pair at 20 Hz needs to be certified; far from it (b = 10) it grows until a stop."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("master", "slave", "samples", "b", "features"),
    [
        (1, 10, 0, 10.0, ()), (1, 10, 7, 3.0, ALL), (10, 1, 7, 100.0, (MISHAPS,)),
        (3, 7, 5, 30.0, (SENSORS, FRICTION)), (7, 3, 50, 30.0, ALL),
        (50, 49, 20, 1.0, (MISHAPS, CALM)),
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
    limits = {f"{side}.axes.a.velocity_limit": 4.0 for side in SIDES}  # reserves go with its square
    data = tree(*changes, more, calm, hand, limits)
    if CALM in features:
        # With periods of 50 ms it is refused for its joules, and for nothing else.
        certificate = certify(rig_of(tree({"loop.missing_limit": 2}, base=data)))
        ports = [element(certificate, f"{side}.a port").passive for side in SIDES]
        assert all("port: it may supply " in port.reason for port in ports), ports
    run = run_rig(data)
    environment = run["true.slave.a.environment_effort"]
    assert np.count_nonzero(np.diff(environment != 0.0)) > 5  # contacts and releases
    assert_passive(run)
    assert_within_reserves(run)


@pytest.mark.sparse(4)
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
    assert element(certify(rig_of(data)), "slave.a port").passive.passed
    quick = certify(rig_of(tree(MOTION, line(7), changes)))
    assert not element(quick, "slave.a port").passive.passed


@pytest.mark.slow
def test_free_masses_gain_only_the_reserve_of_a_throw_at_any_ratio() -> None:
    """A port at rest does not expect a throw: that costs a reserve at most, and only once.

    The claim is 2 E0. Waves are sent out of what a tank has, and no held effort overdraws one
    here: then it is E0, which is there for a velocity that is wrong by its limit.
    """
    limits = {f"{side}.axes.a.velocity_limit": 0.4 for side in SIDES}
    for master, slave, samples, b in [(1, 10, 5, 10.0), (10, 1, 0, 3.0), (3, 7, 2, 30.0),
                                      (1, 50, 20, 5.0), (49, 50, 1, 2.0)]:  # fmt: skip

        def throw(built: Assembly) -> None:
            built.simulators[0].axes[0].physics.v = 0.3

        run = run_rig(
            tree(slow(master, slave), line(samples), impedance(b), limits, {"duration_s": 5.0}),
            change=throw,
        )
        kinetic = sum(run[f"plant.{side}.a.kinetic"] for side in SIDES)
        start = 0.5 * 0.5 * 0.3**2
        reserves = {
            f"port_{side}": params.end.port.reserve
            for side, (params, _) in pair_of(run.assembly).axes.items()
        }
        assert kinetic.max() <= start + sum(reserves.values())
        for name, energy in books(run).generated.items():
            assert energy <= reserves.get(name, 1e-12), name
        for port in reserves:
            given_out = -run[f"a.{port}.absorbed"]
            assert given_out[1000:].max() <= given_out[:1000].max()


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


def test_identify_refuses_a_slow_bus_in_a_sentence(tmp_path: Path) -> None:
    rig = rig_of(tree(slow(1, 2), {"slave.axes.a.position_range": [-1.0, 1.0]}))
    with pytest.raises(ConfigError, match=r"buses\.arm\.divisor: .* --set rate_hz=500"):
        identify_device(rig, axis="slave.a", out=tmp_path / "out")
    assert not (tmp_path / "out").exists()
