"""A newcomer with served devices: commands of tautwave, hands that move, lines that are typed."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import chdir, contextmanager, suppress
from pathlib import Path
from typing import Any

from click.testing import CliRunner

from tautwave.cli import main
from tautwave.errors import TautwaveError
from tautwave.runtime.operate.states import STATES
from tautwave.runtime.tap import Tap
from tautwave.view.watched import read_live

TAUTWAVE = (sys.executable, "-c", "from tautwave.cli import main; main()")
PATIENCE_S = 60.0
SILENCE_S = 120.0
END_S = 600.0
"""`calibrate` of six joints on each side moves one after another to identify it."""
HEARTBEATS = ("      bitrate: ", "      heartbeat_timeout_ms: 2000\n      bitrate: ")
"""Of drives that a busy machine serves: they are silent for longer than any drive is."""


class Newcomer:
    """Someone in a folder of their own, who counts commands."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.commands: list[str] = []

    def does(self, *words: str) -> str:
        """Run a command to its end; return what it printed. Here: a process takes its time."""
        self.commands.append(words[0])
        with chdir(self.folder):
            done = CliRunner().invoke(main, words)
        assert done.exit_code == 0, f"{words}: {done.output[-2000:]}"
        return done.stdout

    @contextmanager
    def talks(self, *words: str) -> Iterator[Talk]:
        """Run a command that is talked to inside the block; it has to end well."""
        self.commands.append(words[0])
        talk = Talk((*TAUTWAVE, *words), self.folder)
        try:
            yield talk
            talk.end()
        finally:
            talk.kill()


class Talk:
    """A program that is talked to by lines."""

    def __init__(self, words: Sequence[str], folder: Path) -> None:
        self.child = subprocess.Popen(
            words, cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, text=True, bufsize=1,
        )  # fmt: skip
        self.heard: list[str] = []

    def types(self, line: str = "") -> None:
        assert self.child.stdin is not None
        self.child.stdin.write(f"{line}\n")
        self.child.stdin.flush()

    def hears(self, words: str) -> str:
        """Read lines until one has these words; after `SILENCE_S` the program is ended."""
        assert self.child.stdout is not None
        patience = threading.Timer(SILENCE_S, self.child.kill)
        patience.start()
        try:
            for line in self.child.stdout:
                self.heard.append(line)
                if words in line:
                    return line
        finally:
            patience.cancel()
        raise AssertionError(f"never said {words!r}: {''.join(self.heard)}")

    def end(self) -> None:
        out, _ = self.child.communicate(timeout=END_S)
        self.heard.append(out)
        assert self.child.returncode == 0, "".join(self.heard)

    def kill(self) -> None:
        if self.child.poll() is None:
            self.child.kill()
        with self.child:  # closes its pipes
            pass


@contextmanager
def served(folder: Path, *words: str) -> Iterator[tuple[Talk, dict[str, Any]]]:
    """Serve devices with typed hands; yield them and what they announced."""
    sim = Talk((*TAUTWAVE, "sim", *words, "--hand"), folder)
    try:
        yield sim, json.loads(sim.hears("endpoint"))
    finally:
        sim.child.terminate()
        with sim.child:
            pass


def shows(talk: Talk, hands: Talk, sides: Sequence[Sequence[int]], move_s: float) -> None:
    """Show poses, directions and ranges, one side after the other."""
    for ids in sides:
        everyone = ",".join(str(one) for one in ids)
        talk.hears("the zero pose")
        talk.types()
        for one in ids:
            talk.hears("positive direction")
            hands.types(f"{one} 0.5 {move_s}")
            time.sleep(2.0 * move_s)
            talk.types()
            hands.types(f"{one} 0 {move_s}")
        talk.hears("to both ends")
        for end in (1.2, -1.2, 0.0):
            hands.types(f"{everyone} {end} {2.0 * move_s}")
            time.sleep(3.0 * move_s)
        talk.types()


def wait_for(directory: Path, state: str) -> bool:
    """Wait until a run is in a state."""
    code, until = STATES.index(state), time.monotonic() + PATIENCE_S
    with suppress(TautwaveError):  # it has ended
        while time.monotonic() < until:
            if (directory / "live.json").exists():
                live = read_live(directory)
                tap, at = Tap.of_run(live), live.columns.index("operation.state")
                while time.monotonic() < until and not tap.closed:
                    if any(row[at] == code for row in tap.take()):
                        return True
                    time.sleep(0.01)
            time.sleep(0.05)
    return False
