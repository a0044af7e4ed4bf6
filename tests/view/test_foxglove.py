"""Foxglove's protocol by a bare websocket client, written from its specification."""

from __future__ import annotations

import asyncio
import json
import os
import queue
import struct
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect

from tautwave.errors import RecordingError
from tautwave.runtime.mcap_schema import CDR_HEADER
from tautwave.runtime.tuning.desk import ParameterPage, last_left
from tautwave.view import foxglove, tuner
from tautwave.view.guard import Door
from tautwave.view.server import Server
from tests.view.served import BENCH, COLUMNS, Run, ask, served

K = "coupling.pairs.lever.wall_slave.stiffness"
KNOB = {"path": K, "column": "lever.position_error", "unit": "N m/rad", "when": "engaged",
        "value": 3.0, "low": 0.003, "high": 30.0, "ramped": True}  # fmt: skip
MAX_MESSAGES = 500


@pytest.fixture(scope="module")
def serving(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Run, Door, ParameterPage]]:
    desk = ParameterPage(1)
    facts = {"desk": desk.address, "knobs": [KNOB], "fixed": [], "hardware": []}
    rig = BENCH.read_text() + "\noperate: {scales: [0.5]}\n"
    with served(tmp_path_factory.mktemp("run"), rig, tuning=facts) as (run, door):
        run.commit(1)
        yield run, door, desk
    desk.close()


def client(door: Door, token: str, **options: Any) -> ClientConnection:
    return connect(
        f"ws://127.0.0.1:{door.port}/foxglove?token={token}",
        subprotocols=["foxglove.sdk.v1"],  # type: ignore[list-item]
        compression=None,
        ping_interval=None,
        **options,
    )


def heard(socket: ClientConnection, op: str) -> dict[str, Any]:
    for _ in range(MAX_MESSAGES):
        data = socket.recv(60)
        if isinstance(data, str) and (said := json.loads(data))["op"] == op:
            return dict(said)
    raise AssertionError(op)


def heard_bytes(socket: ClientConnection, opcode: int) -> bytes:
    for _ in range(MAX_MESSAGES):
        data = socket.recv(60)
        if isinstance(data, bytes) and data[0] == opcode:
            return data
    raise AssertionError(opcode)


def set_parameter(socket: ClientConnection, name: str, value: Any) -> list[dict[str, Any]]:
    parameters = [{"name": name, "value": value}]
    socket.send(json.dumps({"op": "setParameters", "parameters": parameters, "id": "s1"}))
    said = heard(socket, "parameterValues")
    assert said["id"] == "s1"
    return list(said["parameters"])


def call(socket: ClientConnection, service: int, body: str = "{}") -> dict[str, Any]:
    head = struct.pack("<BIII", 2, service, 77, 4)
    socket.send(head + b"json" + body.encode())
    data = heard_bytes(socket, 3)
    assert struct.unpack_from("<BIII", data) == (3, service, 77, 4)
    assert data[13:17] == b"json"
    return dict(json.loads(data[17:]))


def test_rows_come_as_ros_messages(serving: tuple[Run, Door, ParameterPage]) -> None:
    run, door, _ = serving
    with client(door, "") as socket:
        assert socket.subprotocol == "foxglove.sdk.v1"
        assert set(heard(socket, "serverInfo")["capabilities"]) >= {"parameters", "services"}
        (channel,) = heard(socket, "advertise")["channels"]
        assert (channel["encoding"], channel["schemaEncoding"]) == ("cdr", "ros2msg")
        assert channel["schema"].splitlines()[0] == "float64 time_s"
        asked = [{"id": 5, "channelId": channel["id"]}]
        socket.send(json.dumps({"op": "subscribe", "subscriptions": asked}))
        socket.send(json.dumps({"op": "getParameters", "parameterNames": [K], "id": "g"}))
        assert heard(socket, "parameterValues")["parameters"] == [
            {"name": K, "type": "float64", "value": 3.0}
        ]
        begin = run.rows
        run.commit(30)
        for row in range(begin, begin + 30):
            data = heard_bytes(socket, 1)
            while struct.unpack_from("<d", data, 17 + 24)[0] < begin:  # from before
                data = heard_bytes(socket, 1)
            opcode, subscription, time_ns = struct.unpack_from("<BIQ", data)
            assert (opcode, subscription) == (1, 5)
            assert data[13:17] == CDR_HEADER
            values = struct.unpack(f"<{len(COLUMNS)}d", data[17:])
            assert values[3] == row
            assert time_ns == run.recorder_epoch_ns + round(1e9 * values[0])


