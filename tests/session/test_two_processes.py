"""Two runs in two programs: killed, stopped, started anew, refused, and a third one."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from tautwave.bench.sites.order import free_port
from tautwave.sites.certificates import make_authority

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[2]
RIG = ROOT / "configs" / "network-loopback.yaml"
COMMAND = [sys.executable, "-c", "from tautwave.cli import main; main(prog_name='tautwave')"]


class Site:
    """A `tautwave run --site` and what it says."""

    def __init__(self, folder: Path, side: str, name: str, *changes: str) -> None:
        self.out = folder / name
        self._log = (folder / f"{name}.log").open("w")
        words = [word for change in changes for word in ("--set", change)]
        self.process = subprocess.Popen(
            [*COMMAND, "run", "rig.yaml", "--site", side, "--out", str(self.out), *words],
            cwd=folder, stdout=self._log, stderr=subprocess.STDOUT,
        )  # fmt: skip

    def said(self) -> str:
        return Path(self._log.name).read_text(encoding="utf-8")

    def until(self, text: str) -> None:
        for _ in range(600):
            if text in self.said():
                return
            time.sleep(0.1)
        raise AssertionError(f"{text!r} is not in {self.said()}")

    def ended(self) -> int:
        return self.process.wait(90)

    def link(self) -> dict[str, Any]:
        found: dict[str, Any] = json.loads((self.out / "summary.json").read_text())["link"]
        return found

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        self._log.close()


Start = Callable[..., Site]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    make_authority(tmp_path / "keys", ["master", "slave"])
    text = RIG.read_text().replace("serves: slave", f"serves: slave\n  port: {free_port()}")
    (tmp_path / "rig.yaml").write_text(text)
    with ExitStack() as stack:

        def begin(side: str, *changes: str, name: str = "") -> Site:
            # A loaded machine oversleeps for longer than a rig should allow.
            patient = ("loop.overrun_limit=20000", "duration_s=12", "link.lost_s=6", *changes)
            site = Site(tmp_path, side, name or side, *patient)
            stack.callback(site.close)
            return site

        yield begin


def both(start: Start, *changes: str) -> tuple[Site, Site]:
    """Return master and slave, in a session and moving for a second."""
    sites = start("master", *changes), start("slave", *changes)
    for site in sites:
        site.until("in session")
        site.until("running")
    time.sleep(1.0)
    return sites


def test_both_end_together_and_their_books_close(start: Start, tmp_path: Path) -> None:
    master, slave = both(start)
    assert (master.ended(), slave.ended()) == (0, 0)
    words = [*COMMAND, "report", str(master.out), str(slave.out), "--out", str(tmp_path / "both")]
    subprocess.run(words, check=True)
    found = json.loads((tmp_path / "both" / "compare.json").read_text())
    pair = found["pairs"]["lever"]
    assert pair["residual"] < 1e-9 * pair["gross_flow"]
    assert pair["under_way_least"] >= -2e-6  # the reserves of both receivers
    assert pair["position_error"]["rms"] < 0.03
    assert len(found["sessions"]) == 1


@pytest.mark.parametrize("killed", [0, 1], ids=["master", "slave"])
def test_who_is_killed_is_lost(start: Start, killed: int) -> None:
    sites = both(start)
    sites[killed].process.kill()
    other = sites[1 - killed]
    assert other.ended() == 5
    name = ("master", "slave")[killed]
    assert f"{name} is lost since" in other.said()
    assert "not back within 6 s" in other.said()
    assert "Traceback" not in other.said()


@pytest.mark.parametrize("seconds", [0.05, 0.5])
def test_who_is_stopped_for_a_while_goes_on(start: Start, seconds: float) -> None:
    master, slave = both(start, "sites.greatest_backlog=10")
    master.process.send_signal(signal.SIGSTOP)
    time.sleep(seconds)
    master.process.send_signal(signal.SIGCONT)
    assert (master.ended(), slave.ended()) == (0, 0)
    assert len(slave.link()["sessions"]) == 1
    if seconds > 0.3:
        assert slave.link()["sessions"][0]["silences"]


@pytest.mark.parametrize("backlog", [0.01, 10.0])
def test_who_was_stopped_for_seconds_goes_on_or_begins_anew(start: Start, backlog: float) -> None:
    master, slave = both(start, f"sites.greatest_backlog={backlog}")
    master.process.send_signal(signal.SIGSTOP)
    time.sleep(3.0)
    master.process.send_signal(signal.SIGCONT)
    assert (master.ended(), slave.ended()) == (0, 0)
    for site in (master, slave):
        sessions = site.link()["sessions"]
        assert all("engaged_s" in one for one in sessions)
        assert sessions[0]["silences"]
        assert len(sessions) > 1 or backlog > 1.0
        assert "Traceback" not in site.said()
    assert "this program stood still for" in master.link()["sessions"][0]["silences"][0]["why"]


def test_who_stood_still_for_longer_than_its_claim_allows_stops_and_says_so(start: Start) -> None:
    master, slave = both(start, "loop.overrun_limit=150")
    master.process.send_signal(signal.SIGSTOP)
    time.sleep(1.0)
    master.process.send_signal(signal.SIGCONT)
    assert (master.ended(), slave.ended()) == (6, 5)
    assert "slots of 1 ms were missed in a row" in master.said()
    assert "master is lost since" in slave.said()
    assert "it stopped: " in slave.said()


def test_who_is_stopped_for_longer_than_the_other_waits_is_lost(start: Start) -> None:
    master, slave = both(start)
    master.process.send_signal(signal.SIGSTOP)
    time.sleep(10.0)
    master.process.send_signal(signal.SIGCONT)
    assert slave.ended() == 5
    assert "master is lost since" in slave.said()
    assert master.ended() in (0, 5)
    assert "Traceback" not in master.said()


@pytest.mark.parametrize("side", ["master", "slave"])
def test_who_is_started_anew_is_in_a_new_session(start: Start, side: str) -> None:
    sites = dict(zip(("master", "slave"), both(start, "duration_s=40", "link.lost_s=30"),
                     strict=True))  # fmt: skip
    other = sites["slave" if side == "master" else "master"]
    sites[side].process.kill()
    sites[side].process.wait()
    again = start(side, "duration_s=5", name="again")
    assert again.ended() == 0
    assert other.ended() == 0
    first, second = other.link()["sessions"]
    assert first["id"] != second["id"]
    assert second["engaged_s"] > first["engaged_s"]
    assert [one["id"] for one in again.link()["sessions"]] == [second["id"]]


def test_a_third_with_the_masters_certificate_is_refused(start: Start) -> None:
    master, slave = both(start)
    third = start("master", "sites.wait_s=2", name="third")
    assert third.ended() == 5
    assert "master is already in a session here" in third.said()
    assert (master.ended(), slave.ended()) == (0, 0)
    assert len(slave.link()["sessions"]) == 1


def test_another_rig_is_refused_on_both_sides_before_anything_moves(start: Start) -> None:
    slave = start("slave", "sites.wait_s=20")
    slave.until("waits for master")
    master = start("master", "coupling.pairs.lever.wave_impedance=0.06")
    assert master.ended() == 5
    assert "the rigs differ: coupling.pairs.lever.wave_impedance: 0.06 here, 0.05 there" in (
        master.said()
    )
    slave.until("wave_impedance: 0.05 here, 0.06 there")
    assert not master.out.exists()
    slave.process.send_signal(signal.SIGINT)
    assert slave.ended() in (1, 130)
    assert "Traceback" not in slave.said() + master.said()
