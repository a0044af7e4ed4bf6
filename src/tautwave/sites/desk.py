"""The process beside the loop that finds the other site, agrees on a session, and sees it leave.

`python -m tautwave.sites.desk FD < ORDER.json`: FD is one end of a pair of local sockets, on which
every packet is one message of JSON. To the loop: `joined` (a session), `lost` (why), `peer` (a
message of the other loop), `note` (a sentence for people), `refused` (there is no use in waiting).
From it: `send` (a message for the other loop), `renew` (why the session `of` an id ends), `bye`.
The loop never waits for any of it, and what comes over its own UDP socket does not pass here.
"""

from __future__ import annotations

import json
import queue
import select
import socket
import ssl
import sys
import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from tautwave.errors import LinkError, TautwaveError
from tautwave.sites.certificates import identity_files
from tautwave.sites.control import (
    AGAIN_S,
    Channel,
    Meeting,
    RefusedError,
    client_context,
    dial,
    meeting,
    server_context,
)
from tautwave.sites.reception import Outcome, Reasons, Reception, serve_at

BEAT_S = 0.25
SILENT_S = 1.0
"""A site not heard for so long may be replaced by one that dials with its certificate [s]."""
GONE_S = 5.0
"""A site silent for this long counts as lost [s]."""
MAX_BYTES = 65536


class Order(NamedTuple):
    """Order to this process; `keys` is a directory, `shared` and `facts` as for `meeting`."""

    site: str
    peer: str
    serves: bool
    host: str
    port: int
    keys: str
    shared: Mapping[str, Any]
    facts: Mapping[str, Any]


