"""Books of a pair over a network, what its receivers may give, and how it gets over silence."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tautwave.couplings.wave.link import LinkPair
from tautwave.errors import SafetyStop
from tautwave.laws.counters import ENERGY_QUANTUM
from tautwave.laws.receiver import RESERVE
from tests.rigs.running import Run, Tree, books, pair_of, run_rig, tree

HELD: Tree = {
    "duration_s": 0.6,
    "master.axes.a.damping": 1.0,
    "slave.axes.a.damping": 1.0,
    "simulation.hand.a": {
        "reference": {"type": "minimum_jerk", "waypoints": [[0.02, 0.0], [0.25, 0.1]]}
    },
}


def link(**keys: object) -> Tree:
    return {"link": {"delay_s": 0.003, "depth_s": 0.004, "silence_s": 0.05, **keys}}


def least_quanta(run: Run, element: str) -> int:
    """Return the least that an element held, in whole quanta."""
    quanta = run[f"a.{element}.stored"] / ENERGY_QUANTUM
    assert np.array_equal(quanta, np.round(quanta))
    return int(quanta.min())


def assert_kept(run: Run) -> None:
    """The books close, and no receiver gave more than it got: a comparison of integers."""
    found = books(run)
    assert found.residual < 1e-9 * found.gross_flow + 1e-10
    assert found.element_residual < 1e-10
    for side in ("master", "slave"):
        assert least_quanta(run, f"receiver_{side}") >= -RESERVE / ENERGY_QUANTUM
    assert least_quanta(run, "network") >= 0


@pytest.mark.sparse(2)
@pytest.mark.parametrize("divisor", [1, 4])
@pytest.mark.parametrize("play_out", ["fixed", "newest"])
def test_books_close(divisor: int, play_out: str) -> None:
    bad = link(jitter_s=0.004, loss=0.3, burst=3, duplicate=0.1, play_out=play_out)
    run = run_rig(tree(HELD, bad, {"buses.arm.divisor": divisor}))
    assert_kept(run)
    assert books(run).gross_flow > 0.01
    assert run["a.receiver_slave.absorbed"].max() > 1e-4


@pytest.mark.slow
@pytest.mark.nightly
@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.data())
def test_books_close_whatever_the_network_is(data: st.DataObject) -> None:
    def among(*values: object) -> object:
        return data.draw(st.sampled_from(values))

    keys = {
        "delay_s": among(0.0, 0.001, 0.02),
        "jitter_s": among(0.0, 0.01),
        "jitter": among("uniform", "exponential", "spikes"),
        "loss": among(0.0, 0.1, 0.45),
        "burst": among(1, 4, 20),
        "duplicate": among(0.0, 0.2),
        "reorder": among(True, False),
        "outage_at_s": 0.1,
        "outage_s": among(0.0, 0.2),
        "play_out": among("fixed", "newest"),
        "depth_s": among("auto", 0.0, 0.01),
        "repeated": among(0, 3),
        "seed": data.draw(st.integers(0, 99)),
    }
    faults = {
        "missing_probability": among(0.0, 0.05),
        "overrun_probability": among(0.0, 0.02),
        "overrun_slots": 3,
    }
    divisors = {"buses.hand.divisor": among(1, 2), "buses.arm.divisor": among(1, 4)}
    assert_kept(run_rig(tree(HELD, {"link": keys, "simulation.faults": faults}, divisors)))


def test_a_network_that_only_delays_is_the_line() -> None:
    """Waves come out as they went in, after the delay and the depth, to a quantum."""
    run = run_rig(tree(HELD, link()))
    sent, came = run["master.a.wave_out"], run["slave.a.wave_in"]
    assert np.abs(came[7:] - sent[:-7]).max() < 1e-8
    assert run["slave.a.link_delay"][20:].tolist() == [pytest.approx(0.007)] * 580
    assert run["slave.a.link_cut"][-1] == 0.0


def test_silence_is_a_hold_and_both_meet_again() -> None:
    """Two outages: no wave comes out, and what is owed waits; then it is repaid, slowly enough.

    At a quarter of the limit of 4 m/s the second outage comes before all is repaid.
    """
    slow = {f"{side}.axes.a.velocity_limit": 4.0 for side in ("master", "slave")}
    outages = {"outage_at_s": 0.1, "outage_s": 0.15, "outage_every_s": 0.2}
    run = run_rig(tree(HELD, link(**outages), slow, {"duration_s": 0.5}))
    silent = run["slave.a.link_silence"] > 0.051
    owed = run["slave.a.link_backlog"]
    assert 160 < np.count_nonzero(silent) < 220
    assert np.all(run["slave.a.wave_in"][silent] == 0.0)
    second = silent & (np.arange(len(silent)) > 300)
    assert np.abs(owed[second]).min() > 0.01
    assert np.ptp(owed[second]) == 0.0
    once = run_rig(tree(HELD, link(outage_at_s=0.1, outage_s=0.15), slow, {"duration_s": 1.3}))
    paid = np.diff(np.abs(once["slave.a.link_backlog"][250:400]))
    assert -paid.min() == pytest.approx(1e-3, rel=0.01)
    assert np.abs(once["slave.a.link_backlog"][-1]) < 1e-6
    assert abs(once["a.position_error"][-1]) < 1e-3
    assert_kept(run)
    assert_kept(once)


@pytest.mark.slow
def test_a_force_that_silence_took_is_owed_until_the_hand_gives_way() -> None:
    """What was in spring and hand is heat: energy is short in every slot, and nothing is made."""
    waypoints = [[0.02, 0.0], [0.2, 0.1], [1.5, 0.1], [1.7, 0.0]]
    contact = {
        "simulation.environment.a": {"type": "spring", "stiffness": 300.0, "position": 0.0},
        "simulation.hand.a.reference.waypoints": waypoints,
        "duration_s": 2.6,
    }
    outage = {"outage_at_s": 0.5, "outage_s": 0.2}
    run = run_rig(tree(HELD, link(**outage), contact))
    before, after = (np.abs(run["slave.a.port_effort"][at : at + 50]).mean() for at in (430, 1400))
    assert after < 0.9 * before
    owed, cut = run["slave.a.link_backlog"], run["slave.a.link_cut"]
    assert owed[1400] > 1e-4
    assert cut[1450] - cut[1400] == 50.0
    assert abs(owed[-1]) < 1e-6
    assert cut[-1] == cut[-50]
    assert_kept(run)


def test_a_peer_that_stays_away_ends_the_run() -> None:
    data = tree(HELD, link(outage_at_s=0.1, outage_s=9.0, lost_s=0.2), {"duration_s": 1.2})
    with pytest.raises(
        SafetyStop,
        match=r"lost the other side at .* received from it for 0\.2\d* s \(link\.lost_s: 0\.2\)",
    ):
        run_rig(data)
    stopped = run_rig(data, raises=False)
    place = stopped.result.stop
    assert place is not None
    assert place.reason == "peer_lost"
    assert place.at_s == pytest.approx(0.3, abs=0.02)
    assert_kept(stopped)


def test_a_host_that_sleeps_sends_nothing() -> None:
    """Slots that the loop skipped are in the next packet, as slots in which nothing left."""
    asleep = {"simulation.faults": {"overrun_probability": 0.03, "overrun_slots": 2}}
    run = run_rig(tree(HELD, link(), asleep))
    skipped = int(run["skipped_slots"].sum())
    assert skipped > 20
    arrived = pair_of(run.assembly).state.link.slave.network.arrived
    assert len(run.table) - 10 < arrived < len(run.table)
    assert run["slave.a.link_lost"][-1] == 0.0
    assert np.abs(run["slave.a.link_backlog"]).max() < 1e-9
    assert_kept(run)


def spend_at_slave(link: LinkPair) -> None:
    link.slave.receiver.spent += 1 << 42


def lose_at_master(link: LinkPair) -> None:
    link.master.afloat -= 1 << 42


@pytest.mark.parametrize("rob", [spend_at_slave, lose_at_master])
def test_a_receiver_that_gives_more_than_it_got_ends_the_run(
    rob: Callable[[LinkPair], None],
) -> None:
    """Spent energy that never came, or came without being sent, as no law does."""

    def robbed(built: object) -> None:
        pair = pair_of(built)  # type: ignore[arg-type]
        exchange = pair.control.law.steps.exchange
        slots = [0]

        def spend(*given: object) -> None:
            exchange(*given)
            slots[0] += 1
            if slots[0] == 200:
                rob(pair.state.link)

        steps = pair.control.law.steps._replace(exchange=spend)
        pair.control.law = pair.control.law._replace(steps=steps)

    with pytest.raises(SafetyStop, match="got more energy from its receiver than was sent to it"):
        run_rig(tree(HELD, link()), change=robbed)
