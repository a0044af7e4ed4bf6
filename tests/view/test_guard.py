"""The page's door: who is let in, by raw requests as an adversary would send them."""

from __future__ import annotations

import json
import struct
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from click.testing import CliRunner
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from tautwave.cli import main
from tautwave.errors import ConfigError
from tautwave.view import server
from tautwave.view.guard import POLICY, Door, open_door, refused
from tests.view.served import Run, ask, elsewhere, knock, served

UPGRADE = (
    "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
)


def page(door: Door, *, origin: str | None = None) -> ClientConnection:
    return connect(
        f"ws://127.0.0.1:{door.port}/live",
        origin=origin or f"http://127.0.0.1:{door.port}",  # type: ignore[arg-type]
        compression=None,
        ping_interval=None,
    )


def heard(socket: ClientConnection, op: str) -> dict[str, object]:
    """Return the next message of a kind."""
    while True:
        data = socket.recv(60)
        if isinstance(data, str) and (said := json.loads(data))["op"] == op:
            return dict(said)


@pytest.fixture(scope="module")
def serving(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Run, Door]]:
    with served(tmp_path_factory.mktemp("run")) as found:
        yield found


def test_only_our_hosts_and_origins_and_paths(serving: tuple[Run, Door]) -> None:
    _, door = serving
    host = f"Host: 127.0.0.1:{door.port}\r\n"
    found = ask(door, f"GET / HTTP/1.1\r\n{host}\r\n")
    assert found.startswith("HTTP/1.1 200 OK")
    assert f"Content-Security-Policy: {POLICY}" in found
    assert "secret-token" not in found
    for head in ("", "Host: evil.example\r\n", f"{host}{host}",
                 f"Host: evil.example:{door.port}\r\n", f"{host}Origin: http://evil.example\r\n",
                 f"{host}Origin: null\r\n"):  # fmt: skip
        assert ask(door, f"GET / HTTP/1.1\r\n{head}\r\n").startswith("HTTP/1.1 403"), head
    for path in ("/../guard.py", "/%2e%2e/guard.py", "/uplot/../../guard.py", "/uplot/LICENSE",
                 "//etc/passwd", "/index.html/"):  # fmt: skip
        assert ask(door, f"GET {path} HTTP/1.1\r\n{host}\r\n").startswith("HTTP/1.1 404"), path
    for origin in ("", "Origin: http://evil.example\r\n", "Origin: null\r\n"):
        text = f"GET /live HTTP/1.1\r\n{host}{UPGRADE}{origin}\r\n"
        assert ask(door, text).startswith("HTTP/1.1 403"), origin
    posted = ask(door, f"POST / HTTP/1.1\r\n{host}Content-Length: 0\r\n\r\n")
    assert posted.startswith(("HTTP/1.1 400", "HTTP/1.1 405"))  # by version of websockets


def test_foxglove_is_served_only_where_it_is_asked_for(
    tmp_path: Path, serving: tuple[Run, Door]
) -> None:
    with served(tmp_path, plain=True) as (_, plain):
        for door, found in ((plain, "404 Not Found"), (serving[1], "200 OK")):
            text = f"GET /foxglove-layout.json HTTP/1.1\r\nHost: 127.0.0.1:{door.port}\r\n\r\n"
            assert ask(door, text).startswith(f"HTTP/1.1 {found}\r\n")
        text = f"GET /foxglove HTTP/1.1\r\nHost: 127.0.0.1:{plain.port}\r\n{UPGRADE}\r\n"
        assert ask(plain, text).startswith("HTTP/1.1 404 Not Found\r\n")


