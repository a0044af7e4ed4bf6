"""One of two sites: engaging, holding, going on, beginning anew, stopping, and its books."""

from __future__ import annotations

import numpy as np
import pytest

from tautwave.errors import ConfigError, LinkError
from tautwave.link.clocks import Exchange
from tautwave.link.packet import Packet, write_packet
from tautwave.sites.datagrams import DataPort, open_socket
from tautwave.sites.seal import Sealer
from tests.session.sites import Make

SLOW = pytest.mark.slow
PLACE = ("coupling.pairs.lever.offset=0.1", "coupling.pairs.lever.engage_tolerance=0.01")


def test_both_engage_and_follow_and_their_books_close(pair: Make) -> None:
    two = pair()
    two.run(1200)
    one, other = two.master, two.slave
    assert np.ptp(one["master.lever.position"]) > 0.05
    apart = one["master.lever.position"][-200:] - other["slave.lever.position"][-200:]
    assert np.max(np.abs(apart)) < 0.03
    assert one.residual() < 1e-9
    assert other.residual() < 1e-9
    away = one["lever.network.stored"] + other["lever.network.stored"]
    assert away.min() >= 0.0
    assert away.max() > 0.0
    assert "slave.lever.position" not in one.control.columns
    assert not [name for name in other.control.columns if "master" in name]


def test_silence_is_a_hold_and_the_session_goes_on_after_it(pair: Make) -> None:
    two = pair()
    two.run(500)
    two.run(200, cut=True)
    assert two.slave.held
    assert two.master.held
    control = two.slave.control
    own = control.axes[control._own[0]]
    assert own.stopping  # its damping in place of the coupling
    assert np.abs(two.slave["slave.lever.wave_in"][-50:]).max() == 0.0
    two.run(400)
    assert not two.slave.held
    assert not own.stopping
    assert 600 < control.state.armed_at < 720  # its ramp, again
    (session,) = control.sessions
    assert session["silences"][0]["for_s"] == pytest.approx(0.1, abs=0.02)
    assert two.slave.residual() < 1e-9
    apart = two.master["master.lever.position"][-1] - two.slave["slave.lever.position"][-1]
    assert abs(apart) < 2e-3


def test_who_stays_away_is_lost_with_who_when_and_why(pair: Make) -> None:
    two = pair()
    two.run(500)
    while two.slave.slot < two.slave.control.end:
        two.run(1, two.slave)
    error, place = two.slave.control.error(), two.slave.control.place()
    assert isinstance(error, LinkError)
    assert (
        "master has been lost since 0.600 s: nothing received "
        "from it; not back within 1 s" in str(error)
    )
    assert place is not None
    assert place.reason == "peer_lost"
    assert abs(two.slave["slave.lever.commanded"][-1]) < 1e-3  # the end of its ramp


def test_another_start_is_a_session_into_which_nothing_crosses(pair: Make) -> None:
    two = pair()
    two.run(500)
    before = two.slave["slave.lever.port_energy"][-1]
    two.renew("its program ended")
    two.run(1)
    assert two.slave.held
    two.until(lambda: len(two.master.control.sessions[-1]) > 2 and not two.slave.held)
    ends = two.slave.control._ends[0][0], two.master.control._ends[0][0]
    assert all(end.slot < 20 and end.sender.slot < 20 for end in ends)
    two.run(500)
    assert len(two.used) == len(two.slave.control.sessions) == 2
    assert two.slave.residual() < 1e-9
    assert two.master.residual() < 1e-9
    stored = two.slave["lever.receiver_slave.stored"]
    assert stored[two.slave["link.slot"] == 0].max() < 1e-12
    assert abs(two.slave["slave.lever.port_energy"][501] - before) < 1e-3  # the sum goes on


