"""Two sites as two programs: started, looked at while they run, and ended."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from tautwave.errors import RecordingError
from tautwave.runtime.tap import Tap
from tautwave.view.watched import read_live

RIG = Path(__file__).parents[2] / "configs" / "network-loopback.yaml"
COMMAND = (sys.executable, "-c", "from tautwave.cli import main; main(prog_name='tautwave')")
PATIENCE_S = 250.0
"""A loaded machine is slow, and nothing here is about how slow."""


def set_words(*changes: str) -> list[str]:
    return [word for change in changes for word in ("--set", change)]


class Site:
    """A `tautwave run --site` and what it says; `before` stands before its command."""

    def __init__(
        self, folder: Path, side: str, name: str, *changes: str, before: Sequence[str] = ()
    ) -> None:
        self.out = folder / name
        self._log = (folder / f"{name}.log").open("w")
        words = ["run", "rig.yaml", "--site", side, "--out", str(self.out), *set_words(*changes)]
        self.process = subprocess.Popen(
            [*before, *COMMAND, *words],
            cwd=folder, stdout=self._log, stderr=subprocess.STDOUT,
        )  # fmt: skip
        self._tap: Tap | None = None
        self._columns: Sequence[str] = ()
        self._row: list[float] = []

    def said(self) -> str:
        return Path(self._log.name).read_text(encoding="utf-8")

    def until(self, what: str | Callable[[], bool]) -> None:
        """Wait until it has said a text, or until something is so while it runs."""
        wanted = (lambda: what in self.said()) if isinstance(what, str) else what
        for _ in range(round(PATIENCE_S / 0.05)):
            over = self.process.poll() is not None  # before the look: it may end in between
            if wanted():
                return
            assert not over, f"it has ended: {self.said()}"
            time.sleep(0.05)
        raise AssertionError(f"not within {PATIENCE_S} s: {what}: {self.said()}")

    def now(self, column: str) -> float:
        """Return what its newest row says, NaN while there is none."""
        with suppress(RecordingError):
            if self._tap is None:
                live = read_live(self.out)
                self._tap, self._columns = Tap.of_run(live), live.columns
            self._row = next(iter(self._tap.take()[-1:]), self._row)
        return self._row[self._columns.index(column)] if self._row else float("nan")

    def coupled(self) -> bool:
        """Return whether it is engaged and does not hold."""
        return self.now("link.slot") >= 0.0 and self.now("link.holding") == 0.0

    def stop_for(self, seconds: float) -> None:
        self.process.send_signal(signal.SIGSTOP)
        time.sleep(seconds)
        self.process.send_signal(signal.SIGCONT)

    def interrupt(self) -> None:
        self.process.send_signal(signal.SIGINT)

    def ended(self) -> int:
        return self.process.wait(PATIENCE_S)

    def summary(self) -> dict[str, Any]:
        found: dict[str, Any] = json.loads((self.out / "summary.json").read_text())
        return found

    def link(self) -> dict[str, Any]:
        return dict(self.summary()["link"])

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        if self._tap is not None:
            self._tap.close()
        self._log.close()
