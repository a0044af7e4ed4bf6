"""Simulated drives in processes of their own, and the tools that must be there to ask them."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import select
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from typing import Any

import pytest

from tautwave.contracts import AxisSpec, BusSpec
from tautwave_sim.modbus import simulator
from tautwave_sim.modbus.wire.serving import serve_bus
from tests.sim.truths import PERIOD, truth


@contextlib.contextmanager
def served(*words: str) -> Iterator[dict[str, Any]]:
    """Run `tautwave sim modbus` inside the block; give what it announces."""
    start = "from tautwave.cli import main; main()"
    command = [sys.executable, "-c", start, "sim", "modbus", *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as child:
        try:
            assert child.stdout is not None
            ready, _, _ = select.select([child.stdout], [], [], 90.0)
            line = child.stdout.readline() if ready else b""
            if not line:
                child.kill()
                pytest.fail(child.communicate()[1].decode())
            yield json.loads(line)
        finally:
            child.terminate()
            _, errors = child.communicate(timeout=60)
        assert (child.returncode, errors) == (0, b"")


@contextlib.contextmanager
def beside(*devices: dict[str, Any], **simulated: Any) -> Iterator[int]:
    """Serve drives on TCP in a thread of this process inside the block; give the port."""
    block = {"link": "tcp", "endpoint": "sim", "devices": devices, "simulator": simulated}
    units = [one["unit"] for one in devices]
    axes = tuple(AxisSpec(f"slave.{unit}", unit, "rotary", "impedance", 10.0) for unit in units)
    announced: queue.Queue[Any] = queue.Queue()
    ends = threading.Event()
    thread = threading.Thread(
        target=serve_bus,
        args=(
            simulator.options.model_validate_json(json.dumps(block)),
            BusSpec("modbus", axes, 1.0 / PERIOD),
            [truth() for _ in units],
            announced.put,
            ends.is_set,
        ),
    )
    thread.start()
    try:
        yield int(announced.get(timeout=60.0)["endpoint"].rpartition(":")[2])
    finally:
        ends.set()
        thread.join(60.0)


def mbpoll(*words: str) -> tuple[int, str]:
    """Run mbpoll once; return its exit code and what it said.

    Where it is not installed, the test is skipped; with CI=true that is a failure.
    """
    path = shutil.which("mbpoll")
    if path is None:
        reason = "mbpoll is not installed: apt-get install mbpoll"
        if os.environ.get("CI") == "true":
            pytest.fail(reason)
        pytest.skip(reason)
    done = subprocess.run(
        [path, "-q", "-0", "-1", "-o", "10", *words],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    return done.returncode, done.stdout + done.stderr