@pytest.mark.parametrize("stands", [5.0, -1e308, 1e308])
def test_a_place_that_the_slave_cannot_reach_is_not_gone_to(pair: Make, stands: float) -> None:
    two = pair(*PLACE, "simulation.hand.lever.reference={type: minimum_jerk, waypoints: [[0, 0]]}")
    said = {"at": {"lever": stands}, "to": None, "offsets": {}}
    two.slave.line.inbox.append({"peer": {"stands": said}})
    two.run(300, two.slave)
    assert "is outside its position_range" in two.slave.control._meeting.hindrance
    assert np.abs(two.slave["slave.lever.position"]).max() < 1e-3
    assert sum(two.slave.control._meeting.rest.granted) < 1e-2  # a hold's only
    two.until(lambda: two.slave.control._engaged, 5000)  # the master stands elsewhere in truth
    assert two.slave["slave.lever.position"][-1] == pytest.approx(-0.1, abs=0.01)
    assert two.slave.control._meeting.hindrance == ""


@pytest.mark.slow
def test_too_much_missed_is_a_new_session(pair: Make) -> None:
    two = pair("sites.greatest_backlog=0.001")
    two.run(500)
    two.run(200, cut=True)  # the hand moves on, and nobody says so
    two.run(300)
    assert len(two.slave.control.sessions) == 2
    two.until(lambda: not two.slave.held)


@pytest.mark.sparse(3)
@pytest.mark.parametrize(
    ("slots", "backlog", "sessions"),
    [(60, 0.1, 1), (200, 10.0, 1), (200, 1e-3, 2), pytest.param(4000, 1e-3, 2, marks=SLOW)],
)
def test_a_site_that_stood_still_goes_on_or_begins_anew(
    pair: Make, slots: int, backlog: float, sessions: int
) -> None:
    """Stopped by its host: to both sites that is a silence."""
    two = pair(f"sites.greatest_backlog={backlog}", "link.lost_s=5")
    two.run(300)
    two.run(slots, two.slave)  # the master's next cycle finds that so many slots went by
    two.run(200 if sessions == 1 else 500)
    for half in (two.master, two.slave):
        assert half.control.error() is None
        assert not half.held
        assert len(half.control.sessions) == sessions
        assert half.residual() < 1e-9
    silences = two.master.control.sessions[0].get("silences", [])
    assert bool(silences) is (slots > 100)
    if silences:
        assert silences[0]["why"] == f"this program was suspended for {1e-3 * slots:.3g} s"


@pytest.mark.parametrize("silent", [True, False])
def test_a_port_that_cannot_repay_a_silence_ends_the_session_and_else_the_run(
    pair: Make, silent: bool
) -> None:
    two = pair()
    two.run(300)
    if silent:
        two.run(150, cut=True)
        two.run(5)
    control = two.master.control
    control.axes[control._own[0]].end.account = -10.0
    two.run(300)
    assert len(control.sessions) == 1 + silent
    assert (control.error() is None) is silent
    if silent:
        assert not two.master.held
        assert not two.slave.held


def test_who_stops_says_why_and_the_other_holds_at_once(pair: Make) -> None:
    two = pair("master.axes.lever.position_range=[-0.02, 0.02]")
    two.until(lambda: two.master.control.stopped)
    two.run(2)
    assert two.slave.held
    why = two.slave.control.sessions[0]["silences"][0]["why"]
    assert "it stopped: master.lever left its position range" in why


def test_who_ends_ends_the_other_without_a_fault(pair: Make) -> None:
    two = pair()
    two.run(500)
    two.master.control.stop_after(two.master.slot)
    while two.slave.slot < two.slave.control.end:
        two.run(1)
    assert two.slave.control.error() is None
    ended = two.slave.control.ended
    assert ended.startswith("master ended the session at 0.")
    assert ended.endswith(" s of this run")
    assert two.slave.slot < 1000  # of ten thousand


def test_the_other_rigs_numbers_are_refused_before_they_count(pair: Make) -> None:
    two = pair()
    for said in ({"lever": float("nan")}, {"lever": "x"}, {}, [1], {"lever": 0.0, "more": 1.0}):
        two.slave.line.inbox.append({"peer": {"began": said, "ready": said}})
        two.run(1, two.slave)
        assert not two.slave.control._engaged


