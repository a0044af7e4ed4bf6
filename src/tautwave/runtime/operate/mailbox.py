"""A pipe into a run: other processes of the same user send it commands, one a line.

A program that passes on a person's dead-man says `held` for as long as it is held. The run itself
notices when it stops, so that the program may be killed.

The run holds both ends, so it never sees an end of file; who sends opens the writing end through
the run's descriptors, as a tap opens its ring. A line is at most `LONGEST` bytes, which a pipe
takes whole or not at all.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import suppress
from typing import Any, Self

from tautwave.errors import RecordingError
from tautwave.runtime.operate.commands import LONGEST, Descriptor, Lines, Order, Source

HELD, LOOSE = "held", "loose"
HELD_NS = 450_000_000
"""How long one `held` counts: with a look at the mailbox every 20 ms, half a second at most."""


class Kept:
    """Commands, and the dead-man of a program that says `held`, and has to go on repeating it.

    With `loose`, or without a `held` for `HELD_NS`, the dead-man is released until the next look;
    after that it is forgotten, so that others may engage.

    Parameters
    ----------
    source : Source
        Of the commands.
    """

    def __init__(self, source: Source) -> None:
        self.name = ""
        self._source = source
        self._until_ns = -1
        self._held = True

    def held(self) -> bool:
        """Return whether it was held without a break since the last check."""
        return self._held

    def take(self, now_ns: int) -> Sequence[Order]:
        """Return the commands that have come; `held` and `loose` are none."""
        self._held = True
        orders = []
        for order in self._source.take(now_ns):
            if order.word == HELD:
                self._until_ns, self.name = now_ns + HELD_NS, order.source
            elif order.word == LOOSE:
                self._until_ns = min(self._until_ns, now_ns)
            else:
                orders.append(order)
        if 0 <= self._until_ns <= now_ns:
            self._until_ns, self._held = -1, False
        return orders


class Mailbox:
    """The run's end; `source` is what its controller looks into."""

    def __init__(self) -> None:
        self._read, self._write = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
        self.source = Kept(Descriptor(self._read, Lines()))

    @property
    def address(self) -> dict[str, int]:
        """Where it is, for `live.json`."""
        return {"pid": os.getpid(), "descriptor": self._write}

    def close(self) -> None:
        """Close it; later senders get an error."""
        for descriptor in (self._read, self._write):
            with suppress(OSError):
                os.close(descriptor)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.close()


def send(address: dict[str, Any], source: str, line: str) -> None:
    """Send a run one command.

    Raises
    ------
    RecordingError
        The run has ended, belongs to another user, or does not take commands now.
    """
    path = f"/proc/{address['pid']}/fd/{address['descriptor']}"
    data = f"{source} {' '.join(line.split())}\n".encode()
    if len(data) > LONGEST:
        raise RecordingError(f"a command has at most {LONGEST} bytes (got {len(data)})")
    try:
        if not os.readlink(path).startswith("pipe:"):
            raise RecordingError("the run has ended")
        descriptor = os.open(path, os.O_WRONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        raise RecordingError(f"the run has ended or belongs to another user ({error})") from error
    try:
        os.write(descriptor, data)
    except BlockingIOError as error:
        raise RecordingError("the run accepts no commands now: too many are queued") from error
    finally:
        os.close(descriptor)
