"""One viewer: what it is sent, and what it may ask for."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any, Protocol

from websockets.asyncio.server import ServerConnection, broadcast

from tautwave.config import Rig
from tautwave.config.guard import parse_json
from tautwave.errors import TautwaveError
from tautwave.view.drawn import Drawn
from tautwave.view.facts import facts_of
from tautwave.view.so_far import SoFar
from tautwave.view.watched import Watched

MAX_WAITING = 4 << 20
"""[bytes] That a viewer has not taken; beyond it rows are left out for that one, and counted."""

ROWS = struct.Struct("<dd")
"""Before rows of float64: the number of the first, and how many this viewer has not got."""


class Hub(Protocol):
    """What viewers find at the server: the run, its newest row, what happened, the ways to it."""

    run: Watched | None
    rig: Rig | None
    newest: Sequence[float]
    news: list[Any]
    so_far: SoFar | None
    drawn: Drawn | None

    def knows(self, token: object) -> bool:
        """Return whether that is the token."""

    def command(self, may: bool, source: str, line: str) -> None:
        """Give the run a command; raises a TautwaveError where that is refused."""

    def point(self, may: bool, places: object) -> None:
        """Lead hands to places, or let them go; raises a TautwaveError where that is refused."""

    async def change(self, may: bool, values: object) -> str:
        """Certify a change and hand it over; raises a TautwaveError where that is refused."""


class Viewer:
    """One page that is open somewhere."""

    def __init__(self, socket: ServerConnection, hub: Hub) -> None:
        self.socket = socket
        self.hub = hub
        self.may = False  # command and tune, not only look and stop
        self.greeted = False
        self.left_out = 0

    # -- to it --------------------------------------------------------------------------------

    def greet(self) -> None:
        """Say what the rows mean."""
        assert self.hub.run is not None
        assert self.hub.rig is not None
        assert self.hub.so_far is not None
        assert self.hub.drawn is not None
        facts = facts_of(self.hub.run.live, self.hub.rig)
        self.tell("hello", **facts, arms=self.hub.drawn.facts(), may=self.may)
        self.tell("so_far", kinds=self.hub.so_far.kinds(), **self.hub.so_far.facts())
        self.greeted = True

    def offer(self, first: int, count: int, missed: int, rows: bytes) -> None:
        """Send rows without waiting, unless too much is waiting already."""
        if self.socket.transport.get_write_buffer_size() > MAX_WAITING:
            self.left_out += count
            return
        self.send_rows(first, missed + self.left_out, rows)

    def show(self, arms: Sequence[Mapping[str, Any]]) -> None:
        """Say where the arms are; left out for one that does not take its rows."""
        if self.socket.transport.get_write_buffer_size() <= MAX_WAITING:
            self.tell("drawn", arms=arms)

    def send_rows(self, first: int, missed: int, rows: bytes) -> None:
        """Send rows of float64, and how many it has not got."""
        self.send(ROWS.pack(first, missed) + rows)

    def tell(self, op: str, **fields: Any) -> None:
        """Send an object."""
        self.send(json.dumps({"op": op, **fields}))

    def tell_refused(self, text: str) -> None:
        """Say why something is not done."""
        self.tell("note", kind="refused", text=text)

    def send(self, message: str | bytes) -> None:
        """Send without waiting; who has gone gets nothing."""
        broadcast([self.socket], message)

    def tuned(self) -> None:
        """Somebody has changed something; a page sees it in the rows."""

    # -- from it ------------------------------------------------------------------------------

    def introduce(self, message: str | bytes) -> None:
        """Look whether it has the token."""
        fields = fields_of(message)
        self.may = fields.get("op") == "hello" and self.hub.knows(fields.get("token"))

    async def hear(self, message: str | bytes) -> None:
        """Do what it asks for, or say why not."""
        fields = fields_of(message)
        try:
            match fields.get("op"):
                case "hello":
                    self.introduce(message)
                    self.tell("may", may=self.may)
                case "command":
                    self.hub.command(self.may, "page", str(fields.get("line", "")))
                case "pointer":
                    self.hub.point(self.may, fields.get("places"))
                case "tune":
                    self.tell("note", kind="", text="certifying ...")
                    text = await self.hub.change(self.may, fields.get("values"))
                    self.tell("tuned", text=f"certified: {text}")
                case _:
                    self.tell_refused("there is no such request")
        except TautwaveError as error:
            self.tell_refused(str(error))


def fields_of(message: str | bytes) -> Mapping[str, Any]:
    """Return the object of a message, {} if it is none."""
    with suppress(ValueError, RecursionError):
        fields = parse_json(message) if isinstance(message, str) else None
        if isinstance(fields, dict):
            json.dumps(fields, ensure_ascii=False).encode()  # half a character is no text
            return fields
    return {}
