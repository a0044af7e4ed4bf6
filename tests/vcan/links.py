"""What the tests of real CAN interfaces do to them, and undo: `netem` and `down`."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager

import pytest


def tool(name: str) -> str:
    """Path of a command, or skip the test."""
    return shutil.which(name) or pytest.skip(f"there is no {name}; install can-utils and iproute2")


def change(*command: str) -> None:
    """Run `ip` or `tc` on an interface; skip the test where that is not allowed."""
    done = subprocess.run([tool(command[0]), *command[1:]], capture_output=True, text=True)
    if "not permitted" in done.stderr:
        pytest.skip(f"not allowed: {' '.join(command)}; run it in .ci/vcan")
    assert done.returncode == 0, f"{' '.join(command)}: {done.stderr}"


@contextmanager
def netem(interface: str, *what: str) -> Iterator[None]:
    """Frames sent on `interface` suffer `what`, such as `"delay", "5ms"` or `"loss", "1%"`."""
    change("tc", "qdisc", "replace", "dev", interface, "root", "netem", *what)
    try:
        yield
    finally:
        change("tc", "qdisc", "del", "dev", interface, "root")


@contextmanager
def down(interface: str) -> Iterator[None]:
    """Within it, `interface` is down, for everybody."""
    change("ip", "link", "set", interface, "down")
    try:
        yield
    finally:
        change("ip", "link", "set", interface, "up")
