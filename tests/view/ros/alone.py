"""A run, its exporter and readers on a machine with two interfaces; prints what was seen.

`unshare --net python -m tests.view.ros.alone DIR PEER`: DIR gets the run; PEER is `peer.cpp`,
compiled. A veth pair stands for the network that nothing may reach unless it is named.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tautwave import read_recording
from tautwave.view.ros.messages import DiagnosticArray, JointState
from tautwave.view.ros.node import Node, taken
from tautwave.view.watched import Watched
from tests.view.alone import raise_loopback
from tests.view.served import BENCH

DOMAIN = 7
CALM = ("operate={}", "loop.overrun_limit=5000", "loop.missing_limit=5000")
TAUTWAVE = [sys.executable, "-c", "from tautwave.cli import main; main(prog_name='tautwave')"]
AWAY, PEER_S = "tw0", 6


def add_network() -> None:
    """Give the namespace an interface that leads elsewhere, quiet by itself."""
    raise_loopback()
    Path("/proc/sys/net/ipv6/conf/default/disable_ipv6").write_text("1")
    for words in (f"add {AWAY} type veth peer name tw1", f"set {AWAY} up", "set tw1 up"):
        subprocess.run(["ip", "link", *words.split()], check=True)
    subprocess.run(["ip", "address", "add", "10.99.0.1/24", "dev", AWAY], check=True)


def sent_away() -> int:
    """Return the packets that have left."""
    lines = Path("/proc/self/net/dev").read_text().splitlines()
    return next(int(line.split()[10]) for line in lines if line.split()[0] == f"{AWAY}:")


def until(true: Callable[[], bool], seconds: float = 60.0) -> bool:
    """Wait until something is true; return whether it is."""
    end = time.monotonic() + seconds
    while not true() and time.monotonic() < end:
        time.sleep(0.02)
    return true()


def export(run: Path, *words: str) -> subprocess.Popen[str]:
    """Begin an exporter; return it once it publishes."""
    child = subprocess.Popen(
        [*TAUTWAVE, "ros", str(run), "--domain", str(DOMAIN), *words],
        stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert child.stdout is not None
    assert child.stdout.readline().startswith("domain")
    return child


def main(directory: Path, peer: str) -> None:
    """Do all of it, and print it as JSON."""
    add_network()
    out = directory / "run"
    sets = [word for override in CALM for word in ("--set", override)]
    run = subprocess.Popen(
        [*TAUTWAVE, "run", str(BENCH), *sets, "--duration", "60", "--out", str(out), "--quiet"],
        stdout=subprocess.DEVNULL,
    )
    assert until((out / "live.json").exists)
    watched = Watched.of_run(out)
    node = Node("reader", domain=DOMAIN)
    states = node.subscription("/master/joint_states", JointState)
    told = node.subscription("/diagnostics", DiagnosticArray)
    exporter = export(out, "--allow-commands")
    heard = directory / "heard"
    with heard.open("w") as file:
        foreign = subprocess.Popen([peer, str(DOMAIN), str(PEER_S)], stdout=file)
    seen: list[bytes] = []
    levels: dict[str, int] = {}
    began = time.monotonic()
    while foreign.poll() is None and time.monotonic() < began + 60.0:
        seen += [one.serialize(use_version_2=False) for one in taken(states)]
        levels |= {status.name: status.level for one in taken(told) for status in one.status}
        time.sleep(0.02)
    found: dict[str, Any] = {
        "lines": heard.read_text().splitlines(),
        "seen": [one.hex() for one in seen],
        "levels": levels,
        "away": sent_away(),
    }
    until(lambda: "released" in watched.tap.news(), 5.0)
    found["journal"] = [entry for _, entry in json.loads(watched.tap.news())]
    exporter.kill()
    exporter.wait()
    killed_at = watched.tap.take()[-1][0]
    second = export(out, "--interface", AWAY)
    found["named"] = until(lambda: sent_away() > found["away"], 10.0)
    second.kill()
    second.wait()
    until(lambda: (watched.tap.take() or [[0.0]])[-1][0] > killed_at + 0.5)
    watched.command("test", "stop")
    run.wait(60)
    summary = json.loads((out / "summary.json").read_text())
    rows = read_recording(out, ["time_s"])
    found |= {
        "recording": summary["recording"],
        "cycles": summary["cycles"],
        "rows": len(rows.data),
        "after": float(rows.time_s[-1]) - killed_at,
    }
    print(json.dumps(found))
    sys.stdout.flush()
    os._exit(0)  # nothing waits for DDS


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2])
