"""Hand rows of float64 from the loop to another process through shared memory.

One process pushes, one drains; neither ever takes a lock. The memory is an anonymous `memfd` passed
by file descriptor: it has no name, so nothing is left in /dev/shm however the two end.

A row is copied into its slot first and counted in `HEAD` afterwards, so the other side never sees
half a row. x86 keeps the order in which one core's stores are seen, and between the copy and the
count lie some hundred instructions of the interpreter; for processors with weaker rules every
slot also carries the number of its cycle (`mark`), by which the reader recognises a slot that
still holds an earlier lap.
"""

from __future__ import annotations

import mmap
import os
import tempfile
from collections.abc import Callable

PAGE_BYTES = 4096

# Index of each 64-bit word in the first page: one cache line apart, so that the two processes do
# not fight over a line. HEAD, DROPPED and CLOSED belong to the loop, the others to the writer.
HEAD = 0  # rows published
DROPPED = 8  # rows dropped because the ring was full
CLOSED = 16  # 1: the loop has finished
TAIL = 24  # rows taken out; their slots are free
WRITTEN = 32  # rows in the file
FILE_BYTES = 40  # length of the file
FINISHED = 48  # 1: the file is complete
NEWS = 56  # of the loop's news for viewers: grows by 2 with each, odd while they are written
EPOCH = 64  # Unix time [ns] of the first slot
BEGUN = 72  # the same by the loop's clock [ns]; 0: the loop has not begun
ERROR_AT, ERROR_BYTES = 1024, 1024  # in bytes: the writer's error message, UTF-8, zero padded
NEWS_AT, NEWS_BYTES = 2048, 2048  # the same for news


class Ring:
    """Both ends of the ring. The loop's end fills `row` by index and calls `push`.

    Parameters
    ----------
    rows
        Slots, at least 2.
    columns
        Floats in a row.
    descriptor An existing ring (the draining end); without it a new ring is made.
    """

    def __init__(self, rows: int, columns: int, descriptor: int | None = None) -> None:
        self.rows = rows
        self.columns = columns
        self.width = columns + 1  # the last float of a slot is its mark
        size = PAGE_BYTES + rows * self.width * 8
        self.descriptor = _anonymous_file(size) if descriptor is None else descriptor
        # MAP_POPULATE maps every page now: a page fault in the loop costs 20-130 us (p99).
        flags = mmap.MAP_SHARED | getattr(mmap, "MAP_POPULATE", 0)
        self._memory = mmap.mmap(self.descriptor, size, flags)
        whole = memoryview(self._memory)
        self.words = whole[:PAGE_BYTES].cast("Q")
        self.slots = whole[PAGE_BYTES:].cast("d")
        self._error = whole[ERROR_AT : ERROR_AT + ERROR_BYTES]
        self._news = whole[NEWS_AT : NEWS_AT + NEWS_BYTES]
        whole.release()
        self._slot = memoryview(bytearray(self.width * 8)).cast("d")
        self.row = self._slot[:columns]
        self.wait_for_room: Callable[[], bool] | None = None
        self._head = 0
        self._limit = rows  # pushing is safe below this count; refreshed from TAIL when reached
        self.dropped = 0
        self._closed = False
        if descriptor is None:
            self._touch_every_page(size)

    def push(self) -> bool:
        """Push `row`; False if there was no room, and it is then counted as dropped."""
        head = self._head
        if head >= self._limit and not self._find_room():
            self.dropped += 1
            if not self._closed:
                self.words[DROPPED] = self.dropped
            return False
        slot = self._slot
        slot[self.columns] = head + self.dropped
        at = head % self.rows * self.width
        self.slots[at : at + self.width] = slot
        self._head = head + 1
        self.words[HEAD] = head + 1
        return True

    @property
    def offered(self) -> int:
        """Rows pushed so far, the dropped ones included."""
        return self._head + self.dropped

    @property
    def is_full(self) -> bool:
        """Whether no slot is free."""
        return self._head - self.words[TAIL] >= self.rows

    @property
    def error(self) -> str:
        """The writer's last message, or ''."""
        return bytes(self._error).rstrip(b"\0").decode("utf-8", "replace")

    @error.setter
    def error(self, text: str) -> None:
        encoded = text.encode("utf-8", "replace")[:ERROR_BYTES]
        self._error[:] = encoded.ljust(ERROR_BYTES, b"\0")

    def tell(self, text: str) -> None:
        """Put a message for viewers in place of the last one."""
        if self._closed:
            return
        count = self.words[NEWS]
        self.words[NEWS] = count + 1
        self._news[:] = text.encode("utf-8", "replace")[:NEWS_BYTES].ljust(NEWS_BYTES, b"\0")
        self.words[NEWS] = count + 2

    def close_descriptor(self) -> None:
        """Close the file descriptor; the memory stays mapped."""
        if self.descriptor >= 0:
            os.close(self.descriptor)
            self.descriptor = -1

    def close(self) -> None:
        """Release the memory; from now on `push` drops. No other views onto `slots` may exist."""
        if self._closed:
            return
        self._closed = True
        self._limit = 0
        self.close_descriptor()
        for view in (self.words, self.slots, self._error, self._news):
            view.release()
        self._memory.close()

    def _find_room(self) -> bool:
        if self._closed:
            return False
        self._limit = self.words[TAIL] + self.rows
        if self._head < self._limit:
            return True
        if self.wait_for_room is None or not self.wait_for_room():
            return False
        self._limit = self.words[TAIL] + self.rows
        return self._head < self._limit

    def _touch_every_page(self, size: int) -> None:
        for at in range(0, size, PAGE_BYTES):
            self._memory[at] = 0


def _anonymous_file(size: int) -> int:
    """Descriptor of a file of `size` bytes without a name."""
    if hasattr(os, "memfd_create"):
        descriptor = os.memfd_create("tautwave-ring")
    else:
        with tempfile.TemporaryFile() as file:
            descriptor = os.dup(file.fileno())
    os.ftruncate(descriptor, size)
    return descriptor