def test_packets_of_an_old_session_and_of_a_third_change_nothing(pair: Make) -> None:
    two = pair()
    two.run(400)
    old = two.session("slave")
    line = two.master.control._say()[1][0]
    two.renew("again")
    two.run(300)
    control = two.slave.control
    accepted, before = control._endpoint.got, dict(control._endpoint.count())
    port = two.sockets[0].getsockname()
    payload = write_packet(Packet(0, 10_000, 1, 0, 0, (line,)))
    with open_socket("127.0.0.1", 0) as third:
        own = DataPort(third, old, "master", port)
        for _ in range(8):
            own.send(payload)  # of the session before
            stranger = Sealer(bytes(32), bytes.fromhex(control.sessions[-1]["id"]), "master")
            third.sendto(stranger.seal(payload), port)
        newest = control._ends[0][0].receiver.newest
        two.run(1, two.slave)
        assert control._endpoint.got == accepted
        assert control._ends[0][0].receiver.newest == newest
        refused = control._endpoint.count()
        found = {why: n - before[why] for why, n in refused.items() if n > before[why]}
        assert found == {"old_session": 8, "forged": 8}


def test_notes_of_strangers_do_not_pile_up(pair: Make) -> None:
    two = pair()
    for k in range(60):
        two.slave.line.inbox.append({"note": f"{k}: TLS failed"})
    two.run(2)
    assert two.slave.control.sessions[-1]["notes"] == [f"{k}: TLS failed" for k in range(50)]


def test_a_session_is_never_used_twice(pair: Make) -> None:
    two = pair()
    with pytest.raises(LinkError, match="was used before"):
        two.slave.control._endpoint.join(two.session("master"), None)


def test_the_followers_slots_are_stretched_by_200_ppm_at_most(pair: Make) -> None:
    two = pair()
    two.run(100)
    control = two.master.control  # it dials
    endpoint = control._endpoint
    moved = []
    for rate in (5e-4, -5e-4, 3e-5):
        endpoint._line = (0.0, rate)
        pace = control._pace
        pace.stretch = endpoint.stretch(0.0)
        before = pace.trimmed
        for _ in range(1000):
            pace.step(0, -1)
        moved.append(pace.trimmed - before)
    assert moved == pytest.approx([-2e-4, 2e-4, -3e-5], abs=2e-8)
    assert two.slave.control.trim_ns == 0


def test_a_leader_whose_clock_begins_anew_is_followed_in_the_next_session(pair: Make) -> None:
    two = pair()
    two.run(100)
    slave, anew = two.slave.control, two.clock.now_ns()
    slave._now_ns = slave._endpoint._now_ns = lambda: two.clock.now_ns() - anew
    slave._endpoint.heard_ns = 0
    two.renew("its program ended")
    two.run(50)
    two.master.control._endpoint._looked_ns = 0
    two.run(50)
    assert len(two.used) == 2
    assert abs(two.master.control._pace.stretch) < 1e-6
    assert np.abs(two.master["link.delay_s"]).max() < 2e-3


def test_a_leader_whose_clock_stood_still_is_not_chased(pair: Make) -> None:
    two = pair()
    two.run(100)
    endpoint, pace = two.master.control._endpoint, two.master.control._pace
    endpoint._looked_ns = -(10**9)
    pace.join()
    for second, offset in enumerate((0.0, 1e-4, 5.0, 5.0)):
        endpoint._best = (Exchange(float(second), offset, 1e-3),)
        pace.step(second * 10**9, -1)
        assert pace.stretch == pytest.approx(-1e-5 if second == 1 else 0.0, abs=1e-6)


def test_a_half_is_not_simulated_alone(pair: Make) -> None:
    from tautwave import simulate

    with pytest.raises(ConfigError, match="one site's half"):
        simulate(pair().master.rig)
