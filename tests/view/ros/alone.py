"""An exporter and readers on a machine with two interfaces; prints what was seen.

`unshare --net python -m tests.view.ros.alone DIR PEER`: DIR gets a run that is only its rows;
PEER is `peer.cpp`, compiled. A veth pair stands for the network that nothing may reach unless it
is named.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

from tautwave import read_recording
from tautwave.view.ros.messages import DiagnosticArray, JointState
from tautwave.view.ros.node import Node, taken
from tests.view.alone import raise_loopback
from tests.view.served import Run

DOMAIN, PEER_S = 7, 4
LEAVES = ("position", "velocity", "commanded", "valid")
LEVERS = [f"{side}.lever.{leaf}" for side in ("master", "slave") for leaf in LEAVES]
COLUMNS = ["time_s", "lateness_us", "skipped_slots", "lever.position_error", *LEVERS]
EXPORT = [sys.executable, "-c", "from tautwave.cli import main; main(prog_name='tautwave')", "ros"]
AWAY = "tw0"


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


class Moving(threading.Thread):
    """Rows at 500 Hz until it is told to end."""

    def __init__(self, run: Run) -> None:
        super().__init__()
        self.run_ = run
        self.ends = threading.Event()

    def run(self) -> None:
        row = self.run_.recorder.row
        for k in range(4, len(COLUMNS)):
            row[k] = 1.0
        begin = time.monotonic()
        while not self.ends.is_set():
            row[COLUMNS.index("master.lever.position")] = self.run_.rows
            row[0] = 0.002 * self.run_.rows
            self.run_.recorder.commit()
            self.run_.rows += 1
            time.sleep(max(0.0, begin + 0.002 * self.run_.rows - time.monotonic()))


def main(directory: Path, peer: str) -> None:
    """Do all of it, and print it as JSON."""
    add_network()
    run = Run(directory, columns=COLUMNS)
    moving = Moving(run)
    moving.start()
    exporter = subprocess.Popen(
        [*EXPORT, str(directory), "--domain", str(DOMAIN), "--allow-commands"],
        stdout=subprocess.DEVNULL,
    )
    node = Node("reader", domain=DOMAIN)
    states = node.subscription("/master/joint_states", JointState)
    told = node.subscription("/diagnostics", DiagnosticArray)
    end = time.monotonic() + 60.0
    while not taken(states) and time.monotonic() < end:
        time.sleep(0.02)
    time.sleep(0.5)
    found: dict[str, Any] = {"away": sent_away()}
    heard = directory / "heard"
    with heard.open("w") as file:  # a pipe would fill
        foreign = subprocess.Popen([peer, str(DOMAIN), str(PEER_S)], stdout=file)
    seen: list[bytes] = []
    messages: dict[str, str] = {}
    while foreign.poll() is None and time.monotonic() < end:
        seen += [one.serialize(use_version_2=False) for one in taken(states)]
        messages |= {status.name: status.message for one in taken(told) for status in one.status}
        time.sleep(0.02)
    found |= {
        "peer_away": sent_away(),
        "lines": heard.read_text().splitlines(),
        "seen": [one.hex() for one in seen],
        "messages": messages,
    }
    exporter.kill()
    exporter.wait()
    killed = run.rows
    time.sleep(0.2)
    moving.ends.set()
    moving.join()
    orders = run.mailbox.source._source.take(0)
    found["orders"] = [[one.word, one.source] for one in orders]
    run.close()
    rows = read_recording(directory, ["time_s"])
    found |= {"killed": killed, "rows": run.rows, "recorded": len(rows.data)}
    print(json.dumps(found))
    sys.stdout.flush()
    os._exit(0)  # nothing waits for DDS


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2])
