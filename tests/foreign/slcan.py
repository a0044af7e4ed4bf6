"""A USB adapter of the slcan kind on a pseudo-terminal, with foreign drives behind it.

Source: the protocol's commands as python-can documents them: S bit rate, O open, C close, and `t`
with three digits of id, one of length, and data in hexadecimal; each line ends with CR.
"""

from __future__ import annotations

import os
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from tests.foreign.cia402 import ForeignDrive

TICK_S = 0.0005


class Adapter:
    """The adapter, and its drives in a thread."""

    def __init__(self, *numbers: int) -> None:
        self._end, self._terminal = os.openpty()
        tty.setraw(self._terminal)
        os.set_blocking(self._end, False)
        self.path = os.ttyname(self._terminal)
        self.commands: list[str] = []
        self.drives = [ForeignDrive(number, self._send) for number in numbers]
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _send(self, can_id: int, data: bytes) -> None:
        line = f"t{can_id:03X}{len(data)}{data.hex().upper()}\r".encode()
        try:
            os.write(self._end, line)
        except BlockingIOError:
            return  # nobody reads

    def _run(self) -> None:
        begun, typed = time.monotonic(), b""
        while not self._over.wait(TICK_S):
            with suppress(OSError):  # nothing there, or nobody
                typed += os.read(self._end, 4096)
            *lines, typed = typed.split(b"\r")
            now = time.monotonic() - begun
            for line in lines:
                if line[:1] != b"t":
                    self.commands.append(line.decode())
                    continue
                data = bytes.fromhex(line[5:].decode())
                for drive in self.drives:
                    drive.take(int(line[1:4], 16), data[: int(line[4:5])], now)
            for drive in self.drives:
                drive.run(now)

    def close(self) -> None:
        self._over.set()
        self._thread.join()
        os.close(self._terminal)
        os.close(self._end)


@contextmanager
def adapter(*numbers: int) -> Iterator[Adapter]:
    """An adapter with drives behind it."""
    made = Adapter(*numbers)
    try:
        yield made
    finally:
        made.close()
