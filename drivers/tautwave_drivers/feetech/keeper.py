"""A process beside the run that stops all servos of a line once the run is silent, or gone.

Servos without a watchdog go on with their last goal when the process that drives them is killed or
stalls. This one has the same line open, and then sends torque off to all servos. It cannot help
where the machine itself stops, or the cable is pulled.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys

FEED, REST, END = b".", b"r", b"q"
WAIT_S = 5.0
"""Longest wait for its end, when it has nothing left to do."""

PROGRAM = """
import os, select, sys
line, stop, limit = int(sys.argv[1]), bytes.fromhex(sys.argv[2]), float(sys.argv[3])
fed = False
while True:
    ready, _, _ = select.select([0], [], [], limit if fed else None)
    said = os.read(0, 4096) if ready else b""
    if said[-1:] == b"q":
        break
    if not said:
        for _ in range(2):
            try:
                os.write(line, stop)
            except OSError:
                pass
        if ready:
            break
    fed = said[-1:] == b"."
"""
"""Fed, it expects more within the limit; the end of its input is the end of the run."""


class Keeper:
    """The process, from the start of a run to its end.

    Parameters
    ----------
    line : int
        Descriptor of the serial device.
    stop : bytes
        What stops all servos on it.
    limit_s : float
        [s] Silence after which it is sent.
    """

    def __init__(self, line: int, stop: bytes, limit_s: float) -> None:
        words = [sys.executable, "-S", "-c", PROGRAM, str(line), stop.hex(), str(limit_s)]
        self._child = subprocess.Popen(
            words,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            pass_fds=(line,),
            start_new_session=True,  # Ctrl-C here is not for it
        )
        assert self._child.stdin is not None
        self._pipe = self._child.stdin.fileno()
        os.set_blocking(self._pipe, False)

    def feed(self) -> bool:
        """Say that the run goes on; return whether the process is there to hear it."""
        try:
            os.write(self._pipe, FEED)
        except BlockingIOError:
            return True  # it is not scheduled: what it will read is enough
        except OSError:
            return False
        return True

    def rest(self) -> None:
        """Say that no servo is on: silence is right from now on."""
        with contextlib.suppress(OSError):
            os.write(self._pipe, REST)

    def end(self, stop: bool = False) -> None:
        """End it, with nothing sent; or with what stops all servos, as if the run were gone."""
        if not stop:
            with contextlib.suppress(OSError):
                os.write(self._pipe, END)
        assert self._child.stdin is not None
        with contextlib.suppress(OSError):
            self._child.stdin.close()
        try:
            self._child.wait(WAIT_S)
        except subprocess.TimeoutExpired:
            self._child.kill()
            self._child.wait()
