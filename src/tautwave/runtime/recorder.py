"""The loop's end of a recording: fill `row`, call `commit`, and at the end `close`.

The file is written by another process (`mcap_writer`); this module imports neither NumPy nor mcap.
`commit` takes 0.5-1 us with warm caches; paced at 1 kHz, with 6 MB of other data touched between
two cycles, 3 us (median) and 6 us (99 %), 60 and 120 columns alike. Filling `row` by index comes
to 0.05 us an item.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from tautwave.errors import RecordingError, WritingError
from tautwave.files import write_text
from tautwave.runtime import ring as words
from tautwave.runtime.mcap_writer import Order
from tautwave.runtime.ring import Ring
from tautwave.runtime.tap import LIVE, Live

READY_S = 30.0  # a loaded machine may need seconds to start an interpreter
STUCK_S = 30.0  # time without progress at close after which the writer is killed
_FULL_POLL_S = 0.0005


class RecorderStats(NamedTuple):
    """How a recording ended: rows handed over, in the file, and the rest; the file's length.

    `error` is one sentence, or None when the file is complete.
    """

    rows_offered: int
    rows_written: int
    rows_dropped: int
    bytes: int
    error: str | None


class Recorder:
    """A recording of one row of float64 per cycle.

    Parameters
    ----------
    path
        Of the MCAP file; its directory exists, an existing file is replaced.
    columns
        Unique names, dots make a tree in viewers; `time_s` [s since the start] is one of them.
    metadata, attachments
        Stored with the rows. Attachments by file name.
    rows
        Slots of the ring; 8192 are 8 s at 1 kHz.
    lossless
        True: `commit` waits while the ring is full (virtual time). False: it drops and counts.
    rate_hz
        Rate of the loop; recorded.
    live
        Written into `live.json` beside the file while rows come, for viewers; None: no such file.
    epoch_ns
        Unix time [ns] of `time_s` = 0; by default that at which the loop says `begin`.

    Attributes
    ----------
    row
        Writable memoryview of float64, one item per column, kept between cycles.
    commit
        Hands `row` over; False when it was dropped. Never raises.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        columns: Sequence[str],
        *,
        metadata: Mapping[str, str],
        attachments: Mapping[str, bytes],
        rows: int = 8192,
        lossless: bool,
        rate_hz: float,
        epoch_ns: int | None = None,
        live: Mapping[str, Any] | None = None,
    ) -> None:
        self.path = os.fspath(path)
        self.columns = tuple(columns)
        if "time_s" not in self.columns:
            raise RecordingError("a recording needs a column 'time_s'")
        twice = [name for name, count in Counter(self.columns).items() if count > 1]
        if twice:
            raise RecordingError(f"columns given twice: {', '.join(twice)}")
        if rows < 2:
            raise RecordingError(f"the recording's ring needs at least 2 rows (got {rows})")
        self._metadata = {**metadata, "rate_hz": repr(float(rate_hz))}
        self._attachments = dict(attachments)
        self._epoch_ns = epoch_ns
        self._live = live
        self._live_path = Path(self.path).with_name(LIVE)
        self._writer: subprocess.Popen[bytes] | None = None
        self._stats: RecorderStats | None = None
        try:
            self._ring = Ring(rows, len(self.columns))
        except OSError as error:
            raise WritingError(f"no shared memory for the recording: {error}") from error
        self._ring.words[words.EPOCH] = time.time_ns() if epoch_ns is None else epoch_ns
        if lossless:
            self._ring.wait_for_room = self._wait_for_room
        self.row: memoryview[float] = self._ring.row
        self.commit: Callable[[], bool] = self._ring.push

    @property
    def writer_pid(self) -> int | None:
        """Of the writing process; None before `start`."""
        return None if self._writer is None else self._writer.pid

    def start(self) -> None:
        """Start the writer and wait until the file is open; a WritingError says why it is not."""
        if self._stats is not None or self._writer is not None:
            raise RecordingError(f"the recording {self.path} was already started")
        order = Order(
            descriptor=self._ring.descriptor,
            path=os.path.abspath(self.path),
            columns=self.columns,
            rows=self._ring.rows,
            metadata=self._metadata,
            attachments=self._attachments,
            epoch_ns=self._ring.words[words.EPOCH],
            parent=os.getpid(),
        )
        # The child imports modules from this process' path, not from its directory.
        where = os.pathsep.join(entry for entry in sys.path if entry)
        self._writer = subprocess.Popen(
            [sys.executable, "-m", "tautwave.runtime.mcap_writer"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            pass_fds=(self._ring.descriptor,),
            env={**os.environ, "PYTHONPATH": where, "PYTHONSAFEPATH": "1"},
            start_new_session=True,  # Ctrl-C at the terminal is for the loop
        )
        error = self._converse(order)
        self._announce(order)
        self._ring.close_descriptor()
        if error:
            self._stats = RecorderStats(0, 0, 0, 0, error)
            self._end_writer()
            self._ring.close()
            raise WritingError(error)

    def begin(self, now_ns: int) -> None:
        """Take this moment, `now_ns` by the loop's clock, for the first slot's: `time_s` = 0.

        Not that of `start`: buses open and drives are enabled in between, which takes seconds.
        """
        if self._epoch_ns is None:
            self._ring.words[words.EPOCH] = time.time_ns()
        self._ring.words[words.BEGUN] = now_ns

    def tell(self, text: str) -> None:
        """Put a message for viewers in place of the last one."""
        self._ring.tell(text)

    @property
    def backlog(self) -> float:
        """Share of the ring whose rows are not in the file yet; 1: the next are lost."""
        shared = self._ring.words
        return float(shared[words.HEAD] - shared[words.TAIL]) / self._ring.rows

    def problem(self) -> str | None:
        """One sentence once the writer has failed or died, else None. Too slow for every cycle."""
        if self._stats is not None:
            return self._stats.error
        if self._writer is None or self._writer.poll() is None:
            return None
        return self._ring.error or self._obituary()

    def close(self) -> RecorderStats:
        """Let the writer drain the ring and complete the file. Idempotent, never raises."""
        if self._stats is None:
            error = self._finish() if self._writer is not None else None
            offered, shared = self._ring.offered, self._ring.words
            written = shared[words.WRITTEN]
            self._stats = RecorderStats(
                offered, written, offered - written, shared[words.FILE_BYTES], error
            )
            self._end_writer()
            self._ring.close()
            if self._live is not None:
                self._live_path.unlink(missing_ok=True)
        return self._stats

    def _announce(self, order: Order) -> None:
        """Tell viewers where the rows are; a run without viewers needs no file."""
        if self._live is None or self.writer_pid is None:
            return
        rate_hz = float(self._metadata["rate_hz"])
        live = Live(
            self.writer_pid, order.descriptor, self.columns, order.rows, rate_hz, {**self._live}
        )
        with contextlib.suppress(WritingError):
            write_text(self._live_path, live.text())

    def _finish(self) -> str | None:
        shared = self._ring.words
        shared[words.CLOSED] = 1
        self._hang_up()
        writer = self._writer
        assert writer is not None
        progress, deadline = -1, 0.0
        try:
            while writer.poll() is None:
                now = time.monotonic()
                if shared[words.TAIL] != progress:
                    progress, deadline = shared[words.TAIL], now + STUCK_S
                elif now > deadline:
                    writer.kill()
                    writer.wait()
                    return (
                        f"the recording writer made no progress for {STUCK_S:g} s and was "
                        f"killed; {self._what_is_left()}"
                    )
                time.sleep(0.002)
        except KeyboardInterrupt:
            return f"not waiting: {self.path} is still being completed by its writer"
        if shared[words.FINISHED]:
            return None
        error = self._ring.error
        return f"{error}; {self._what_is_left()}" if error else self._obituary()

    def _obituary(self) -> str:
        assert self._writer is not None
        code = self._writer.returncode
        if code is not None and code < 0:
            how = f"was killed by {signal.Signals(-code).name}"
        else:
            how = f"ended with exit code {code}"
        return f"the recording's writer {how}; {self._what_is_left()}"

    def _what_is_left(self) -> str:
        written = self._ring.words[words.WRITTEN]
        return f"{written} rows are in {self.path}, which `tautwave report` still reads"

    def _converse(self, order: Order) -> str:
        """Send the order to the writer and wait for its reply; '' or why it cannot write."""
        writer = self._writer
        assert writer is not None
        assert writer.stdin is not None
        assert writer.stdout is not None
        with contextlib.suppress(BrokenPipeError):
            writer.stdin.write(order.to_bytes())
            writer.stdin.flush()
        if not select.select([writer.stdout], [], [], READY_S)[0]:
            writer.kill()
            return f"the recording's writer was not ready within {READY_S:g} s"
        line = writer.stdout.readline()
        if line:
            return str(json.loads(line)["error"])
        code = writer.wait()
        return f"the recording's writer ended with exit code {code} before it was ready"

    def _wait_for_room(self) -> bool:
        """Sleep until the writer has taken rows out; False if the writer has gone."""
        ring, writer = self._ring, self._writer
        while ring.is_full:
            if writer is None or writer.poll() is not None:
                return not ring.is_full
            time.sleep(_FULL_POLL_S)
        return True

    def _hang_up(self) -> None:
        if self._writer is not None and self._writer.stdin is not None:
            with contextlib.suppress(OSError):
                self._writer.stdin.close()

    def _end_writer(self) -> None:
        self._hang_up()
        if self._writer is not None and self._writer.stdout is not None:
            self._writer.stdout.close()
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._writer.wait(timeout=1.0)
