"""Foxglove's websocket protocol, for Foxglove, Lichtblick and PlotJuggler.

Source: foxglove/ws-protocol, docs/spec.md (`foxglove.websocket.v1`; `foxglove.sdk.v1` is the same
for what is used here). One channel has every row as a ROS 2 message, as the recording has; knobs
are parameters, commands are services. Who may look is decided by the server; for the rest the
address has to end in `?token=`.
"""

from __future__ import annotations

import asyncio
import json
import struct
from collections.abc import Mapping, Sequence
from typing import Any
from urllib.parse import parse_qs, urlsplit

from websockets.asyncio.server import ServerConnection

from tautwave.errors import TautwaveError
from tautwave.runtime.mcap_schema import CDR_HEADER, SCHEMA_NAME, TOPIC, message_layout
from tautwave.runtime.operate.commands import EPISODE
from tautwave.runtime.operate.states import SCALE, STOP
from tautwave.runtime.tuning.desk import last_left
from tautwave.view.facts import commands_of
from tautwave.view.viewers import Hub, Viewer, fields_of

SUBPROTOCOLS = ("foxglove.sdk.v1", "foxglove.websocket.v1")
SOURCE = "foxglove"
CHANNEL = 1
ERROR = 2
MAX_SUBSCRIPTIONS = 16
"""Of one socket, all to the one channel: each brings every row again."""
MESSAGE = struct.Struct("<BIQ")  # opcode 1, subscription, time [ns]
CALL = struct.Struct("<BIII")  # opcode 2 (3 for the response), service, call, length of encoding
ENCODING = b"json"
ANSWER_S, LOOK_S = 2.0, 0.03
"""The loop looks at commands 50 times a second, and the server at its journal 30 times."""

EMPTY = {"type": "object"}
ASKED = {
    EPISODE: {
        "type": "object",
        "properties": {"name": {"type": "string"}, "task": {"type": "string"}},
    },
    SCALE: {"type": "object", "properties": {"scale": {"type": "number"}}},
}
"""What a command's request has, by its word."""
ANSWER = {
    "type": "object",
    "properties": {"success": {"type": "boolean"}, "message": {"type": "string"}},
}


