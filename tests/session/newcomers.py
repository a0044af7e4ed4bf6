"""A newcomer with served devices: commands of tautwave, hands that move, lines that are typed."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

TAUTWAVE = (sys.executable, "-c", "from tautwave.cli import main; main()")
PATIENCE_S = 60.0


class Newcomer:
    """Someone in a folder of their own, who counts commands."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.commands: list[str] = []

    def does(self, *words: str) -> str:
        """Run a command to its end; return what it printed."""
        self.commands.append(words[0])
        done = subprocess.run(
            (*TAUTWAVE, *words), cwd=self.folder, capture_output=True, text=True, timeout=120
        )
        assert done.returncode == 0, f"{words}: {done.stdout[-2000:]}{done.stderr[-2000:]}"
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
        """Read lines until one has these words."""
        assert self.child.stdout is not None
        for line in self.child.stdout:
            self.heard.append(line)
            if words in line:
                return line
        raise AssertionError(f"never said {words!r}: {''.join(self.heard)}")

    def end(self) -> None:
        out, _ = self.child.communicate(timeout=PATIENCE_S)
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
        talk.hears("into the pose")
        talk.types()
        for one in ids:
            talk.hears("direction that is to be positive")
            hands.types(f"{one} 0.5 {move_s}")
            time.sleep(2.0 * move_s)
            talk.types()
            hands.types(f"{one} 0 {move_s}")
        talk.hears("to both ends")
        for end in (1.2, -1.2, 0.0):
            hands.types(f"{everyone} {end} {2.0 * move_s}")
            time.sleep(3.0 * move_s)
        talk.types()


def state_of(directory: Path) -> str:
    """Return the state of a run that is going on, '' before its first row."""
    done = subprocess.run(
        (*TAUTWAVE, "view", str(directory), "--json"), capture_output=True, text=True
    )
    if done.returncode:
        return ""
    from tautwave.runtime.operate.states import STATES

    return STATES[int(json.loads(done.stdout)["operation.state"])]


def wait_for(directory: Path, state: str) -> bool:
    """Wait until a run is in a state."""
    until = time.monotonic() + PATIENCE_S
    while time.monotonic() < until:
        if state_of(directory) == state:
            return True
    return False
