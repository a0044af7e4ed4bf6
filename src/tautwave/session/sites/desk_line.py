"""The loop's line to its desk, `tautwave.sites.desk`: messages that are asked for, never waited."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

from tautwave.errors import LinkError
from tautwave.sites.control import Session
from tautwave.sites.desk import MAX_BYTES, Order

MAX_NOTES = 50
"""Of a session: anybody who reaches the port causes them."""
LONGEST_REASON = 2000
"""Characters of a reason, which has to fit into a message."""
DIED = "the session's process beside the loop has ended"


class Leaving(ABC):
    """What takes leave of the other site."""

    _gone = False

    @abstractmethod
    def send(self, **message: Any) -> None:
        """Hand the desk a message."""

    def leave(self, error: BaseException | None) -> None:
        """Tell the other site, once, that this run is over, or why it ended early.

        Anything that is not an `Exception` is a person who stopped it.
        """
        if not self._gone:
            self._gone = True
            why = str(error)[:LONGEST_REASON] or type(error).__name__
            self.send(send={"stops": why} if isinstance(error, Exception) else {"ended": True})


class DeskLine(Leaving):
    """A desk in a process of its own, for as long as the line is open."""

    def __init__(self, order: Order) -> None:
        self._line, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        command = [sys.executable, "-m", "tautwave.sites.desk", str(theirs.fileno())]
        # A separate session: Ctrl-C ends the run first, and the run takes leave of the other site.
        self._desk = subprocess.Popen(
            command, stdin=subprocess.PIPE, pass_fds=[theirs.fileno()], start_new_session=True
        )
        theirs.close()
        assert self._desk.stdin is not None
        with suppress(BrokenPipeError):
            self._desk.stdin.write(json.dumps(order._asdict()).encode())
            self._desk.stdin.close()
        self._desk.stdin = None
        self._line.setblocking(False)
        self._over = False

    def poll(self) -> Mapping[str, Any] | None:
        """Return the desk's next message, None if there is none."""
        if self._over:
            return None
        try:
            return self._next()
        except BlockingIOError:
            return None

    def send(self, **message: Any) -> None:
        """Hand the desk a message; one that it does not take now is lost."""
        with suppress(OSError):
            self._line.send(json.dumps(message).encode())

    def wait(self, peer: str, wait_s: float, tell: Callable[[str], None]) -> Session:
        """Return the first session; call `tell` with its status meanwhile.

        Raises
        ------
        LinkError
            The other site does not come, or refuses a session.
        """
        deadline = time.monotonic() + wait_s
        note = ""
        try:
            while (left := deadline - time.monotonic()) > 0.0:
                self._line.settimeout(left)
                with suppress(TimeoutError):
                    message = self._next()
                    if "joined" in message:
                        return session_of(message["joined"])
                    if "refused" in message:
                        raise LinkError(str(message["refused"]))
                    note = str(message.get("note", note))
                    tell(note)
        finally:
            self._line.setblocking(False)
        last = f"; {note}" if note else ""
        raise LinkError(f"{peer} did not connect within {wait_s:g} s{last}")

    def _next(self) -> Mapping[str, Any]:
        try:
            message = self._line.recv(MAX_BYTES)
        except ConnectionError:
            message = b""
        self._over = not message
        decoded: Mapping[str, Any] = json.loads(message) if message else {"refused": DIED}
        return decoded

    def close(self) -> None:
        """Take leave, and end the desk."""
        self.send(bye=True)
        self._line.close()
        try:
            self._desk.wait(2.0)
        except subprocess.TimeoutExpired:
            self._desk.kill()
            self._desk.wait()


def session_of(joined: Mapping[str, Any]) -> Session:
    """Return a session as the desk announced it."""
    return Session(
        bytes.fromhex(joined["session"]),
        bytes.fromhex(joined["secret"]),
        str(joined["peer"]),
        joined["facts"],
    )


def keep_note(session: dict[str, Any], note: str) -> None:
    """Keep a desk's note with what is known of a session, as long as there are few."""
    notes = session.setdefault("notes", [])
    if len(notes) < MAX_NOTES:
        notes.append(note)
