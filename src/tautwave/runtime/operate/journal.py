"""What was asked, what followed, and the episodes between: the operation's own record."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol, runtime_checkable

from tautwave.runtime.operate.states import ENGAGED

NEWEST = 6
"""Entries that viewers get; more come only faster than anyone reads."""

ROOM = 2000
"""[bytes] For what viewers get."""

MOST = 10_000
"""Entries that are kept, so that a day-long run stays small."""


class Entry(NamedTuple):
    """A command or event at a time [s], the state after it, and a sentence if there is one.

    `refused`: it had no effect, and the sentence says why.
    """

    at_s: float
    word: str
    source: str
    state: str
    text: str = ""
    refused: bool = False


class Episode(NamedTuple):
    """One episode: number from 1, name, task, times [s]; `success` None: no verdict.

    `discarded`: it was to be recorded again.
    """

    number: int
    name: str
    task: str
    begin_s: float
    end_s: float | None = None
    success: bool | None = None
    discarded: bool = False


VERDICTS = {"success": True, "failed": False}
AGAIN = "again"
"""Discards the episode that runs, or else the last one, which is to be recorded again."""


def said_of(success: bool | None, discarded: bool = False) -> str:
    """Return what was said of an episode."""
    if discarded:
        return "to be recorded again"
    return "no verdict" if success is None else "success" if success else "failed"


class Journal:
    """Entries and episodes of one run; `tell` is called with the newest ones as JSON.

    `task` is that of episodes whose mark names none.
    """

    def __init__(self, task: str = "") -> None:
        self._task = task
        self.tell: Callable[[str], object] = len  # nobody is there
        self._noted = 0
        self._newest: list[tuple[int, Any]] = []
        self.entries: list[Entry] = []
        self.episodes: list[Episode] = []
        self.engagements = 0

    @property
    def running(self) -> int:
        """Number of the episode that runs, 0 for none."""
        last = self.episodes[-1] if self.episodes else None
        return last.number if last is not None and last.end_s is None else 0

    def note(self, entry: Entry) -> None:
        """Keep an entry."""
        if len(self.entries) < MOST:
            self.entries.append(entry)
        self._noted += 1
        self._newest = [*self._newest, (self._noted, entry._asdict())][-NEWEST:]
        while len(text := json.dumps(self._newest)) > ROOM:
            del self._newest[0]
        self.tell(text)

    def misplaced(self, argument: str, state: str) -> str:
        """Say why an episode is neither begun nor ended by `argument` in a state, '' if it is.

        Two people may press the same button: the second one must not undo what the first one did.
        Outside `engaged` the slave does not follow, so nothing can be demonstrated.
        """
        if argument == AGAIN:
            if not self.episodes or self.episodes[-1].discarded:
                return "episode again: there is none to record again"
            return ""
        verdict = argument in VERDICTS
        if verdict and not self.running:
            return f"episode {argument}: no episode is running"
        if argument and not verdict and self.running:
            return f"episode {self.running} is running; end it first, with success or failed"
        if not self.running and state != ENGAGED:
            return f"episode: the rig is {state}, so the slave does not follow; engage it first"
        return ""

    def mark(self, at_s: float, argument: str) -> str:
        """Begin an episode, named by the first word of `argument`, or end the one that runs.

        At the end `argument` says `success` or `failed`; `again` discards it, also afterwards.
        """
        if argument == AGAIN:
            last = self.episodes[-1]
            end_s = at_s if last.end_s is None else last.end_s
            self.episodes[-1] = last._replace(end_s=end_s, discarded=True)
            return f"episode {last.number} discarded, to be recorded again"
        if not self.running:
            name, _, task = argument.partition(" ")
            number = len(self.episodes) + 1
            task = task.strip() or self._task
            self.episodes.append(Episode(number, name or f"episode-{number}", task, at_s))
            return f"episode {number} started"
        success = VERDICTS.get(argument)
        self.episodes[-1] = self.episodes[-1]._replace(end_s=at_s, success=success)
        return f"episode {self.episodes[-1].number} ended"

    def summary(self, end_s: float) -> dict[str, Any]:
        """Return it for summary.json; an episode that still runs ends at `end_s` [s]."""
        return {
            "engagements": self.engagements,
            "journal": [entry._asdict() for entry in self.entries],
            "episodes": [
                (one if one.end_s is not None else one._replace(end_s=end_s))._asdict()
                for one in self.episodes
            ],
        }


@runtime_checkable
class Journalled(Protocol):
    """A controller that people operate: it keeps a journal of what they gave it."""

    journal: Journal
    inbox: Any
    lamps: Sequence[Any]
