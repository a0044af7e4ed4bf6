"""Simulated drives in processes of their own, and the tools that must be there to ask them."""

from __future__ import annotations

import contextlib
import json
import os
import select
import shutil
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import pytest


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