def test_without_the_token_one_may_look_and_stop(serving: tuple[Run, Door]) -> None:
    run, door = serving
    with page(door) as socket:
        assert heard(socket, "hello")["may"] is False
        for order in ({"op": "hello", "token": "guess"}, {"op": "hello", "token": ["secret"]}):
            socket.send(json.dumps(order))
            assert heard(socket, "may")["may"] is False
        socket.send(json.dumps({"op": "command", "line": "engage"}))
        assert "without the token" in str(heard(socket, "note")["text"])
        socket.send(json.dumps({"op": "command", "line": "stop"}))
        socket.send(json.dumps({"op": "nonsense"}))
        heard(socket, "note")
        assert run.orders() == [("stop", "", "page")]
        socket.send(json.dumps({"op": "hello", "token": "secret-token"}))
        assert heard(socket, "may")["may"] is True
        # What a page sends is one line, whatever it holds.
        socket.send(json.dumps({"op": "command", "line": "episode a\nstop b"}))
        for nonsense in ("[", '{"op": "hello", "token": "\\ud800"}',
                         '{"op": "command", "line": "episode \\ud800"}'):  # fmt: skip
            socket.send(nonsense)
            heard(socket, "note")
        assert run.orders() == [("episode", "a stop b", "page")]


def test_every_row_comes_once_and_news_with_them(serving: tuple[Run, Door]) -> None:
    run, door = serving
    with page(door) as socket:
        heard(socket, "hello")
        entry = {"at_s": 0.1, "word": "engage", "source": "page", "state": "aligning"}
        run.recorder.tell(json.dumps([[1, entry]]))
        while not (kinds := heard(socket, "so_far")["kinds"]):
            pass
        assert [(place, one["word"], times) for place, one, times, _ in kinds] == [(0, "engage", 1)]
        rows: list[float] = []
        for _ in range(5):
            run.commit(20)
            data = b""
            while not isinstance(data := socket.recv(60), bytes):
                pass
            first, missed = struct.unpack_from("<dd", data)
            body = struct.unpack_from(f"<{(len(data) - 16) // 8}d", data, 16)
            assert first == len(rows)
            assert missed == 0
            rows += body[3::5]
        while len(rows) < run.rows:
            data = socket.recv(60)
            if isinstance(data, bytes):
                rows += struct.unpack_from(f"<{(len(data) - 16) // 8}d", data, 16)[3::5]
        assert rows == list(range(100))


def test_a_message_that_is_too_long_closes_its_socket(serving: tuple[Run, Door]) -> None:
    _, door = serving
    with page(door) as socket:
        socket.send("x" * 70_000)
        with pytest.raises(ConnectionClosed):
            heard(socket, "nothing")


def test_a_page_without_a_place_may_stop_and_the_token_has_one(serving: tuple[Run, Door]) -> None:
    run, door = serving
    run.orders()
    with ExitStack() as crowd:
        for _ in range(server.MAX_VIEWERS):
            heard(crowd.enter_context(page(door)), "hello")
        late, own = (crowd.enter_context(page(door)) for _ in range(2))
        for socket in (late, own):
            assert "this page gets no data until one is closed" in str(
                heard(socket, "note")["text"]
            )
        late.send(json.dumps({"op": "command", "line": "engage"}))
        assert "without the token" in str(heard(late, "note")["text"])
        late.send(json.dumps({"op": "command", "line": "stop"}))
        own.send(json.dumps({"op": "hello", "token": "secret-token"}))
        assert heard(own, "hello")["may"] is True  # in the place of the oldest without it
        late.send(json.dumps({"op": "nonsense"}))
        heard(late, "note")
        assert run.orders() == [("stop", "", "page")]
        crowd.pop_all().close()
    with page(door) as socket:  # and places become free again
        heard(socket, "hello")


def test_a_page_gets_the_place_of_one_that_leaves(serving: tuple[Run, Door]) -> None:
    _, door = serving
    with ExitStack() as crowd:
        first = crowd.enter_context(page(door))
        for _ in range(server.MAX_VIEWERS - 1):
            heard(crowd.enter_context(page(door)), "hello")
        late = crowd.enter_context(page(door))
        heard(late, "note")
        first.close()
        heard(late, "hello")


def test_of_many_pages_without_a_place_the_oldest_make_way(
    serving: tuple[Run, Door], monkeypatch: pytest.MonkeyPatch
) -> None:
    _, door = serving
    monkeypatch.setattr(server, "MAX_VIEWERS", 1)
    monkeypatch.setattr(server, "MAX_STANDING", 1)
    with page(door) as seated, page(door) as first, page(door) as second:
        heard(seated, "hello")
        heard(second, "note")
        with pytest.raises(ConnectionClosed):
            heard(first, "nothing")


