"""A pseudo-terminal as the host's end of a serial line: other software opens it by its path."""

from __future__ import annotations

import contextlib
import fcntl
import os
import struct
import termios
import tty
from collections.abc import Callable
from pathlib import Path

from tautwave.clock import MonotonicClock
from tautwave.errors import DriverError
from tautwave_sim.wire.serial import SerialLine

TCGETS2 = 0x802C542A  # asm-generic/ioctls.h: struct termios2, whose speeds are plain numbers
TERMIOS2 = 44
SPEEDS_AT = 36
PTS = "/dev/pts/"
IDLE_NS = 100_000_000
READ = 4096


class Pty:
    """A pseudo-terminal in raw mode; the other end is `path`.

    Raises
    ------
    DriverError
        The system has no more of them.
    """

    def __init__(self) -> None:
        try:
            self._master, self._slave = os.openpty()
        except OSError as err:
            raise DriverError(f"no pseudo-terminal: {err.strerror}; close some programs") from err
        # Held open: without a slave the master is always "ready", which would spin.
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.path = os.ttyname(self._slave)

    def fileno(self) -> int:
        """Return the descriptor to wait on."""
        return self._master

    def baud(self) -> int:
        """Return the baud rate that the program at `path` has set."""
        settings = bytearray(TERMIOS2)
        fcntl.ioctl(self._master, TCGETS2, settings)
        return int(struct.unpack_from("=II", settings, SPEEDS_AT)[1])

    def share(self) -> None:
        """Let others open `path` again: the slave held here would keep TIOCEXCL indefinitely."""
        fcntl.ioctl(self._slave, termios.TIOCNXCL)

    def read(self) -> bytes:
        """Return what was written to `path`; nothing if there is nothing."""
        try:
            return os.read(self._master, READ)
        except OSError:
            return b""

    def write(self, data: bytes) -> None:
        """Make bytes readable at `path`; what a full buffer does not hold is lost, as on a UART."""
        with contextlib.suppress(OSError):
            os.write(self._master, data)

    def close(self) -> None:
        """Close both ends; a program with `path` open gets an error, as of an unplugged adapter."""
        for fd in (self._master, self._slave):
            with contextlib.suppress(OSError):
                os.close(fd)


def serve_line(
    line: SerialLine,
    announce: Callable[[str], None],
    stopped: Callable[[], bool],
    link: Path | None = None,
    clock: MonotonicClock | None = None,
) -> None:
    """Serve a line on a pseudo-terminal until `stopped()`.

    Parameters
    ----------
    announce : callable
        Called once with the path to open.
    link : Path, optional
        A symbolic link that is kept pointing to the path; it is then announced instead, and stays
        the same when the line is unplugged and plugged in again.

    Raises
    ------
    DriverError
        There are no more pseudo-terminals, or the link cannot be made.
    """
    clock = clock if clock is not None else MonotonicClock()
    first = Pty()
    pty: Pty | None = first
    path = first.path
    try:
        if link is not None:
            _point(link, path)
        announce(str(link) if link is not None else path)
        while not stopped():
            now_ns = clock.now_ns()
            line.advance(now_ns)
            if pty is not None and not line.plugged:
                pty.close()
                pty = None
            elif pty is None and line.plugged:
                pty = Pty()
                path = pty.path
                if link is not None:
                    _point(link, path)
            event_ns = line.next_event_ns()
            deadline_ns = now_ns + IDLE_NS
            if event_ns is not None:
                deadline_ns = min(deadline_ns, event_ns)
            if pty is None:
                clock.sleep_until(deadline_ns)
                continue
            if line.readable():
                pty.write(line.take())
            pty.share()
            if clock.wait(pty, deadline_ns):
                line.baud = pty.baud()
                line.host_write(pty.read(), clock.now_ns())
    finally:
        if pty is not None:
            pty.close()
        if link is not None and _target(link) == path:
            link.unlink(missing_ok=True)


def _point(link: Path, path: str) -> None:
    """Make `link` point to a pseudo-terminal; nothing but a link to another one is replaced."""
    target = _target(link)
    if not target.startswith(PTS) and os.path.lexists(link):
        what = f"is a link to {target}" if target else "is not a symbolic link"
        raise DriverError(f"{link}: already exists and {what}; choose another name")
    fresh = link.with_name(f".{link.name}.{os.getpid()}")
    try:
        fresh.symlink_to(path)
        fresh.replace(link)
    except OSError as err:
        raise DriverError(f"{link}: no link can be made there: {err.strerror}") from err


def _target(link: Path) -> str:
    try:
        return os.readlink(link)
    except OSError:
        return ""
