"""The recording's other process: takes rows from the ring and writes the MCAP file.

Started by `Recorder` as `python -m tautwave.runtime.mcap_writer`, configured on standard input,
answering one line of JSON on standard output. The end of standard input means that the loop closed
the recording or died, even by `kill -9`; either way the ring is drained and the file completed. A
chunk's slots are freed only when the chunk is in the file, so killing this process loses at most
the chunk it was about to write.
"""

from __future__ import annotations

import base64
import json
import os
import select
import signal
import struct
import sys
import time
from typing import Any, NamedTuple

from tautwave.runtime import ring as words
from tautwave.runtime.ring import Ring

IDLE_S = 0.05  # at 1 kHz a wake-up takes some 50 of 8192 rows
BUSY_S = 0.002  # when the ring is a quarter full or more
OLDEST_S = (
    1.0  # limit on how long a chunk stays open, so that rows of slow loops reach the disk too
)
NICE = 5


class Order(NamedTuple):
    """The order from `Recorder`; sent as JSON with the attachments in base64."""

    descriptor: int
    path: str
    columns: tuple[str, ...]
    rows: int
    metadata: dict[str, str]
    attachments: dict[str, bytes]
    epoch_ns: int
    parent: int

    def to_bytes(self) -> bytes:
        """Length [8 bytes, little-endian] and JSON."""
        content = {key: base64.b64encode(raw).decode() for key, raw in self.attachments.items()}
        text = json.dumps({**self._asdict(), "attachments": content}).encode()
        return struct.pack("<Q", len(text)) + text

    @classmethod
    def read(cls, descriptor: int) -> Order:
        """Read the order from `descriptor`; EOFError if it ends early."""
        (length,) = struct.unpack("<Q", _read_exactly(descriptor, 8))
        fields: dict[str, Any] = json.loads(_read_exactly(descriptor, length))
        fields["columns"] = tuple(fields["columns"])
        content = fields["attachments"]
        fields["attachments"] = {key: base64.b64decode(raw) for key, raw in content.items()}
        return cls(**fields)


def write_error(path: str, error: OSError) -> str:
    """One sentence for a file that cannot be written."""
    folder = os.path.dirname(os.path.abspath(path))
    if isinstance(error, FileNotFoundError):
        why = f"the directory {folder} does not exist"
    elif isinstance(error, IsADirectoryError):
        why = "it is a directory"
    elif isinstance(error, PermissionError):
        why = f"no permission to write in {folder}"
    else:
        why = os.strerror(error.errno) if error.errno else str(error)
    return f"the recording {path} cannot be written: {why}"


def drain(order: Order, ring: Ring, file: Any) -> None:
    """Move rows from the ring to the file until the loop has closed it or died."""
    import numpy as np

    slots = np.frombuffer(ring.slots.cast("B"), np.float64).reshape(ring.rows, ring.width)
    # The loop must be able to fill one chunk while another is being written.
    per_chunk = min(file.rows_per_chunk, max(1, ring.rows // 2))
    tail, mark = 0, -1.0
    delay = IDLE_S
    last_write = time.monotonic()
    while True:
        # In this order, rows published before the end are seen after it.
        ended = _wait_for_end(order.parent, delay)
        head = ring.words[words.HEAD]
        delay = BUSY_S if head - tail >= ring.rows // 4 else IDLE_S
        late = time.monotonic() - last_write > OLDEST_S
        while head - tail >= per_chunk or (head > tail and (ended or late)):
            count = min(per_chunk, head - tail)
            at = tail % ring.rows
            block = slots[at : at + count]
            if len(block) < count:
                block = np.concatenate((block, slots[: count - len(block)]))
            if not _is_fresh(block, mark):
                if ended:
                    raise RuntimeError(f"row {tail} of the ring was counted but not copied")
                break  # its stores became visible later than its count: check again after the wait
            if mark < 0.0:
                file.epoch_ns = ring.words[words.EPOCH]  # said before the first row was
            file.append(block)
            mark = block[-1, -1]
            tail += count
            ring.words[words.TAIL] = tail
            ring.words[words.WRITTEN] = tail
            ring.words[words.FILE_BYTES] = file.length
            last_write = time.monotonic()
            late = False
            head = ring.words[words.HEAD]
        if ended and head == tail:
            return


def main() -> int:
    """Run until the loop ends. The outcome goes to standard output or into the ring."""
    _leave_the_loop_alone()
    try:
        order = Order.read(0)
    except EOFError:
        return 1  # the loop died before it sent anything
    try:
        ring = Ring(order.rows, len(order.columns), order.descriptor)
        from tautwave.runtime.mcap_file import McapFile

        file = McapFile(
            order.path, order.columns, order.metadata, order.attachments, order.epoch_ns
        )
    except OSError as error:
        return _answer(write_error(order.path, error))
    except Exception as error:  # noqa: BLE001 - nothing above would see it
        return _answer(f"the recording's writer failed: {type(error).__name__}: {error}")
    _answer("")
    try:
        drain(order, ring, file)
        file.finish(_ending(ring))
        ring.words[words.FILE_BYTES] = file.length
        file.close()
        ring.words[words.FINISHED] = 1
    except OSError as error:
        ring.error = write_error(order.path, error)
        return 1
    except Exception as error:  # noqa: BLE001 - nothing above would see it
        ring.error = f"the recording's writer failed: {type(error).__name__}: {error}"
        return 1
    return 0


def _ending(ring: Ring) -> dict[str, str]:
    written, dropped = ring.words[words.WRITTEN], ring.words[words.DROPPED]
    closed = ring.words[words.CLOSED]
    return {
        "rows_offered": str(written + dropped),
        "rows_written": str(written),
        "rows_dropped": str(dropped),
        "ended_by": "the loop closed the recording" if closed else "the loop's process vanished",
    }


def _is_fresh(block: Any, last_mark: float) -> bool:
    """Whether no slot of the block still holds an earlier lap: marks rise from row to row."""
    marks = block[:, -1]
    return bool(marks[0] > last_mark and (marks[1:] > marks[:-1]).all())


def _wait_for_end(parent: int, delay: float) -> bool:
    """True once the loop closed its end of standard input, or has another parent's number."""
    readable, _, _ = select.select([0], [], [], delay)
    return bool(readable) or os.getppid() != parent


def _leave_the_loop_alone() -> None:
    """Ordinary priority on any core, ignoring the signals that end the loop."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    try:
        if os.sched_getscheduler(0) != os.SCHED_OTHER:
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        os.sched_setaffinity(0, range(os.cpu_count() or 1))
        os.nice(NICE)
    except (OSError, AttributeError):  # not permitted, or not Linux: slower, not wrong
        return


def _answer(error: str) -> int:
    os.write(1, json.dumps({"error": error}).encode() + b"\n")
    return 1 if error else 0


def _read_exactly(descriptor: int, count: int) -> bytes:
    content = bytearray()
    while len(content) < count:
        part = os.read(descriptor, min(count - len(content), 1 << 20))
        if not part:
            raise EOFError
        content += part
    return bytes(content)


if __name__ == "__main__":
    sys.exit(main())
