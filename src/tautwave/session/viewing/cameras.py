"""The cameras of a run: a process for each, ready before anything moves."""

from __future__ import annotations

import os
import select
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tautwave.config import Rig
from tautwave.config.guard import parse_json
from tautwave.errors import ConfigError

READY_S, END_S = 30.0, 5.0
PROGRAM = "tautwave.view.camera"


@contextmanager
def cameras_of(rig: Rig, clock: str, directory: Path) -> Iterator[dict[str, dict[str, Any]]]:
    """Run the rig's cameras beside the block; what each has written is known after it.

    On a fake clock there are none: its seconds are not those of the world.

    Raises
    ------
    ConfigError
        A camera cannot be used.
    """
    written: dict[str, dict[str, Any]] = {}
    children: dict[str, subprocess.Popen[bytes]] = {}
    where = os.pathsep.join(entry for entry in sys.path if entry)
    environment = {**os.environ, "PYTHONPATH": where, "PYTHONSAFEPATH": "1"}
    try:
        for name, camera in (rig.cameras or {}).items() if clock == "real" else ():
            children[name] = subprocess.Popen(
                [sys.executable, "-m", PROGRAM, str(directory.resolve()), name,
                 camera.model_dump_json()],
                stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                env=environment, start_new_session=True,
            )  # fmt: skip
        for name, child in children.items():
            line = _line(child, READY_S)
            if "ready" not in line:
                ended = child.poll() is not None
                why = "its process ended" if ended else f"not ready after {READY_S:g} s"
                raise ConfigError(f"cameras.{name}: {line.get('error', why)}")
        yield written
        for name, child in children.items():
            written[name] = _line(child, END_S) or {"error": "its process ended before the run"}
    finally:
        for child in children.values():
            if child.poll() is None:
                try:
                    child.wait(1.0)
                except subprocess.TimeoutExpired:
                    child.kill()
            child.wait()
            if child.stdout is not None:
                child.stdout.close()


def _line(child: subprocess.Popen[bytes], seconds: float) -> dict[str, Any]:
    """Return what a camera's process says next, {} if nothing."""
    assert child.stdout is not None
    if not select.select([child.stdout], [], [], seconds)[0]:
        return {}
    line = child.stdout.readline()
    return dict(parse_json(line.decode())) if line.endswith(b"\n") else {}
