"""Two runs in two programs: killed, stopped, started anew, refused, and a third one.

By default both in one process: `tests/session/test_sites.py`.
"""

from __future__ import annotations

import json
import random
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from tautwave import read_recording
from tautwave.bench.sites.order import free_port
from tautwave.laws.counters import ENERGY_QUANTUM
from tautwave.sites.certificates import make_authority
from tautwave.sites.datagrams import open_socket
from tautwave.sites.seal import Sealer
from tautwave_sim.network import NetworkOptions, Relay
from tests.commands import END_STOPS
from tests.session.programs import COMMAND, RIG, Site
from tests.sites.test_datagrams import hostile

pytestmark = [pytest.mark.slow, pytest.mark.nightly, pytest.mark.realtime, pytest.mark.timeout(400)]
PATIENT = (
    *END_STOPS,
    "loop.overrun_limit=20000",
    "duration_s=1000",
    "link.lost_s=60",
    "sites.wait_s=100",
)
"""A loaded machine oversleeps for longer than a rig should allow."""

HELD = "simulation.hand.lever.reference={type: minimum_jerk, waypoints: [[0, 0], [0.2, 0.15]]}"

Start = Callable[..., Site]


@pytest.fixture
def port() -> int:
    return free_port()


@pytest.fixture
def start(tmp_path: Path, port: int) -> Iterator[Start]:
    make_authority(tmp_path / "keys", ["master", "slave"])
    text = RIG.read_text().replace("serves: slave", f"serves: slave\n  port: {port}")
    (tmp_path / "rig.yaml").write_text(text)
    with ExitStack() as stack:

        def begin(side: str, *changes: str, name: str = "") -> Site:
            site = Site(tmp_path, side, name or side, *PATIENT, *changes)
            stack.callback(site.close)
            return site

        yield begin


def both(start: Start, *changes: str) -> tuple[Site, Site]:
    """Return master and slave, engaged."""
    sites = start("master", *changes), start("slave", *changes)
    together(*sites)
    return sites


def together(*sites: Site, slots: int = 300) -> None:
    """Wait until the sites are engaged, and have been for some slots."""
    for site in sites:
        site.until(site.coupled)
    for site in sites:
        begun = site.now("link.slot")
        site.until(lambda site=site, begun=begun: site.now("link.slot") > begun + slots)  # type: ignore[misc]


ACCOUNT = (
    "coupling={law: position, account: {}, pairs: {lever: {stiffness: 8.0, damping: 0.05}}}",
)


@pytest.mark.parametrize("law", [(), ACCOUNT], ids=["wave", "account"])
def test_both_end_together_and_their_books_close(
    start: Start, tmp_path: Path, law: tuple[str, ...]
) -> None:
    master, slave = both(start, *law)
    master.interrupt()
    assert (master.ended(), slave.ended()) == (0, 0)
    words = [*COMMAND, "report", str(master.out), str(slave.out), "--out", str(tmp_path / "both")]
    subprocess.run(words, check=True)
    found = json.loads((tmp_path / "both" / "compare.json").read_text())
    pair = found["pairs"]["lever"]
    # Counters of energy cross the line, in whole quanta: a short run has little flow beside them.
    assert pair["residual"] < 1e-9 * pair["gross_flow"] + 8 * ENERGY_QUANTUM
    assert pair["under_way_at_end"] >= -2e-6  # the reserves of both receivers
    least, most = pair["under_way_least"]
    assert least <= most
    assert most >= -2e-6
    assert pair["position_error"]["rms"] < 0.03
    assert 0.0 <= pair["given"] <= pair["claimed"]
    assert (tmp_path / "both" / "joined-lever.svg").stat().st_size > 10_000
    assert len(found["sessions"]) == 1


@pytest.mark.parametrize("killed", [0, 1], ids=["master", "slave"])
def test_who_is_killed_is_lost(start: Start, killed: int) -> None:
    sites = both(start, "link.lost_s=2")
    sites[killed].process.kill()
    other = sites[1 - killed]
    assert other.ended() == 5
    name = ("master", "slave")[killed]
    assert f"{name} has been lost since" in other.said()
    assert "not back within 2 s" in other.said()
    assert "Traceback" not in other.said()


@pytest.mark.parametrize(
    ("seconds", "backlog"), [(0.05, 10.0), (0.5, 10.0), (3.0, 1e-4), (10.0, 10.0)]
)
def test_who_is_stopped_for_a_while_goes_on_or_begins_anew(
    start: Start, seconds: float, backlog: float
) -> None:
    master, slave = both(start, f"sites.greatest_backlog={backlog}")
    master.stop_for(seconds)
    together(master, slave)
    slave.interrupt()
    assert (master.ended(), slave.ended()) == (0, 0)
    for site in (master, slave):
        sessions = site.link()["sessions"]
        assert "engaged_s" in sessions[-1]
        assert sessions[0].get("silences") or seconds < 0.3
        assert len(sessions) > 1 or backlog > 1.0
        assert "Traceback" not in site.said()
    if seconds > 0.3:
        why = [one["why"] for one in master.link()["sessions"][0]["silences"]]
        assert any("this program was suspended for" in one for one in why)


def test_who_stood_still_for_longer_than_its_claim_allows_stops_and_says_so(start: Start) -> None:
    master, slave = start("master", "loop.overrun_limit=1500"), start("slave", "link.lost_s=4")
    together(master, slave)
    master.stop_for(3.0)
    assert (master.ended(), slave.ended()) == (6, 5)
    assert "slots of 1 ms were missed in a row" in master.said()
    assert "master has been lost since" in slave.said()
    assert "it stopped: " in slave.said()


