"""A run that is only its rows, and a server of its viewers in a thread, for raw clients."""

from __future__ import annotations

import asyncio
import queue
import socket
import ssl
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from websockets.sync.client import ClientConnection, connect

from tautwave.runtime.operate.mailbox import Mailbox
from tautwave.runtime.recorder import Recorder
from tautwave.sites.certificates import make_authority
from tautwave.view.guard import Door, open_door
from tautwave.view.server import Server

BENCH = Path(__file__).parents[2] / "configs" / "bench-1dof-loopback.yaml"
COLUMNS = ("time_s", "lateness_us", "skipped_slots", "lever.position_error", "operation.state")
CERTIFICATE = {"passed": True, "state": "passed", "require": "passive", "sentences": []}


class Run:
    """A recording into a directory, whose rows the test commits."""

    recorder_epoch_ns = 1_000_000_000

    def __init__(
        self,
        directory: Path,
        rig: str | None = None,
        columns: Sequence[str] = COLUMNS,
        **facts: Any,
    ) -> None:
        self.directory = directory
        (directory / "rig.yaml").write_text(rig or BENCH.read_text())
        self.mailbox = Mailbox()
        live = {"rig": "bench", "pid": 0, "units": {"lever": "rad"}, "certificate": CERTIFICATE,
                "mailbox": self.mailbox.address, **facts}  # fmt: skip
        self.recorder = Recorder(
            directory / "recording.mcap", columns, metadata={}, attachments={}, rows=256,
            lossless=True, rate_hz=1000.0, live=live, epoch_ns=self.recorder_epoch_ns,
        )  # fmt: skip
        self.recorder.start()
        self.rows = 0

    def commit(self, count: int) -> None:
        for _ in range(count):
            self.recorder.row[0] = 1e-3 * self.rows
            self.recorder.row[3] = self.rows
            self.recorder.commit()
            self.rows += 1

    def orders(self) -> list[tuple[str, str, str]]:
        return [tuple(order) for order in self.mailbox.source.take(0)]  # type: ignore[misc]

    def close(self) -> None:
        assert self.recorder.close().rows_dropped == 0
        self.mailbox.close()


@contextmanager
def served(
    directory: Path,
    rig: str | None = None,
    *,
    plain: bool = False,
    door: Door | None = None,
    **facts: Any,
) -> Iterator[tuple[Run, Door]]:
    """Serve a run's viewers, with Foxglove's unless `plain`; both end with the block."""
    run = Run(directory, rig, **facts)
    urls: queue.Queue[str] = queue.Queue()
    door = door or Door("127.0.0.1", 0, None, "secret-token")
    more: dict[str, Any] = {} if plain else {"foxglove": True}
    server = Server(directory, door, urls.put, **more)
    thread = threading.Thread(target=lambda: asyncio.run(server.serve()))
    thread.start()
    try:
        urls.get(timeout=60)
        yield run, server.door
    finally:
        run.close()
        thread.join(60)
    assert not thread.is_alive()


def ask(door: Door, text: str) -> str:
    """Send a request as it is, and return the whole response."""
    with socket.create_connection((door.address, door.port), timeout=60) as raw:
        raw.sendall(text.encode())
        found = b""
        while data := raw.recv(65536):
            found += data
    return found.decode("utf-8", "replace")


class Elsewhere(Door):
    """A door that other machines reach, as far as the server knows."""

    local = False  # type: ignore[assignment]


def elsewhere(keys: Path) -> tuple[Door, ssl.SSLContext]:
    """Return such a door, with new keys, and what a viewer who knows its certificate speaks."""
    make_authority(keys, ["page", "other"])
    opened = open_door("127.0.0.1", 0, keys / "page.pem", keys / "page.key")
    # The client reads in a thread while it writes in another, and Python 3.11 does not lock the TLS
    # object between them: a ticket of TLS 1.3 that came with its first request spoilt one in six.
    assert opened.tls is not None
    opened.tls.num_tickets = 0
    context = ssl.create_default_context(cafile=str(keys / "authority.pem"))
    context.check_hostname = False
    return Elsewhere(*opened._replace(token="secret-token")), context


def knock(door: Door, context: ssl.SSLContext, **more: Any) -> ClientConnection:
    """Open a page's socket by TLS."""
    where = f"127.0.0.1:{door.port}"
    return connect(
        f"wss://{where}/live",
        origin=f"https://{where}",  # type: ignore[arg-type]
        ssl=context,
        compression=None,
        ping_interval=None,
        **more,
    )
