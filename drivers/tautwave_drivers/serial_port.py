"""A serial device as a `BytePort`: raw, exclusive, never blocking, any baud rate.

Linux: `termios2` with BOTHER (ioctl_tty(2), asm-generic/termbits.h) takes every rate, 4.5 Mbaud
included. A pseudo-terminal takes any rate and parity, and ignores them.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import struct
import termios
from typing import Literal

from tautwave.errors import DriverError

TCGETS2 = 0x802C542A
TCSETS2 = 0x402C542B
BOTHER = 0o010000
_TERMIOS2 = struct.Struct("4IB19s2I")  # iflag oflag cflag lflag line cc ispeed ospeed

CHUNK = 448
"""Bytes read at once: more than a response has, few enough to be allocated quickly."""

Parity = Literal["N", "E", "O"]
_PARITY = {"N": 0, "E": termios.PARENB, "O": termios.PARENB | termios.PARODD}
_NOTHING = bytes(4)

_GONE = {errno.EIO, errno.ENODEV, errno.ENXIO, errno.EBADF}


class SerialPort:
    """An open serial device.

    Parameters
    ----------
    path : str
        The device, e.g. /dev/ttyUSB0.
    baud : int
        Baud rate.
    parity : {'N', 'E', 'O'}
        None, even, odd.
    stop_bits : int
        1 or 2.

    Raises
    ------
    DriverError
        It does not exist, is not permitted, in use, or not a serial device.
    """

    def __init__(self, path: str, baud: int, parity: Parity = "N", stop_bits: int = 1) -> None:
        self.path = path
        self._character = termios.CS8 | _PARITY[parity] | (stop_bits == 2) * termios.CSTOPB
        self._count = bytearray(4)
        try:
            self._fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError as err:
            raise DriverError(_no_port(path, err)) from err
        try:
            # As pyserial does with `exclusive`: also among programs of root, whom TIOCEXCL lets in.
            fcntl.flock(self._fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as err:
            os.close(self._fd)
            raise DriverError(_no_port(path, err)) from err
        try:
            fcntl.ioctl(self._fd, termios.TIOCEXCL)
            self.set_baud(baud)
        except OSError as err:
            os.close(self._fd)
            raise DriverError(
                f"{path}: is not a serial device that takes {baud} baud: {err}"
            ) from err

    def fileno(self) -> int:
        """Return the file descriptor, for `Clock.wait`."""
        return self._fd

    def set_baud(self, baud: int) -> None:
        """Make the line raw, 8 data bits, at `baud`; drop what has come."""
        packed = fcntl.ioctl(self._fd, TCGETS2, bytes(_TERMIOS2.size))
        line, given = _TERMIOS2.unpack(packed)[4:6]
        cc = bytearray(given)
        # A read without data has to fail with EAGAIN, not look like a closed line.
        cc[termios.VMIN], cc[termios.VTIME] = 1, 0
        cflag = self._character | termios.CREAD | termios.CLOCAL | BOTHER
        packed = _TERMIOS2.pack(0, 0, cflag, 0, line, bytes(cc), baud, baud)
        fcntl.ioctl(self._fd, TCSETS2, packed)
        termios.tcflush(self._fd, termios.TCIOFLUSH)

    def write(self, data: bytes) -> None:
        """Hand bytes to the line; what its buffer has no room for is dropped."""
        try:
            os.write(self._fd, data)
        except BlockingIOError:
            pass
        except OSError as err:
            raise DriverError(self._lost(err)) from err

    def read(self) -> bytes:
        """Return all that has come, at once."""
        data = b""
        try:
            data = os.read(self._fd, CHUNK)
            while len(data) % CHUNK == 0 and data:
                data += os.read(self._fd, CHUNK)
        except BlockingIOError:
            return data
        except OSError as err:
            raise DriverError(self._lost(err)) from err
        if not data:
            raise DriverError(
                f"{self.path}: unplugged, or its other end closed, or another program reads the "
                "same line; plug it in, or end that program, and run again"
            )
        return data

    def waiting(self) -> bool:
        """Return whether `read` would return data or raise; a third of its cost."""
        try:
            fcntl.ioctl(self._fd, termios.FIONREAD, self._count)
        except (OSError, ValueError):  # unplugged; closed
            return True
        return self._count != _NOTHING

    def close(self) -> None:
        """Release the device; idempotent."""
        fd, self._fd = self._fd, -1
        if fd >= 0:
            with contextlib.suppress(OSError):
                os.close(fd)

    def _lost(self, err: OSError) -> str:
        if err.errno in _GONE:
            why = f"the adapter was disconnected ({err.strerror})"
            return f"{self.path}: {why}; plug it in and run again"
        return f"{self.path}: {err.strerror}"


def _no_port(path: str, err: OSError) -> str:
    if err.errno == errno.ENOENT:
        return f"{path}: no such device; plug in the adapter, or correct its path"
    if err.errno == errno.EACCES:
        return (
            f"{path}: permission denied; add yourself to its group: sudo usermod -aG dialout $USER"
        )
    if err.errno in (errno.EBUSY, errno.EAGAIN):
        return (
            f"{path}: another program has it open, or another bus of this rig; close that "
            "program, or list all devices of a line on one bus"
        )
    return f"{path}: cannot be opened: {err.strerror}"
