"""Foreign drives on a real bus, in a process of their own.

`python -m tests.foreign.served_drives INTERFACE CHANNEL 1,2` prints a line of JSON whenever a drive
changes its state, and takes lines: `show`, `fault NODE CODE`, `reboot NODE`, `quit`.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import can

from tautwave.multicast import only_its_group
from tests.foreign.cia402 import ForeignDrive

ROOT = Path(__file__).parents[2]
LOOK_S = 0.0005
BOOT_S = 0.1


def _seen(drive: ForeignDrive) -> dict[str, Any]:
    """What an observer beside the drive sees."""
    return {
        "node": drive.number,
        "state": drive.state,
        "torque": drive.torque,
        "most": drive.most_torque,
        "mode": drive.value(0x6060),
        "limit": drive.value(0x6072),
        "watches": drive.value(0x1016, 1),
    }


def main() -> None:
    interface, channel, listed = sys.argv[1:]
    bus = can.Bus(interface=interface, channel=channel)
    only_its_group(bus)

    def send(can_id: int, data: bytes) -> None:
        try:
            bus.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))
        except can.CanError:
            return  # nobody there

    drives = {int(one): ForeignDrive(int(one), send) for one in listed.split(",")}
    os.set_blocking(0, False)
    begun, states, typed = time.monotonic(), {}, b""
    print(json.dumps({"serves": channel}), flush=True)
    while True:
        frame = bus.recv(LOOK_S)
        now = time.monotonic() - begun
        while frame is not None:
            if not (frame.is_extended_id or frame.is_error_frame):
                for drive in drives.values():
                    drive.take(frame.arbitration_id, bytes(frame.data), now)
            frame = bus.recv(0)
        for drive in drives.values():
            drive.run(now)
            if states.get(drive.number) != drive.state:
                states[drive.number] = drive.state
                print(json.dumps(_seen(drive)), flush=True)
        try:
            typed += os.read(0, 4096) or b"quit\n"
        except BlockingIOError:
            continue
        *lines, typed = typed.split(b"\n")
        for line in lines:
            word, *rest = line.decode().split()
            if word == "quit":
                bus.shutdown()
                return
            if word == "show":
                for drive in drives.values():
                    print(json.dumps(_seen(drive)), flush=True)
            elif word == "fault":
                drives[int(rest[0])].fail(int(rest[1], 0))
            elif word == "reboot":
                drives[int(rest[0])].reboot(now, BOOT_S)


class Watched:
    """The drives, seen from beside them."""

    def __init__(self, child: subprocess.Popen[str]) -> None:
        self._child = child
        self.seen: list[dict[str, Any]] = []
        self._news = threading.Condition()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self._child.stdout is not None
        for line in self._child.stdout:
            with self._news:
                self.seen.append(json.loads(line))
                self._news.notify_all()

    def says(self, line: str) -> None:
        assert self._child.stdin is not None
        self._child.stdin.write(line + "\n")
        self._child.stdin.flush()

    def until(self, good: Callable[[dict[str, Any]], bool], since: int = 0) -> dict[str, Any]:
        """The first thing seen that is good, within a minute."""
        with self._news:
            found = self._news.wait_for(lambda: [s for s in self.seen[since:] if good(s)], 60.0)
        assert found, self.seen
        first: dict[str, Any] = found[0]
        return first

    def now(self) -> dict[int, dict[str, Any]]:
        """Every drive as it is."""
        since = len(self.seen)
        self.says("show")
        return {number: self.until(lambda s, n=number: s.get("node") == n, since)
                for number in (1, 2)}  # fmt: skip

    def end(self) -> None:
        self._child.kill()
        self._child.wait()
        self._reader.join()


@contextmanager
def foreign_drives(interface: str, channel: str) -> Iterator[Watched]:
    """Two foreign drives in a process of their own."""
    command = [sys.executable, "-m", "tests.foreign.served_drives", interface, channel, "1,2"]
    child = subprocess.Popen(
        command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(one for one in sys.path if one)},
    )  # fmt: skip
    with child:
        watched = Watched(child)
        try:
            watched.until(lambda seen: "serves" in seen)
            yield watched
        finally:
            watched.end()


if __name__ == "__main__":
    main()
