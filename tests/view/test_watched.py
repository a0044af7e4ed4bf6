"""Ways from a viewer back to the run: its mailbox, and stopping a run that takes no commands."""

from __future__ import annotations

import asyncio
import base64
import datetime
import json
import os
import signal
import ssl
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

from tautwave.config import load_rig
from tautwave.errors import ConfigError, RecordingError
from tautwave.runtime.operate.mailbox import Mailbox, send
from tautwave.runtime.tap import Live
from tautwave.view import viewers
from tautwave.view.facts import facts_of
from tautwave.view.guard import Door, open_door
from tautwave.view.server import SOUND, Server
from tautwave.view.viewers import Viewer
from tautwave.view.watched import Watched
from tests.view.served import BENCH, Run

BARE = "coupling={law: position, pairs: {lever: {stiffness: 1.0, damping: 0.01}}}"


def test_commands_reach_the_run_as_lines_with_their_source() -> None:
    with Mailbox() as mailbox:
        send(mailbox.address, "page", "episode pick\tthe red\none")
        send(mailbox.address, "foxglove", "engage")
        orders = mailbox.source.take(0)
        assert [tuple(order) for order in orders] == [
            ("episode", "pick the red one", "page"), ("engage", "", "foxglove"),
        ]  # fmt: skip
        assert mailbox.source.take(0) == []
        with pytest.raises(RecordingError, match="at most 4096 bytes"):
            send(mailbox.address, "page", "x" * 5000)
        for _ in range(16):  # what a pipe holds
            send(mailbox.address, "page", "y" * 4000)
        with pytest.raises(RecordingError, match="too many are queued"):
            send(mailbox.address, "page", "y" * 4000)
    with pytest.raises(RecordingError, match="has ended"):
        send(mailbox.address, "page", "engage")


@pytest.fixture
def writer() -> Iterator[subprocess.Popen[bytes]]:
    child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    yield child
    child.communicate(b"\n")


def test_a_run_without_commands_is_interrupted_once(
    writer: subprocess.Popen[bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    sent: list[tuple[int, int]] = []
    monkeypatch.setattr(os, "kill", lambda *to: sent.append(to))
    nothing: Any = SimpleNamespace()
    run = Watched(Path(), Live(writer.pid, 0, (), 1, 1.0, {"pid": os.getpid()}), nothing)
    with pytest.raises(RecordingError, match="accepts no commands except stop"):
        run.command("page", "engage")
    run.command("page", " stop ")
    run.command("page", "stop")  # a second signal would leave at once
    assert sent == [(os.getpid(), signal.SIGINT)]
    other = Watched(Path(), Live(writer.pid, 0, (), 1, 1.0, {"pid": os.getppid()}), nothing)
    with pytest.raises(RecordingError, match="has ended"):
        other.command("page", "stop")  # that process is not the writer's parent


def test_rows_that_a_viewer_does_not_take_are_left_out_and_counted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    waiting = [0, 10, 0]
    sent: list[tuple[int, int, bytes]] = []
    transport = SimpleNamespace(get_write_buffer_size=lambda: waiting.pop(0))
    socket: Any = SimpleNamespace(transport=transport)
    hub: Any = SimpleNamespace()
    viewer = Viewer(socket, hub)
    monkeypatch.setattr(viewers, "MAX_WAITING", 5)
    monkeypatch.setattr(viewer, "send_rows", lambda *message: sent.append(message))
    for first in (0, 30, 60):
        viewer.offer(first, 30, 2, b"rows")
    assert sent == [(0, 2, b"rows"), (60, 32, b"rows")]


def test_what_waits_for_a_viewer_holds_seconds_of_rows_and_no_more_than_a_socket_should() -> None:
    rows = 8 * 100 * 1000  # bytes a second, of 100 columns at 1 kHz
    assert 4 * rows < viewers.MAX_WAITING < 6 * rows


def pem(folder: Path) -> tuple[Path, Path]:
    """Make a certificate for 127.0.0.1 and its key."""
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec

    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "bench")])
    today = datetime.datetime(2026, 1, 1)
    made = x509.CertificateBuilder().subject_name(name).issuer_name(name)
    made = made.public_key(key.public_key()).serial_number(7)
    made = made.not_valid_before(today).not_valid_after(today + datetime.timedelta(days=9999))
    (folder / "c.pem").write_bytes(
        made.sign(key, hashes.SHA256()).public_bytes(serialization.Encoding.PEM)
    )
    (folder / "k.pem").write_bytes(
        key.private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.PKCS8,
            serialization.NoEncryption(),
        )
    )
    return folder / "c.pem", folder / "k.pem"


class Elsewhere(Door):
    """A door on this machine that behaves as one that others reach."""

    @property
    def local(self) -> bool:
        return False


def test_who_is_elsewhere_needs_tls_and_the_token_to_look(tmp_path: Path) -> None:
    run = Run(tmp_path)
    door = Elsewhere(*open_door("127.0.0.1", 0, *pem(tmp_path)))
    urls: list[str] = []
    server = Server(tmp_path, door, urls.append)
    trusting = ssl.create_default_context(cafile=tmp_path / "c.pem")
    trusting.check_hostname = False

    async def ask(token: str) -> str:
        port = server.door.port
        async with connect(
            f"wss://127.0.0.1:{port}/live", ssl=trusting, origin=f"https://127.0.0.1:{port}",
        ) as socket:  # fmt: skip
            await socket.send(json.dumps({"op": "hello", "token": token}))
            try:
                return str(json.loads(await socket.recv())["op"])
            except ConnectionClosed as closed:
                return str(closed.rcvd and closed.rcvd.code)

    async def both() -> list[str]:
        serving = asyncio.create_task(server.serve())
        while not urls:
            await asyncio.sleep(0.005)
        found = [await ask("guess"), await ask(door.token)]
        run.close()
        await serving
        return found

    assert asyncio.run(both()) == ["1008", "hello"]
    assert urls[0].startswith("https://127.0.0.1:")
    with pytest.raises(ConfigError, match="unusable for TLS"):
        open_door("127.0.0.1", 0, tmp_path / "c.pem", tmp_path / "c.pem")


def test_a_page_draws_the_walls_of_a_rig_and_none_of_others() -> None:
    live = Live(0, 0, ["time_s"], 64, 1000.0, {"units": {"lever": "rad"}})
    for more, walls in (((), [-0.32, -0.28]), ((BARE,), [None, None])):
        [pair] = facts_of(live, load_rig(BENCH, more))["pairs"]
        assert [pair["sides"][side]["wall"] for side in ("master", "slave")] == walls


@pytest.mark.parametrize("made", [b"RIFF of a string", None])
def test_pages_get_the_sound_of_a_scene_that_they_played_where_there_is_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, made: bytes | None
) -> None:
    door = Door("127.0.0.1", 0, None, "")
    server = Server(tmp_path, door, lambda url: None, starter=os.getpid())  # no parent of ours
    scene: Any = SimpleNamespace(scene="a string")
    run: Any = SimpleNamespace(facts={"pointer": "stylus"})
    server.rig, server.run = scene, run
    told: list[tuple[str, dict[str, str]]] = []
    page = Viewer(cast(Any, None), server)
    monkeypatch.setattr(page, "tell", lambda word, **more: told.append((word, more)))
    server.viewers[page] = None
    if made is not None:
        (tmp_path / SOUND).write_bytes(made)
    asyncio.run(server._give_sound())
    heard = [base64.b64decode(more["wav"]) for word, more in told if word == "sound"]
    assert heard == ([] if made is None else [made])
