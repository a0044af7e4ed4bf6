"""A scheduler of Dask and its workers, as processes that a test may kill."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path


class Serving:
    """A scheduler and workers as processes of their own."""

    def __init__(self, folder: Path, workers: int = 2) -> None:
        self.file = folder / "scheduler.json"
        quiet = ["--no-dashboard", "--host", "127.0.0.1", "--scheduler-file", str(self.file)]
        self.scheduler = self._start("dask_scheduler", "--port", "0", "--no-show", *quiet)
        self.others = [
            self._start("dask_worker", "--scheduler-file", str(self.file), "--nthreads", "1",
                        "--no-dashboard", "--local-directory", str(folder), "--death-timeout", "60")
            for _ in range(workers)
        ]  # fmt: skip
        until = time.monotonic() + 60.0
        while not self._is_written() and time.monotonic() < until:
            time.sleep(0.05)

    def _is_written(self) -> bool:
        """Return whether the scheduler's file is there, and whole."""
        with suppress(FileNotFoundError, ValueError):
            return "address" in json.loads(self.file.read_text())
        return False

    def _start(self, tool: str, *words: str) -> subprocess.Popen[bytes]:
        root = str(Path(__file__).parents[2])
        path = os.pathsep.join([root, *filter(None, [os.environ.get("PYTHONPATH")])])
        return subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.{tool}", *words],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
            env=os.environ | {"PYTHONPATH": path},
        )  # fmt: skip

    def end(self) -> None:
        for process in (*self.others, self.scheduler):
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