def test_subscriptions_of_a_socket_are_bounded(serving: tuple[Run, Door, ParameterPage]) -> None:
    run, door, _ = serving
    with client(door, "") as socket:
        (channel,) = heard(socket, "advertise")["channels"]
        for begin in range(0, 3000, 1000):  # of 60,000 each brought every row
            asked = [{"id": begin + k, "channelId": channel["id"]} for k in range(1000)]
            socket.send(json.dumps({"op": "subscribe", "subscriptions": asked}))
            assert "at most 16 subscriptions" in heard(socket, "status")["message"]
        for ids in (range(16), range(16), range(20, 21)):
            asked = [{"id": k, "channelId": channel["id"]} for k in ids]
            socket.send(json.dumps({"op": "subscribe", "subscriptions": asked}))
        assert "at most 16 subscriptions" in heard(socket, "status")["message"]
        run.commit(1)
        found = {struct.unpack_from("<I", heard_bytes(socket, 1), 1)[0] for _ in range(16)}
        assert found == set(range(16))


@pytest.mark.parametrize(
    "message",
    [
        json.dumps({"op": "getParameters", "parameterNames": [], "id": "a"}),
        json.dumps({"op": "setParameters", "parameters": [{"name": K, "value": 1.0}]}),
        json.dumps({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 1}]}),
        struct.pack("<BIII", 2, 0, 77, 4) + b"json{}",
        b"",
    ],
)
def test_before_the_run_has_begun_whatever_is_asked_is_answered(
    tmp_path: Path, message: str | bytes
) -> None:
    door = Door("127.0.0.1", 0, None, "secret-token")
    urls: queue.Queue[str] = queue.Queue()
    early = Server(tmp_path, door, urls.put, patience_s=600.0, foxglove=True, starter=os.getppid())
    thread = threading.Thread(target=lambda: suppressed(early))
    thread.start()
    try:
        urls.get(timeout=60)
        with client(early.door, "secret-token") as socket:
            socket.send(message)
            data = socket.recv(60)
            said = data[17:].decode() if isinstance(data, bytes) else data
            assert "the run has not begun" in said or "not a service call" in said
            socket.send(json.dumps({"op": "getParameters"}))  # the socket is still there
            assert "the run has not begun" in heard(socket, "status")["message"]
    finally:
        early._starter = -1  # as if the process that starts the run had ended
        thread.join(60)
    assert not thread.is_alive()


def suppressed(early: Server) -> None:
    with pytest.raises(RecordingError, match="no run in progress here"):
        asyncio.run(early.serve())


def test_a_parameter_is_set_and_a_forbidden_one_refused_with_its_range(
    serving: tuple[Run, Door, ParameterPage], monkeypatch: pytest.MonkeyPatch
) -> None:
    _, door, desk = serving

    async def certify(*_: Any) -> None:
        """The certificate is asked in `test_tuner`."""

    monkeypatch.setattr(tuner, "certify_change", certify)
    with client(door, "secret-token") as socket:
        heard(socket, "advertiseServices")
        assert set_parameter(socket, K, 2.0)[0]["value"] == 2.0
        assert desk.take() == [2.0]
        socket.send(json.dumps({"op": "setParameters", "parameters": [{"name": K, "value": 9e3}]}))
        assert heard(socket, "status")["message"] == f"{K}: 0.003 to 30 N m/rad (got 9000.0)"
        assert heard(socket, "parameterValues")["parameters"][0]["value"] == 2.0
        assert set_parameter(socket, "coupling.law", "position") == []
        assert desk.take() is None
    with client(door, "guess") as socket:
        heard(socket, "advertiseServices")
        assert set_parameter(socket, K, 1.0)[0]["value"] == 2.0
        assert desk.take() is None
    assert last_left(desk.address, 1) == (2.0,)


