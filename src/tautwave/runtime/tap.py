"""Read the rows of a run in progress from another process, without disturbing it.

The recording's ring is mapped read-only through its writer's descriptor. Nothing is written, so a
viewer that is slow, stopped or killed costs the run nothing; it only misses rows, and counts them.

A slot that is being overwritten still shows its old mark, so the mark does not prove a row whole.
`HEAD` does: a row that was copied counts only if, after the copy, the loop had not yet begun the
next lap on its slot.
"""

from __future__ import annotations

import json
import mmap
import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, NamedTuple, Self, TypeVar, cast

from tautwave.errors import RecordingError
from tautwave.runtime import ring as words

LIVE = "live.json"
"""In the directory of a run while it is in progress."""


class Live(NamedTuple):
    """Where the rows of a run are: the writer's process and descriptor, and what a row holds.

    `facts` is what the session says of its rig: pairs and their units.
    """

    pid: int
    descriptor: int
    columns: Sequence[str]
    rows: int
    rate_hz: float
    facts: dict[str, Any]

    def text(self) -> str:
        """Return it as it is written into the directory."""
        return json.dumps(self._asdict())


Copied = TypeVar("Copied")


def _floats(row: memoryview[float]) -> list[float]:
    return cast("list[float]", row.tolist())


class Tap:
    """Rows of a ring, read-only; `missed` counts those that went by unseen.

    Parameters
    ----------
    descriptor : int
        Of the ring's memory, open for reading; it is not closed here.
    rows, columns : int
        Slots of the ring, floats in a row.
    """

    def __init__(self, descriptor: int, rows: int, columns: int) -> None:
        self.rows = rows
        self.columns = columns
        self._width = columns + 1
        size = words.PAGE_BYTES + rows * self._width * 8
        self._memory = mmap.mmap(descriptor, size, access=mmap.ACCESS_READ)
        whole = memoryview(self._memory)
        self._words = whole[: words.PAGE_BYTES].cast("Q")
        self._slots = whole[words.PAGE_BYTES :].cast("d")
        whole.release()
        self._next = max(0, self._words[words.HEAD] - 1)  # the newest row is there at once
        self._reason = ""
        self.missed = 0

    @classmethod
    def of_run(cls, live: Live) -> Self:
        """Open the ring of a run.

        Raises
        ------
        RecordingError
            The run has ended, or belongs to another user.
        """
        path = f"/proc/{live.pid}/fd/{live.descriptor}"
        try:
            if "tautwave-ring" not in os.readlink(path):
                raise RecordingError("the run has ended")
            descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        except OSError as error:
            raise RecordingError(
                f"the run has ended or belongs to another user ({error})"
            ) from error
        try:
            return cls(descriptor, live.rows, len(live.columns))
        except (OSError, ValueError) as error:
            raise RecordingError("the run's rows cannot be mapped") from error
        finally:
            os.close(descriptor)

    @property
    def closed(self) -> bool:
        """Whether the loop has finished."""
        return bool(self._words[words.CLOSED])

    @property
    def epoch_ns(self) -> int:
        """Unix time [ns] of the run's `time_s` = 0; provisional until it has `begun_ns`."""
        return self._words[words.EPOCH]

    @property
    def begun_ns(self) -> int:
        """The same moment by the loop's clock [ns], or 0: the first slot is still to come."""
        return self._words[words.BEGUN]

    def take(self) -> list[list[float]]:
        """Return the whole rows since the last call, oldest first; never waits.

        A reader more than half a ring behind continues half a ring behind the newest row.
        """
        return self._take(_floats)[1]

    def take_bytes(self) -> tuple[int, bytes]:
        """Return the same as float64 in a row, and the number of the first row."""
        first, copied = self._take(memoryview.tobytes)
        return first, b"".join(copied)

    def news(self) -> str:
        """Return the loop's last whole message, '' if there is none."""
        before = self._words[words.NEWS]
        text = self._memory[words.NEWS_AT : words.NEWS_AT + words.NEWS_BYTES]
        if before % 2 == 0 and self._words[words.NEWS] == before:
            self._reason = text.rstrip(b"\0").decode("utf-8", "replace")
        return self._reason

    def _take(self, read: Callable[[memoryview[float]], Copied]) -> tuple[int, list[Copied]]:
        head = self._words[words.HEAD]
        first = max(self._next, head - self.rows // 2)
        width, columns = self._width, self.columns
        copied = []
        for number in range(first, head):
            at = number % self.rows * width
            copied.append(read(self._slots[at : at + columns]))
        # The loop may be filling slot `head` now: of the lap before it is no longer whole.
        torn = max(0, self._words[words.HEAD] - self.rows + 1 - first)
        self.missed += first - self._next + min(torn, len(copied))
        self._next = head
        return first + torn, copied[torn:]

    def close(self) -> None:
        """Release the memory."""
        self._words.release()
        self._slots.release()
        with suppress(BufferError):
            self._memory.close()
