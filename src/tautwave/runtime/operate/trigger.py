"""A trigger on the lines of a serial port: out while an episode runs, in as a command.

Out are RTS and DTR, in is CTS: the lines that amplifiers, cameras and stimulus boxes are wired to.
What is no serial port, a pipe, gets the bytes `1` and `0` instead.

Source: tty_ioctl(4), TIOCMBIS, TIOCMBIC, TIOCMGET.
"""

from __future__ import annotations

import fcntl
import os
import struct
import termios
from collections.abc import Sequence

from tautwave.errors import DriverError
from tautwave.runtime.operate.commands import Order

OUT = struct.pack("i", termios.TIOCM_RTS | termios.TIOCM_DTR)
NOTHING = struct.pack("i", 0)


class TriggerLine:
    """One serial port and its lines.

    Parameters
    ----------
    path : str
        The port.
    word : str
        Command of a rising edge on CTS; '' for none.

    Raises
    ------
    DriverError
        The port cannot be opened.
    """

    def __init__(self, path: str, word: str = "") -> None:
        self._word = word
        try:
            self._descriptor = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError as err:
            raise DriverError(f"trigger {path}: {err.strerror}") from err
        self._is_port = True
        self._was_high = True
        self.shows(on=False)

    def shows(self, *, on: bool) -> None:
        """Set the lines out; one that fails is left as it is: a run is not lost for it."""
        try:
            fcntl.ioctl(self._descriptor, termios.TIOCMBIS if on else termios.TIOCMBIC, OUT)
        except OSError:
            self._is_port = False
            try:
                os.write(self._descriptor, b"1" if on else b"0")
            except OSError:
                return

    def take(self, now_ns: int) -> Sequence[Order]:
        """Return the command of an edge on the line in."""
        if not (self._word and self._is_port):
            return ()
        try:
            lines = fcntl.ioctl(self._descriptor, termios.TIOCMGET, NOTHING)
        except OSError:
            return ()
        high = bool(struct.unpack("i", lines)[0] & termios.TIOCM_CTS)
        rose, self._was_high = high and not self._was_high, high
        return (Order(self._word, "", "trigger"),) if rose else ()

    def close(self) -> None:
        """Switch the output lines off, and release the port."""
        if self._descriptor >= 0:
            self.shows(on=False)
            os.close(self._descriptor)
            self._descriptor = -1
