"""A page of memory in which another process leaves a whole set of values for the loop.

The writer makes the generation odd, writes every value, and makes it even again; the loop looks at
the generation, copies the values and looks again. So it takes a set as a whole or not yet, waits
for nobody, and reads one word where there is nothing new.
"""

from __future__ import annotations

import fcntl
import mmap
import os
import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any

from tautwave.errors import RecordingError

NAME = "tautwave-desk"
WORD = struct.Struct("<Q")
VALUES_AT = 64


def desk_bytes(count: int) -> int:
    """Return the size of a desk of that many values."""
    return VALUES_AT + 8 * count


class ParameterPage:
    """The loop's end; `generation` is that of the last set it took."""

    def __init__(self, count: int) -> None:
        self._count = count
        self._descriptor = os.memfd_create(NAME, os.MFD_CLOEXEC)
        os.ftruncate(self._descriptor, desk_bytes(count))
        self._memory = mmap.mmap(self._descriptor, desk_bytes(count))
        self._word = memoryview(self._memory).cast("Q")
        self._values = memoryview(self._memory)[VALUES_AT:].cast("d")
        self.generation = 0

    @property
    def address(self) -> dict[str, int]:
        """Where it is, for `live.json`."""
        return {"pid": os.getpid(), "descriptor": self._descriptor}

    def take(self) -> Sequence[float] | None:
        """Return a new set, None without one; never waits."""
        word = self._word[0]
        if word == self.generation or word % 2:
            return None
        values = self._values.tolist()
        if self._word[0] != word:
            return None
        self.generation = word
        return values

    def close(self) -> None:
        """Release it; later writers get an error."""
        self._word.release()
        self._values.release()
        with suppress(BufferError):
            self._memory.close()
        os.close(self._descriptor)


def last_left(address: dict[str, Any], count: int) -> Sequence[float] | None:
    """Return the last set on a run's desk, None if there is none; errors as `leave`."""
    with _opened(address) as descriptor, _mapped(descriptor, count) as memory:
        if not WORD.unpack_from(memory)[0]:
            return None
        return struct.unpack_from(f"<{count}d", memory, VALUES_AT)


def leave(address: dict[str, Any], values: Sequence[float]) -> None:
    """Leave a whole set on a run's desk.

    Raises
    ------
    RecordingError
        The run has ended, or belongs to another user.
    """
    with (
        _opened(address) as descriptor,
        _mapped(descriptor, len(values)) as memory,
        memoryview(memory).cast("Q") as word,
    ):
        # As one store each: `pack_into` clears the bytes first, and a loop that looked then would
        # take the last set for a new one.
        odd = word[0] | 1
        word[0] = odd
        struct.pack_into(f"<{len(values)}d", memory, VALUES_AT, *values)
        word[0] = odd + 1


@contextmanager
def _opened(address: dict[str, Any]) -> Iterator[int]:
    """Give a run's desk, to one process at a time."""
    path = f"/proc/{address['pid']}/fd/{address['descriptor']}"
    try:
        if NAME not in os.readlink(path):
            raise RecordingError("the run has ended")
        descriptor = os.open(path, os.O_RDWR | os.O_CLOEXEC)
    except OSError as error:
        raise RecordingError(f"the run has ended or belongs to another user ({error})") from error
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield descriptor
    finally:
        os.close(descriptor)


def _mapped(descriptor: int, count: int) -> mmap.mmap:
    return mmap.mmap(descriptor, desk_bytes(count))