class SessionProcess:
    """One site's part in finding and keeping the other one."""

    def __init__(self, order: Order, local: socket.socket) -> None:
        self._order = order
        self._local = local
        self._files = identity_files(Path(order.keys), order.site)
        self._done: queue.SimpleQueue[Outcome] = queue.SimpleQueue()
        self._wake, self._woken = socket.socketpair()
        self._wake.setblocking(False)
        self._channel: Channel | None = None
        self._session = ""
        self._heard = self._looked = 0.0
        self._dialling = False
        self._dial_at = 0.0
        self._reasons = Reasons()

    def run(self) -> None:
        """Work until the loop says `bye` or its process has ended."""
        order = self._order
        if not order.serves:
            self._work(client_context(self._files))
            return
        with serve_at(order.host, order.port) as listener:
            self._serve(listener)

    def _serve(self, listener: socket.socket) -> None:
        order, context = self._order, server_context(self._files)

        def meet(connection: socket.socket) -> Meeting:
            return meeting(connection, context, order.peer, order.shared, order.facts, self._taken)

        with Reception(listener, meet, self._done_with):
            self._work(None)

    def _work(self, context: ssl.SSLContext | None) -> None:
        """Keep what there is of a session; dial for one where there is a context for that."""
        beat = 0.0
        while True:
            now = time.monotonic()
            self.look(now)
            idle = self._channel is None and not self._dialling
            if context is not None and idle and now >= self._dial_at:
                self._dial(context)
            if self._channel is not None and now >= beat:
                beat = now + BEAT_S
                self._say({"beat": True})
            if self._channel is not None and now - self._heard > GONE_S:
                self._drop(f"{self._order.peer} was silent for {GONE_S:g} s")
            waiting: list[Any] = [self._local, self._woken]
            waiting += [self._channel] if self._channel is not None else []
            ready, _, _ = select.select(waiting, [], [], 0.5 * BEAT_S)
            if self._woken in ready:
                self._woken.recv(64)
                self._arrive()
            if self._channel is not None and self._channel in ready:
                self._hear()
            if self._local in ready and not self._obey():
                return

    def look(self, now: float) -> None:
        """Note the time [s]: while this process was suspended, the other site was not silent."""
        away, self._looked = now - self._looked, now
        if away > 2.0 * BEAT_S:
            self._heard += away

    # -- the other site ---------------------------------------------------------------------

    def _taken(self) -> str:
        """Return why no site can join at present."""
        if self._channel is None or self._looked - self._heard > SILENT_S:
            return ""
        return f"{self._order.peer} is already in a session here"

    def _dial(self, context: ssl.SSLContext) -> None:
        """Dial in a thread of its own: a slow answer holds up nothing."""
        order = self._order
        self._dialling = True

        def work() -> None:
            outcome: Outcome
            try:
                where = (order.host, order.port)
                outcome = dial(where, context, order.peer, order.shared, order.facts)
            except LinkError as err:
                outcome = err
            except OSError as err:
                outcome = LinkError(f"connection lost ({err.strerror or err})")
            self._done_with(outcome)

        threading.Thread(target=work, daemon=True).start()

    def _done_with(self, outcome: Outcome) -> None:
        """Hand over the outcome of a handshake; called in other threads."""
        self._done.put(outcome)
        with suppress(OSError):
            self._wake.send(b"!")

    def _arrive(self) -> None:
        """Process the outcomes of handshakes."""
        while True:
            try:
                outcome = self._done.get_nowait()
            except queue.Empty:
                return
            self._dialling = False
            if isinstance(outcome, LinkError):
                self._dial_at = time.monotonic() + AGAIN_S
                final = isinstance(outcome, RefusedError) and not self._order.serves
                if self._reasons.is_news(outcome) or final:
                    self._tell("refused" if final else "note", str(outcome))
                continue
            if self._channel is not None:
                self._drop(f"{self._order.peer} rejoined")
            self._channel, session = outcome
            self._session = session.id.hex()
            self._heard = time.monotonic()
            self._reasons = Reasons()
            self._tell("joined", {
                "session": session.id.hex(), "secret": session.secret.hex(),
                "peer": session.peer, "facts": dict(session.facts),
            })  # fmt: skip

    def _hear(self) -> None:
        try:
            while self._channel is not None and (message := self._channel.poll()) is not None:
                self._heard = time.monotonic()
                if "peer" in message:
                    self._tell("peer", message["peer"])
        except LinkError as err:
            self._drop(str(err))

    def _say(self, message: Mapping[str, Any]) -> None:
        if self._channel is None:
            return
        try:
            self._channel.send(message)
        except LinkError as err:
            self._drop(str(err))

    def _drop(self, why: str) -> None:
        if self._channel is not None:
            self._channel.close()
            self._channel = None
            self._dial_at = 0.0
            self._tell("lost", why)

    # -- the loop ---------------------------------------------------------------------------

    def _tell(self, kind: str, what: Any) -> None:
        message = json.dumps({kind: what}).encode()
        if len(message) > MAX_BYTES:  # of which the loop would get a part
            note = f"{self._order.peer} sent an oversized message"
            message = json.dumps({"note": note}).encode()
        with suppress(OSError):
            self._local.send(message)

    def _obey(self) -> bool:
        """Do what the loop says; return False where that was the last."""
        try:
            order = self._local.recv(MAX_BYTES)
        except OSError:
            order = b""
        if not order:
            self._say({"peer": {"left": "its program ended"}})
            self._close()
            return False
        message = json.loads(order)
        if "send" in message:
            self._say({"peer": message["send"]})
        renews = "renew" in message and message.get("of", self._session) == self._session
        if renews:
            self._say({"peer": {"left": message["renew"]}})
        if renews and self._channel is not None:
            self._channel.close()
            self._channel = None
            self._tell("lost", message["renew"])
        if "bye" in message:
            self._close()
            return False
        return True

    def _close(self) -> None:
        if self._channel is not None:
            self._channel.close()


def main() -> int:
    """Serve the process whose socket is argv[1]; its order comes on stdin."""
    local = socket.socket(fileno=int(sys.argv[1]))
    try:
        SessionProcess(Order(**json.load(sys.stdin)), local).run()
    except TautwaveError as err:
        with suppress(OSError):
            local.send(json.dumps({"refused": str(err)}).encode())
        return err.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main())
