"""What a rig goes through with foreign drives in another process, on any bus."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

from tests.foreign.served_drives import Watched, foreign_drives

MAIN = "from tautwave.cli import main; main(prog_name='tautwave')"
WATCH_MS = 2000
MASTER = 127

RIG = """name: foreign
rate_hz: 50
duration_s: {seconds}
require: passive
loop: {{fifo_priority: 0, missing_limit: 40, overrun_limit: 1000}}
buses:
  can:
    driver: canopen
    options:
      interface: {interface}
      channel: {channel}
      heartbeat_ms: 100
      heartbeat_timeout_ms: {watch}
      sdo_timeout_s: 2.0
      answer_share: 0.7
      nodes:
        - {{id: 1, rated_torque: 0.5, counts_per_revolution: 4096, identity: {{vendor: 0x999, product: 0x402}}}}
        - {{id: 2, rated_torque: 0.5, counts_per_revolution: 4096, identity: {{vendor: 0x999, product: 0x402}}}}
{sides}
coupling:
  law: wave
  pairs:
    lever: {{wave_impedance: 0.0015, offset: at_engage}}
"""  # noqa: E501
SIDE = """{side}:
  axes:
    lever: {{bus: can, id: {number}, kind: rotary, causality: impedance, inertia: {{value: 1.5e-3, lower: 1.0e-3, source: identified}}, damping: {{value: 3.0e-3, lower: 2.0e-3, source: identified}}, effort_limit: 0.4, effort_rate_limit: 50, velocity_limit: 15, position_range: [-3, 3], mechanical_range: [-3.1, 3.1]}}
"""  # noqa: E501


def written(folder: Path, interface: str, channel: str, seconds: float) -> Path:
    path = folder / "rig.yaml"
    sides = "".join(SIDE.format(side=s, number=n) for n, s in ((1, "master"), (2, "slave")))
    path.write_text(
        RIG.format(
            interface=interface, channel=channel, seconds=seconds, watch=WATCH_MS, sides=sides
        )
    )
    return path


def started(rig: Path, out: str) -> subprocess.Popen[str]:
    words = ["run", str(rig), "--quiet", "--out", str(rig.parent / out)]
    paths = os.pathsep.join(entry for entry in sys.path if entry)
    return subprocess.Popen(
        [sys.executable, "-c", MAIN, *words], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        text=True, env={**os.environ, "PYTHONPATH": paths},
    )  # fmt: skip


def ended(child: subprocess.Popen[str]) -> tuple[int, str]:
    said, _ = child.communicate(timeout=120)
    return child.returncode, said


def enabled(number: int) -> Any:
    return lambda seen: seen.get("node") == number and seen["state"] == "enabled"


def all_off(drives: Watched) -> None:
    """As they were found: no torque, no watchdog, their own limit."""
    for seen in drives.now().values():
        assert (seen["state"], seen["torque"]) == ("disabled", 0.0)
        assert (seen["limit"], seen["watches"]) == (3000, 0)


def up_fault_reset_and_down(folder: Path, interface: str, channel: str) -> None:
    """A run ends well; the next ends by a drive's fault; the one after resets that fault."""
    with foreign_drives(interface, channel) as drives:
        rig = written(folder, interface, channel, 1.0)
        code, said = ended(started(rig, "first"))
        assert code in (0, 3), said
        ran = drives.until(enabled(1))
        assert (ran["mode"], ran["limit"]) == (10, 800)
        assert ran["watches"] == MASTER << 16 | WATCH_MS  # armed before it has torque
        all_off(drives)

        since = len(drives.seen)
        rig = written(folder, interface, channel, 60.0)
        child = started(rig, "second")
        drives.until(enabled(2), since)
        drives.says("fault 2 0x2310")
        code, said = ended(child)
        assert code == 5, said
        assert "slave.lever (node 2): EMCY 0x2310: continuous overcurrent" in said
        found = drives.now()
        assert found[1]["state"] == "disabled"
        assert found[2]["state"] == "fault"
        assert not any(seen["torque"] for seen in found.values())

        since = len(drives.seen)
        rig = written(folder, interface, channel, 1.0)
        code, said = ended(started(rig, "third"))
        assert code in (0, 3), said
        drives.until(enabled(2), since)  # its fault was reset
        all_off(drives)


def reboot_and_kill(folder: Path, interface: str, channel: str) -> None:
    """A drive that restarts ends the run; a run that is killed leaves no torque."""
    with foreign_drives(interface, channel) as drives:
        rig = written(folder, interface, channel, 60.0)
        child = started(rig, "first")
        drives.until(enabled(2))
        drives.says("reboot 2")
        code, said = ended(child)
        assert code == 5, said
        assert "slave.lever" in said
        assert "restarted during the run" in said
        assert not any(seen["torque"] for seen in drives.now().values())

        since = len(drives.seen)
        child = started(rig, "second")
        for number in (1, 2):
            drives.until(enabled(number), since)
        since = len(drives.seen)
        child.send_signal(signal.SIGKILL)
        child.communicate()
        for number in (1, 2):  # nobody tells them: their own watchdog does
            off = drives.until(
                lambda seen, n=number: seen.get("node") == n and seen["state"] == "disabled", since
            )
            assert off["watches"] == MASTER << 16 | WATCH_MS
        assert not any(seen["torque"] for seen in drives.now().values())

        rig = written(folder, interface, channel, 1.0)
        code, said = ended(started(rig, "third"))
        assert code in (0, 3), said
        for seen in drives.now().values():  # the killed run's limit is not known to be another's
            assert (seen["state"], seen["torque"], seen["watches"]) == ("disabled", 0.0, 0)