class FoxgloveViewer(Viewer):
    """One client of the protocol."""

    def __init__(self, socket: ServerConnection, hub: Hub) -> None:
        super().__init__(socket, hub)
        request = socket.request
        query = parse_qs(urlsplit(request.path).query if request is not None else "")
        self.may = hub.knows(query.get("token", [""])[0])
        self._subscriptions: set[int] = set()
        self._order: Sequence[int] | None = None
        self._watches = False

    # -- to it --------------------------------------------------------------------------------

    def greet(self) -> None:
        """Say what there is: one channel, the services, what the server can do."""
        run = self.hub.run
        assert run is not None
        columns = run.live.columns
        layout = message_layout(columns)
        self._order = None if layout.order == tuple(range(len(columns))) else layout.order
        can = ["services", *(["parameters", "parametersSubscribe"] if self._knobs() else [])]
        name = f"tautwave: {run.facts.get('rig', '')}"
        self.tell("serverInfo", name=name, capabilities=can, supportedEncodings=["json"],
                  sessionId=str(run.live.pid))  # fmt: skip
        channel = {"id": CHANNEL, "topic": TOPIC, "encoding": "cdr", "schemaName": SCHEMA_NAME,
                   "schemaEncoding": "ros2msg", "schema": layout.definition}  # fmt: skip
        self.tell("advertise", channels=[channel])
        self.tell("advertiseServices", services=[*map(self._service, range(len(self._words())))])
        self.greeted = True

    def offer(self, first: int, count: int, missed: int, rows: bytes) -> None:
        """Send rows to those who asked for them."""
        if self._subscriptions:
            super().offer(first, count, missed, rows)

    def send_rows(self, first: int, missed: int, rows: bytes) -> None:
        """Send each row as a message of its own, as the protocol has it."""
        run = self.hub.run
        assert run is not None
        width = 8 * len(run.live.columns)
        at = run.live.columns.index("time_s")
        epoch_ns = run.tap.epoch_ns
        for start in range(0, len(rows), width):
            row = rows[start : start + width]
            values = memoryview(row).cast("d")
            time_ns = epoch_ns + round(1e9 * values[at])
            if self._order is not None:
                row = struct.pack(f"<{len(self._order)}d", *[values[k] for k in self._order])
            for subscription in self._subscriptions:
                self.send(MESSAGE.pack(1, subscription, time_ns) + CDR_HEADER + row)

    def tell(self, op: str, **fields: Any) -> None:
        """Send an object; what is meant for pages becomes a status, or nothing."""
        if op in ("so_far", "drawn", "ended", "sound"):
            return
        super().tell(op, **fields)

    def tell_refused(self, text: str) -> None:
        """Say why something is not done."""
        self.tell("status", level=ERROR, message=text)

    def tell_parameters(self, names: Sequence[str] = (), number: object = None) -> None:
        """Send the values of parameters as they are; all without names."""
        run, knobs = self.hub.run, self._knobs()
        assert run is not None
        left = last_left(run.facts["tuning"]["desk"], len(knobs)) if knobs else None
        values = left or [knob["value"] for knob in knobs]
        parameters = [
            {"name": knob["path"], "type": "float64", "value": value}
            for knob, value in zip(knobs, values, strict=True)
            if not names or knob["path"] in names
        ]
        extra = {"id": number} if isinstance(number, str) else {}
        self.tell("parameterValues", parameters=parameters, **extra)

    # -- from it ------------------------------------------------------------------------------

    async def hear(self, message: str | bytes) -> None:
        """Do what it asks for, or say why not."""
        if isinstance(message, bytes):
            await self._call(message)
            return
        if self.hub.run is None:
            self.tell_refused("the run has not begun")
            return
        fields = fields_of(message)
        match fields.get("op"):
            case "subscribe":
                self._subscribe(_objects(fields.get("subscriptions")))
            case "unsubscribe":
                wanted = fields.get("subscriptionIds")
                self._subscriptions -= set(filter(_is_number, _list(wanted)))
            case "getParameters":
                self.tell_parameters(_words(fields.get("parameterNames")), fields.get("id"))
            case "setParameters":
                await self._set(_objects(fields.get("parameters")), fields.get("id"))
            case "subscribeParameterUpdates":
                self._watches = True
            case "unsubscribeParameterUpdates":
                self._watches = False
            case _:
                self.tell_refused("there is no such request")

    def _subscribe(self, asked: Sequence[Mapping[str, Any]]) -> None:
        wanted = {
            one["id"]
            for one in asked
            if one.get("channelId") == CHANNEL and _is_number(one.get("id"))
        }
        if len(self._subscriptions | wanted) > MAX_SUBSCRIPTIONS:
            self.tell_refused(f"at most {MAX_SUBSCRIPTIONS} subscriptions: there is one channel")
            return
        self._subscriptions |= wanted

    def tuned(self) -> None:
        """Send it all parameters, if it watches them."""
        if self._watches:
            self.tell_parameters()

    async def _set(self, parameters: Sequence[Mapping[str, Any]], number: object) -> None:
        values = {str(one.get("name")): one.get("value") for one in parameters}
        try:
            await self.hub.change(self.may, values)
        except TautwaveError as error:
            self.tell_refused(str(error))
        self.tell_parameters(list(values), number)

    async def _call(self, message: bytes) -> None:
        """Call a service: a command, and what the run's journal says of it."""
        if len(message) < CALL.size or message[0] != 2:
            self.tell_refused("not a service call")
            return
        _, service, call, length = CALL.unpack_from(message)
        words = self._words()
        if not service < len(words):
            self.tell(
                "serviceCallFailure", serviceId=service, callId=call, message="no such service"
            )
            return
        body = message[CALL.size + length :].decode("utf-8", "replace")
        answer = await self._command(words[service], fields_of(body))
        self.send(
            CALL.pack(3, service, call, len(ENCODING)) + ENCODING + json.dumps(answer).encode()
        )

    async def _command(self, word: str, fields: Mapping[str, Any]) -> dict[str, Any]:
        keys = ASKED.get(word, {}).get("properties", {})
        line = " ".join([word, *(str(fields.get(key, "")) for key in keys)])
        before = max((number for number, _ in self.hub.news), default=0)
        try:
            self.hub.command(self.may, SOURCE, line)
        except TautwaveError as error:
            return {"success": False, "message": str(error)}
        for _ in range(round(ANSWER_S / LOOK_S)):
            await asyncio.sleep(LOOK_S)
            for number, entry in self.hub.news:
                if number > before and (entry["word"], entry["source"]) == (word, SOURCE):
                    text = entry["text"] or entry["state"]
                    return {"success": not entry["refused"], "message": text}
        return {"success": word == STOP, "message": "handed over"}

    # -- what there is ------------------------------------------------------------------------

    def _words(self) -> list[str]:
        run, rig = self.hub.run, self.hub.rig
        return [STOP] if run is None or rig is None else commands_of(run.live, rig)

    def _service(self, number: int) -> dict[str, Any]:
        word = self._words()[number]
        asks = ASKED.get(word, EMPTY)
        form = {"encoding": "json", "schemaEncoding": "jsonschema"}
        return {
            "id": number,
            "name": f"/{word}",
            "type": "tautwave/command",
            "request": {**form, "schemaName": f"{word}_request", "schema": json.dumps(asks)},
            "response": {**form, "schemaName": f"{word}_response", "schema": json.dumps(ANSWER)},
        }

    def _knobs(self) -> Sequence[Mapping[str, Any]]:
        facts = None if self.hub.run is None else self.hub.run.facts.get("tuning")
        return [] if facts is None else list(facts["knobs"])


def _list(value: object) -> list[Any]:
    return value if isinstance(value, list) else []


def _objects(value: object) -> list[dict[str, Any]]:
    return [one for one in _list(value) if isinstance(one, dict)]


def _words(value: object) -> list[str]:
    return [one for one in _list(value) if isinstance(one, str)]


def _is_number(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 1 << 32