def test_who_never_shows_the_token_takes_nobodys_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(server, "MAX_VIEWERS", 4)
    closed, context = elsewhere(tmp_path / "keys")
    (tmp_path / "run").mkdir()
    with served(tmp_path / "run", door=closed) as (_, door), ExitStack() as crowd:
        silent = [crowd.enter_context(knock(door, context)) for _ in range(8)]
        operator = crowd.enter_context(knock(door, context))
        operator.send(json.dumps({"op": "hello", "token": "secret-token"}))
        assert heard(operator, "hello")["may"] is True
        silent[-1].send(json.dumps({"op": "hello", "token": "guess"}))
        with pytest.raises(ConnectionClosed, match="1008"):
            heard(silent[-1], "nothing")


@pytest.mark.parametrize("address", ["0.0.0.0", "::"])
def test_every_address_at_once_is_none(address: str) -> None:
    with pytest.raises(ConfigError, match="give the one address that viewers open"):
        open_door(address, 0, None, None)


def test_other_addresses_need_tls() -> None:
    with pytest.raises(ConfigError, match="needs --tls-cert"):
        open_door("10.0.0.1", 0, None, None)
    with pytest.raises(ConfigError, match="numeric address"):
        open_door("evil.example", 0, None, None)
    with pytest.raises(ConfigError, match="belong together"):
        open_door("127.0.0.1", 0, Path("x"), None)
    with pytest.raises(ConfigError, match="unusable for TLS"):
        open_door("10.0.0.1", 0, Path("/nowhere/x"), Path("/nowhere/y"))
    assert len({open_door("127.0.0.1", 0, None, None).token for _ in range(9)}) == 9


@pytest.mark.parametrize(
    ("path", "host", "origin", "why"),
    [
        ("/", "localhost:80", None, ""),
        ("/", "localhost", None, ""),
        ("/", "LOCALHOST", "http://localhost", ""),
        ("/live", "[::1]", "http://[::1]", ""),
        ("/live", "localhost", "https://localhost", "foreign origin"),
        ("/live", "localhost", "http://localhost:81", "foreign origin"),
        ("/foxglove", "localhost", None, ""),
        ("/foxglove", "localhost", "https://app.example", "foreign origin"),
        ("/foxglove", "localhost", "https://viewer.example", ""),
        ("/live", "localhost", "https://viewer.example", "foreign origin"),
        ("/", "localhost.evil.example", None, "this host is not served here"),
    ],
)
def test_hosts_and_origins(path: str, host: str, origin: str | None, why: str) -> None:
    door = Door("::1", 80, None, "t")
    origins = [] if origin is None else [origin]
    assert refused(path, [host], origins, door, {"https://viewer.example"}) == why


def test_no_run_and_a_taken_port_are_one_sentence(
    tmp_path: Path, serving: tuple[Run, Door]
) -> None:
    done = CliRunner().invoke(main, ["view", str(tmp_path), "--page"])
    assert done.exit_code == 2
    assert "no run in progress here" in done.output
    run, door = serving
    order = ["view", str(run.directory), "--page", "--port", str(door.port)]
    done = CliRunner().invoke(main, order)
    assert done.exit_code == 2
    assert "cannot be served: " in done.output


BESIDE = """
import sys, time
from pathlib import Path
from tautwave.cli.terminal.serve_page import page_beside
with page_beside(Path(sys.argv[1]), True):
    print("here", flush=True)
    time.sleep(600)
"""


@pytest.mark.slow
def test_a_page_ends_with_a_run_that_is_killed_before_its_first_row(tmp_path: Path) -> None:
    run = subprocess.Popen(
        [sys.executable, "-c", BESIDE, str(tmp_path)], stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )  # fmt: skip
    try:
        assert run.stderr is not None
        assert run.stdout is not None
        assert b"page: http://127.0.0.1:" in run.stderr.readline()
        run.stdout.readline()
        (child,) = Path(f"/proc/{run.pid}/task/{run.pid}/children").read_text().split()
    finally:
        run.kill()
        run.communicate()  # until the page has closed its standard error, which is the run's
    assert not Path(f"/proc/{child}/exe").exists()
