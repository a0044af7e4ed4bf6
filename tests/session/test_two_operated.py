"""Two operated sites in two programs: people at both, a stop of one program, another start.

By default both in one process: `tests/session/test_operated_sites.py`.
"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from tautwave.bench.sites.order import free_port
from tautwave.runtime.operate.mailbox import send
from tautwave.runtime.operate.states import STATES
from tautwave.sites.certificates import make_authority
from tautwave.view.watched import read_live
from tests.commands import END_STOPS
from tests.session.programs import COMMAND, RIG, Site

pytestmark = [pytest.mark.slow, pytest.mark.nightly, pytest.mark.realtime, pytest.mark.timeout(400)]
PATIENT = ("rate_hz=200", "loop.overrun_limit=4000", *END_STOPS, "duration_s=1000",
           "link.lost_s=60", "sites.wait_s=100", "coupling.pairs.lever.wave_filter_hz=20",
           "link.silence_s=1",
           "simulation.environment.lever={type: free}", "operate={}")  # fmt: skip
"""A loaded machine oversleeps for longer than a rig should allow."""

Start = Callable[..., Site]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    make_authority(tmp_path / "keys", ["master", "slave"])
    text = RIG.read_text().replace("serves: slave", f"serves: slave\n  port: {free_port()}")
    (tmp_path / "rig.yaml").write_text(text)
    with ExitStack() as stack:

        def begin(side: str, name: str = "") -> Site:
            site = Site(tmp_path, side, name or side, *PATIENT)
            stack.callback(site.close)
            return site

        yield begin


def ask(site: Site, line: str) -> None:
    """Give a command as the page does."""
    address = read_live(site.out).facts["mailbox"]
    assert address is not None
    send(address, "page", line)


def reach(state: str, *sites: Site) -> None:
    """Wait until all the sites are in a state."""
    code = float(STATES.index(state))
    for site in sites:
        site.until(lambda site=site: site.now("operation.state") == code)  # type: ignore[misc]


def test_people_at_both_engage_and_let_go_and_one_of_them_starts_anew(
    start: Start, tmp_path: Path
) -> None:
    master, slave = start("master"), start("slave")
    reach("idle", master, slave)
    ask(master, "engage")
    reach("engaged", master, slave)
    ask(slave, "clutch")
    reach("clutched", master, slave)
    ask(slave, "engage")
    reach("engaged", master, slave)
    slave.process.kill()
    slave.process.wait()
    reach("holding", master)
    again = start("slave", name="again")
    reach("holding", again)  # it hears what both are to do
    ask(again, "engage")
    reach("engaged", master, again)
    slot = master.now("link.slot")
    master.until(lambda: master.now("link.slot") > slot + 100)
    ask(master, "hold")
    reach("holding", master, again)
    ask(again, "stop")
    assert (master.ended(), again.ended()) == (0, 0)
    journal = master.summary()["operation"]["journal"]
    assert [(one["word"], one["source"]) for one in journal] == [
        ("engage", "page"), ("aligned", "controller"), ("clutch", "slave page"),
        ("engage", "slave page"), ("aligned", "controller"), ("lost", "controller"),
        ("engage", "slave page"), ("aligned", "controller"), ("hold", "page"),
        ("stop", "slave page"),
    ]  # fmt: skip
    ids = [one["id"] for one in master.link()["sessions"] if "engaged_s" in one]
    assert len(set(ids)) == 3
    assert "Traceback" not in master.said() + again.said()
    words = [*COMMAND, "report", str(master.out), str(again.out), "--out", str(tmp_path / "both")]
    subprocess.run(words, check=True)
    found = json.loads((tmp_path / "both" / "compare.json").read_text())
    pair = found["pairs"]["lever"]
    assert found["sessions"] == ids[2:]
    assert pair["residual"] < 1e-9
    assert pair["under_way_at_end"] >= -2e-6