def test_who_is_stopped_for_longer_than_the_other_waits_is_lost(start: Start) -> None:
    master, slave = both(start, "link.lost_s=2")
    master.stop_for(5.0)
    assert slave.ended() == 5
    assert "master has been lost since" in slave.said()
    assert master.ended() in (0, 5)
    assert "Traceback" not in master.said()


class Eavesdropper(Relay):
    """A relay that keeps how to send again what it sent on to the site that serves."""

    def __init__(self, port: int) -> None:
        super().__init__(NetworkOptions(to=f"127.0.0.1:{port}", listen="127.0.0.1:0"))  # type: ignore[call-arg]
        self.kept: list[Callable[[], Any]] = []

    def _send(self, direction: int, act: Callable[[], Any]) -> None:
        if direction == 0:
            self.kept.append(act)
        super()._send(direction, act)


@pytest.fixture
def relay(port: int) -> Iterator[Eavesdropper]:
    made, over = Eavesdropper(port), threading.Event()
    thread = threading.Thread(target=made.run, args=(over.is_set,))
    thread.start()
    yield made
    over.set()
    thread.join()
    made.close()


def test_a_slave_that_is_started_anew_is_brought_into_place(start: Start) -> None:
    away = "simulation.environment.lever={type: free}"
    master, slave = both(start, HELD, away)
    slave.process.kill()
    slave.process.wait()
    again = start("slave", HELD, away, name="again")  # its device stands at 0
    renewed(master, again)
    link, before = again.link(), master.now("master.lever.position")
    assert link["granted_j"]["lever"] > 0.0
    assert abs(before) > 0.1
    aligned = read_recording(again.out, ["link.aligning", "slave.lever.position"])
    assert aligned["link.aligning"].max() == 1.0
    assert abs(aligned["slave.lever.position"][-1] - before) < 0.06


def test_of_a_master_that_is_started_anew_old_packets_are_refused(
    start: Start, relay: Eavesdropper
) -> None:
    through = "sites.slave.address={}:{}".format(*relay.address)
    master, slave = both(start, through)
    master.process.kill()
    master.process.wait()
    old = relay.kept[-200:]
    again = start("master", through, name="again")
    together(again, slave)
    for k, send in enumerate(old):  # from the very address that the slave listens to
        send()
        if k % 10 == 9:
            slot = slave.now("link.slot")
            slave.until(lambda slot=slot: slave.now("link.slot") > slot + 2)  # type: ignore[misc]
    renewed(slave, again)
    link = slave.link()
    # The relay sent on what either master sent: not one more was accepted.
    assert 150 < link["refused"]["old_session"] <= 200  # a stalled loop's buffer is soon full
    assert 0 < link["packets"] <= len(relay.kept)


def test_a_hundred_thousand_hostile_datagrams_disturb_no_session(
    start: Start, relay: Eavesdropper, port: int
) -> None:
    changes = ("sites.slave.address={}:{}".format(*relay.address), "sites.greatest_backlog=10")
    master, slave = both(start, *changes)
    good = [send.args[0] for send in relay.kept[-50:]]  # type: ignore[attr-defined]
    source = random.Random(8)
    old = Sealer(source.randbytes(32), source.randbytes(8), "master")
    other = Sealer(source.randbytes(32), good[0][1:9], "master")  # knows the session, not its key
    with open_socket("127.0.0.1", 0) as stranger:
        for k in range(100_000):
            stranger.sendto(hostile(source, good, old, other), ("127.0.0.1", port))
            if k % 15 == 0:
                time.sleep(1e-3)
    together(master, slave)
    slave.interrupt()
    assert (master.ended(), slave.ended()) == (0, 0)
    assert len(master.link()["sessions"]) == len(slave.link()["sessions"]) == 1
    link = slave.link()
    assert 0 < link["packets"] <= len(relay.kept)
    assert sum(link["refused"].values()) > 50_000  # a stalled loop's buffer is soon full
    assert all(link["refused"].values())


def renewed(other: Site, again: Site) -> None:
    """Look whether a site that was started anew is in a session of its own with the other."""
    together(other, again)
    again.interrupt()
    assert (again.ended(), other.ended()) == (0, 0)
    first, *_, second = other.link()["sessions"]
    assert first["id"] != second["id"]
    assert second["engaged_s"] > first["engaged_s"]
    assert again.link()["sessions"][-1]["id"] == second["id"]


def test_a_third_with_the_masters_certificate_is_refused(start: Start) -> None:
    master, slave = both(start)
    third = start("master", name="third")
    third.until("master is already in a session here")
    third.interrupt()
    assert third.ended() in (1, 130)
    assert not third.out.exists()
    together(master, slave)
    slave.interrupt()
    assert (master.ended(), slave.ended()) == (0, 0)
    ids = [[one["id"] for one in site.link()["sessions"]] for site in (master, slave)]
    assert ids[0] == ids[1]


def test_another_rig_is_refused_on_both_sides_before_anything_moves(start: Start) -> None:
    slave = start("slave")
    slave.until("waits for master")
    master = start("master", "coupling.pairs.lever.wave_impedance=0.06")
    assert master.ended() == 5
    assert "the rigs differ: coupling.pairs.lever.wave_impedance: 0.06 here, 0.05 there" in (
        master.said()
    )
    slave.until("wave_impedance: 0.05 here, 0.06 there")
    assert not master.out.exists()
    slave.interrupt()
    assert slave.ended() in (1, 130)
    assert "Traceback" not in slave.said() + master.said()
