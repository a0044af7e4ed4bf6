"""A run in progress, as its viewers see it."""

from __future__ import annotations

import os
import signal
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

from tautwave.clock import MonotonicClock
from tautwave.config.guard import parse_json
from tautwave.errors import RecordingError
from tautwave.reading import read_file
from tautwave.runtime.operate.commands import LEAD
from tautwave.runtime.operate.mailbox import send
from tautwave.runtime.tap import LIVE, Live, Tap

STOP = "stop"
KNOCK_NS = 200_000_000
LARGEST = 16 * 1024 * 1024
"""Bytes of what a run says of itself."""


def read_live(directory: Path) -> Live:
    """Return where the rows of a run are.

    Raises
    ------
    RecordingError
        No run is in progress in that directory.
    """
    path = directory / LIVE
    try:
        fields = parse_json(read_file(path, LARGEST).decode())
        return Live(**{name: fields[name] for name in Live._fields})
    except (FileNotFoundError, NotADirectoryError) as error:
        raise RecordingError(f"{directory}: no run in progress here") from error
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror})") from error
    except (ValueError, KeyError, TypeError) as error:
        raise RecordingError(f"{path}: was not written by a run, or is damaged") from error


class Watched:
    """The rows, the news and the mailbox of a run.

    Attributes
    ----------
    live : Live
        What the run says of itself.
    tap : Tap
        Its rows.
    """

    def __init__(self, directory: Path, live: Live, tap: Tap) -> None:
        self.directory = directory
        self.live = live
        self.tap = tap
        self._stopped = False

    @classmethod
    def of_run(cls, directory: Path) -> Self:
        """Open the run in a directory.

        Raises
        ------
        RecordingError
            No run is in progress there.
        """
        live = read_live(directory)
        return cls(directory, live, Tap.of_run(live))

    @property
    def facts(self) -> dict[str, Any]:
        """What the session says of its rig."""
        return self.live.facts

    @property
    def ended(self) -> bool:
        """Whether no more rows come."""
        return self.tap.closed or not Path(f"/proc/{self.live.pid}").exists()

    def command(self, source: str, line: str) -> None:
        """Give the run a command; any run can be stopped.

        Raises
        ------
        RecordingError
            It has ended, or takes no commands.
        """
        mailbox = self.facts.get("mailbox")
        if mailbox is not None:
            send(mailbox, source, line)
        elif line.strip() == STOP:
            self._interrupt()
        else:
            raise RecordingError(
                "this rig accepts no commands except stop: it has no `operate` "
                "block, or uses the fake clock"
            )

    def point(self, places: Mapping[str, float] | None) -> None:
        """Lead hands to places [rad or m]; None: let them go.

        Raises
        ------
        RecordingError
            The run has ended, or has no such hands.
        """
        pointer = self.facts.get("pointer")
        if pointer is None:
            raise RecordingError("no hand of this run follows a pointer; see `run --pointer`")
        unknown = sorted(set(places or ()) - set(pointer["ranges"]))
        if unknown:
            raise RecordingError(f"{unknown[0]}: no hand of it follows a pointer")
        words = [LEAD, *(f"{name}={place!r}" for name, place in (places or {}).items())]
        send(pointer["mailbox"], "page", " ".join(words) if places else "release")

    def _interrupt(self) -> None:
        """Ramp down as Ctrl-C does, once: a second time would leave at once."""
        run = int(self.facts.get("pid", 0))
        try:
            fields = Path(f"/proc/{self.live.pid}/stat").read_text().rpartition(")")[2].split()
            if int(fields[1]) != run:  # the writer's parent; a number may be another's by now
                raise RecordingError("the run has ended")
            if not self._stopped:
                os.kill(run, signal.SIGINT)
            self._stopped = True
        except (OSError, ValueError, IndexError) as error:
            raise RecordingError(
                f"the run has ended or belongs to another user ({error})"
            ) from error


def begun(directory: Path, clock: MonotonicClock, patience_s: float) -> Watched:
    """Return the run in a directory, once it has begun.

    Raises
    ------
    RecordingError
        None has, in that time.
    """
    until = clock.now_ns() + round(1e9 * patience_s)
    while True:
        try:
            return Watched.of_run(directory)
        except RecordingError:
            if clock.now_ns() >= until:
                raise
        clock.sleep_until(clock.now_ns() + KNOCK_NS)
