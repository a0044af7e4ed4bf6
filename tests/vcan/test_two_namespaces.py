"""Two sites in two network namespaces, and a bad network between them: the kernel's `netem`."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from tautwave.report.joined import common_sessions
from tautwave.report.run.loading import load_run
from tautwave.sites.certificates import make_authority
from tests.commands import END_STOPS
from tests.session.programs import RIG, Site
from tests.vcan.links import change, tool

pytestmark = [pytest.mark.vcan, pytest.mark.timeout(400)]
SIDES = ("slave", "master")
AWAY = "lever.network.stored"
HERE, THERE = "10.77.0.1", "10.77.0.2"
NETWORKS = (
    "loss 1% delay 5ms 2ms",
    "loss 10% 25% delay 30ms 10ms reorder 20% 50% duplicate 2%",
    "loss 100%",  # an outage of 10 s
    "loss 30% delay 100ms 20ms",
    "delay 10ms rate 400kbit",
    "delay 10ms",  # over which a site that ends can say so
)
SECONDS = (3, 3, 10, 5, 4, 3)

HEAVY = "{value: 16e-3, lower: 11e-3, source: made up}"
DAMPED = "{value: 20e-3, lower: 10e-3, source: made up}"
CHANGES = (
    "rate_hz=250", "duration_s=600", "link.lost_s=100", "link.depth_s=auto",
    "loop.overrun_limit=500", *END_STOPS,
    "coupling.pairs.lever.wave_filter_hz=30", "simulation.environment.lever.stiffness=25",
    *(f"{side}.axes.lever.inertia={HEAVY}" for side in ("master", "slave")),
    *(f"{side}.axes.lever.damping={DAMPED}" for side in ("master", "slave")),
    *(f"simulation.axes.{side}.lever.inertia=16e-3" for side in ("master", "slave")),
    *(f"simulation.axes.{side}.lever.damping=20e-3" for side in ("master", "slave")),
)  # fmt: skip
"""A rate that the guest kernel of `.ci/vcan` keeps, and devices for it."""


@contextmanager
def namespace() -> Iterator[list[str]]:
    """Return what to write before a command that shall run in another namespace, joined by veth."""
    with subprocess.Popen([tool("unshare"), "--net", "sleep", "infinity"]) as process:
        try:
            inside = [tool("nsenter"), "-t", str(process.pid), "-n"]
            while subprocess.run(
                [*inside, "ip", "link", "show", "lo"], capture_output=True
            ).returncode:
                time.sleep(0.05)
            change("ip", "link", "add", "tw0", "type", "veth", "peer", "name", "tw1")
            change("ip", "link", "set", "tw1", "netns", str(process.pid))
            change("ip", "addr", "add", f"{HERE}/24", "dev", "tw0")
            change("ip", "link", "set", "tw0", "up")
            for words in (f"addr add {THERE}/24 dev tw1", "link set tw1 up", "link set lo up"):
                subprocess.run([*inside, "ip", *words.split()], check=True)
            yield inside
        finally:
            process.kill()


def impair(inside: list[str], what: str) -> None:
    """Let both directions suffer `what`."""
    words = f"tc qdisc replace dev tw0 root netem {what}".split()
    subprocess.run(words, check=True)
    subprocess.run([*inside, *words[:4], "tw1", *words[5:]], check=True)


def test_two_sites_stay_passive_and_meet_again_over_any_network(tmp_path: Path) -> None:
    make_authority(tmp_path / "keys", ["master", "slave"])
    text = RIG.read_text().replace("address: 127.0.0.1, bind: 127.0.0.1", f"address: {THERE}")
    (tmp_path / "rig.yaml").write_text(text)
    with ExitStack() as stack:
        inside = stack.enter_context(namespace())
        sites = []
        for side, before in zip(SIDES, (inside, []), strict=True):
            sites.append(Site(tmp_path, side, side, *CHANGES, before=before))
            stack.callback(sites[-1].close)
        for site in sites:
            site.until(site.coupled)
        for what, seconds in zip(NETWORKS, SECONDS, strict=True):
            impair(inside, what)
            time.sleep(seconds)
        for site in sites:  # a session that has begun has to engage before it is ended
            site.until(site.coupled)
        sites[1].interrupt()
        for site in sites:  # their figures are not waited for
            site.until((site.out / "summary.json").exists)
    found = [load_run(tmp_path / side) for side in SIDES]
    for one in found:
        assert one.result.outcome.kind in ("finished", "interrupted"), one.result.outcome
        assert one.result.recording.rows_dropped == 0
        assert one.rows == one.result.cycles
        assert one.result.link is not None
        sessions = one.result.link.sessions
        assert sessions[0].engaged_s is not None
        assert sessions[-1].engaged_s is not None
        assert any(session.silences for session in sessions)
    for common in common_sessions(found[1], found[0]):
        # What left less what came, of both ways: not below the reserves, whatever the clocks.
        halves = (one.read(AWAY)[AWAY] for one in reversed(found))
        last = sum(half[rows][-1] for half, rows in zip(halves, common.all_rows, strict=True))
        assert last >= -2e-6
    for one, side in zip(found, SIDES, strict=True):
        stored = one.read(f"lever.receiver_{side}.stored")[f"lever.receiver_{side}.stored"]
        assert stored.min() >= -1e-6