def test_services_give_commands_and_say_what_became_of_them(
    serving: tuple[Run, Door, ParameterPage], monkeypatch: pytest.MonkeyPatch
) -> None:
    run, door, _ = serving
    with client(door, "secret-token") as socket:
        services = heard(socket, "advertiseServices")["services"]
        number = {one["name"]: one["id"] for one in services}
        assert set(number) >= {"/engage", "/clutch", "/hold", "/rest", "/stop", "/episode"}
        said = {
            "at_s": 0.0,
            "word": "engage",
            "source": "foxglove",
            "state": "aligning",
            "text": "",
        }

        def loop() -> None:
            """Stand in for the run: obey the first command, refuse the next."""
            texts = iter(("", "engage: not while aligning"))
            for count, text in enumerate(texts, 1):
                while not (orders := run.orders()):
                    pass
                assert orders == [("engage", "", "foxglove")]
                entry = {**said, "text": text, "refused": bool(text)}
                run.recorder.tell(json.dumps([[count, entry]]))

        thread = threading.Thread(target=loop)
        thread.start()
        assert call(socket, number["/engage"]) == {"success": True, "message": "aligning"}
        refused = call(socket, number["/engage"])
        assert refused == {"success": False, "message": "engage: not while aligning"}
        thread.join()
        monkeypatch.setattr(foxglove, "ANSWER_S", 0.03)  # nobody plays the run any more
        for body, line in (('{"scale": 0.5}', "0.5"), ("{}", ""), ('{"scale": [1]}', "[1]")):
            assert call(socket, number["/scale"], body)["success"] is False
            assert run.orders() == [("scale", line, "foxglove")]
        socket.send(struct.pack("<BIII", 2, 99, 1, 4) + b"json{}")
        assert heard(socket, "serviceCallFailure")["serviceId"] == 99
    with client(door, "") as socket:
        heard(socket, "advertiseServices")
        assert "without the token" in call(socket, number["/engage"])["message"]
        assert run.orders() == []


def test_nonsense_is_answered_and_ends_nothing(serving: tuple[Run, Door, ParameterPage]) -> None:
    _, door, _ = serving
    with client(door, "secret-token") as socket:
        for text in ("[]", "{", '{"op": 3}', '{"op": "getParameters", "id": "\\ud800"}',
                     '{"op": "subscribe", "subscriptions": [3, {"id": []}]}',
                     '{"op": "setParameters", "parameters": "x"}',
                     '{"op": "unsubscribe", "subscriptionIds": [[], "a", -1]}'):  # fmt: skip
            socket.send(text)
        for data in (b"", b"\x02", b"\x02" + b"\xff" * 12, b"\x01" * 40):
            socket.send(data)
        socket.send(json.dumps({"op": "getParameters", "parameterNames": [], "id": "last"}))
        while heard(socket, "parameterValues").get("id") != "last":
            pass


def test_foreign_pages_are_refused_and_the_layout_fits(
    serving: tuple[Run, Door, ParameterPage],
) -> None:
    _, door, _ = serving
    origin: Any = "https://app.example"
    with pytest.raises(InvalidStatus, match="403"), client(door, "secret-token", origin=origin):
        pass
    text = f"GET /foxglove-layout.json HTTP/1.1\r\nHost: 127.0.0.1:{door.port}\r\n\r\n"
    layout = json.loads(ask(door, text).partition("\r\n\r\n")[2])
    shown: list[str] = []

    def walk(node: Any) -> None:
        with suppress(AttributeError):
            for side in ("first", "second"):
                walk(node[side]) if isinstance(node, dict) else None
        if isinstance(node, str):
            shown.append(node)

    walk(layout["layout"])
    assert sorted(shown) == sorted(layout["configById"])
    paths = [p["value"] for panel in layout["configById"].values() for p in panel.get("paths", ())]
    assert "/tautwave/cycle.lateness_us" in paths
    assert layout["configById"]["CallService!engage"]["serviceName"] == "/engage"
