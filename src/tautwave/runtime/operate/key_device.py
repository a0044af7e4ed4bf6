"""Keys of HID devices, foot pedals among them, as Linux reports them: its input events.

Source: linux/input.h. Works on `/dev/input/event*`, and on anything else
that the same bytes come from.
"""

from __future__ import annotations

import fcntl
import os
import struct
from collections.abc import Mapping, Sequence
from contextlib import suppress

from tautwave.errors import DriverError
from tautwave.runtime.operate.commands import Order

EVENT = struct.Struct("llHHi")
"""`struct input_event`: time in s and us, type, code, value."""

SYN, KEY = 0, 1
"""Types of event."""

DROPPED = 3
"""Code of a SYN event: the kernel's queue was full, and what is held is not known any more."""

RELEASED, PRESSED = 0, 1
"""Values of a KEY event; 2 repeats."""

GRAB = 0x40044590
"""EVIOCGRAB: no other program gets its keys, so a pedal types nothing into a terminal."""

MOST = 64
"""Events that are read at once."""


class KeyDevice:
    """A device whose keys give commands, and one of which may be a dead-man.

    Parameters
    ----------
    path : str
        Such as `/dev/input/by-id/usb-...-event-kbd`.
    words : mapping
        Commands by the code of their key.
    dead_man : int, optional
        Code of the key that has to be held.

    Raises
    ------
    DriverError
        The device cannot be opened.
    """

    def __init__(self, path: str, words: Mapping[int, str], dead_man: int | None = None) -> None:
        self.name = path
        self._words, self._dead_man = words, dead_man
        self._rest = b""
        self._held = False
        try:
            self._descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        except OSError as err:
            raise DriverError(
                f"key device {path}: {err.strerror}; plug it in, or give your user read access "
                "(group input)"
            ) from err
        with suppress(OSError):  # not an input device of the kernel's: nobody else listens to it
            fcntl.ioctl(self._descriptor, GRAB, 1)

    def held(self) -> bool:
        """Return whether the dead-man key is held, as far as is known; True without one."""
        return self._dead_man is None or self._held

    def take(self, now_ns: int) -> Sequence[Order]:
        """Return the commands of the keys that were pressed; a device that is gone holds none."""
        if self._descriptor < 0:
            return ()
        try:
            data = os.read(self._descriptor, MOST * EVENT.size)
        except BlockingIOError:
            return ()
        except OSError:
            data = b""
        if not data:
            self.close()
            return ()
        data = self._rest + data
        whole = len(data) - len(data) % EVENT.size
        self._rest = data[whole:]
        return [order for event in EVENT.iter_unpack(data[:whole]) for order in self._read(*event)]

    def _read(self, seconds: int, micros: int, kind: int, code: int, value: int) -> Sequence[Order]:
        if kind == SYN and code == DROPPED:
            self._held = False
        if kind != KEY:
            return ()
        if code == self._dead_man:
            self._held = value != RELEASED
        word = self._words.get(code) if value == PRESSED else None
        return () if word is None else (Order(word, "", "key device"),)

    def close(self) -> None:
        """Let go of the device; its dead-man counts as released."""
        self._held = False
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1
