"""Simulated devices in processes of their own: they come up, answer, and end with their run."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tautwave.config import Rig, load_rig
from tautwave.errors import ConfigError, DriverError
from tautwave.session import serving
from tautwave.session.serving import Bench, bus_bench, serve, served
from tests.commands import child_of

CONFIGS = Path(__file__).parents[2] / "configs"


@pytest.fixture
def rig() -> Rig:
    return load_rig(CONFIGS / "bench-dynamixel-sim.yaml")


def gone(pid: int) -> bool:
    """Whether the process ends within some seconds."""
    for _ in range(1000):
        try:
            os.kill(pid, 0)
            state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
        except (ProcessLookupError, FileNotFoundError):
            return True
        if state == "Z":
            return True
        time.sleep(0.05)
    return False


@pytest.mark.slow
def test_a_pseudo_terminal_is_there_inside_the_block_only(rig: Rig) -> None:
    with served(rig, ("servos",)) as found:
        port = found["servos"]["options"]["port"]
        assert found["servos"]["endpoint"] == port
        held = os.open(port, os.O_RDWR | os.O_NOCTTY)  # else its number may be another's at once
    try:
        assert not Path(port).exists()
    finally:
        os.close(held)


@pytest.mark.slow
def test_a_bus_that_does_not_come_up_is_named(rig: Rig) -> None:
    can = load_rig(CONFIGS / "bench-canopen-vcan.yaml", ["buses.can.options.channel=no-such-can"])
    reported = "bus can: its simulated devices did not start"
    with pytest.raises(DriverError, match=reported), served(can, ("can",)):
        pass


KILLED_AT_ONCE = """
import os, subprocess, sys
from tautwave.config import load_rig
from tautwave.session import serving
class Start(subprocess.Popen):
    def __init__(self, *words, **keys):
        super().__init__(*words, **{**keys, "stdout": None, "stderr": None})
        self.stdin.write(text)
        self.stdin.close()
        print(self.pid, flush=True)
        os.kill(os.getpid(), 9)
serving.subprocess.Popen = Start
rig = load_rig(sys.argv[1])
text = serving.resolved_yaml(rig).encode()
with serving.served(rig, ["servos"]): pass
"""


@pytest.mark.slow
def test_devices_of_a_run_that_is_killed_before_they_are_up_end_too() -> None:
    """They ask for a signal of its death when they have begun; it may be dead by then."""
    rig = str(CONFIGS / "bench-dynamixel-sim.yaml")
    with subprocess.Popen(
        [sys.executable, "-c", KILLED_AT_ONCE, rig], stdout=subprocess.PIPE, text=True
    ) as run:
        assert run.stdout is not None
        pid = int(run.stdout.readline())
        assert run.wait() == -signal.SIGKILL
        try:
            assert gone(pid)
        finally:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)


@pytest.mark.slow
def test_devices_end_with_a_run_that_is_killed(tmp_path: Path) -> None:
    words = ["run", str(CONFIGS / "bench-dynamixel-sim.yaml"), "--out", str(tmp_path / "out")]
    run = subprocess.Popen(
        [sys.executable, "-c", "from tautwave.cli import main; main()", *words],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        child = None
        for _ in range(1500):
            child = child_of(run.pid, "session.serving")
            if child is not None:
                break
            time.sleep(0.05)
        assert child is not None
        time.sleep(1.0)
    finally:
        run.send_signal(signal.SIGKILL)
        run.wait()
    assert gone(child)


def test_what_cannot_be_served_is_reported(rig: Rig) -> None:
    with pytest.raises(ConfigError, match="there is no bus 'none'; the rig has servos"):
        bus_bench(rig, "none")
    hardware = load_rig(CONFIGS / "xm430-pair.yaml")
    with pytest.raises(ConfigError, match="nothing to simulate"):
        bus_bench(hardware, next(iter(hardware.buses)))


@pytest.mark.slow
def test_sim_of_a_rig_prints_one_line_and_ends_on_a_signal() -> None:
    command = [sys.executable, "-c", "from tautwave.cli import main; main()", "sim"]
    process = subprocess.Popen(
        [*command, str(CONFIGS / "three-bus-sim.yaml")], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    lines = [json.loads(process.stdout.readline()) for _ in range(2)]
    assert {line["driver"] for line in lines} == {"dynamixel", "modbus"}
    process.send_signal(signal.SIGINT)
    rest, _ = process.communicate(timeout=60)
    assert rest == ""
    assert process.returncode == 0


def test_devices_run_below_the_loop_and_leave_memory_unlocked(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[tuple[Any, ...]] = []

    @contextmanager
    def realtime(priority: int, cpu: int | None, lock_memory: bool) -> Iterator[None]:
        asked.append((priority, cpu, lock_memory))
        yield

    simulator = SimpleNamespace(serve=lambda *_: None)
    monkeypatch.setattr(serving, "realtime", realtime)
    monkeypatch.setattr(serving, "load_simulator", lambda _: simulator)
    serve("any", Bench(None, None, []), print, 40)
    serve("any", Bench(None, None, []), print, 0)
    assert asked == [(39, None, False), (0, None, False)]
