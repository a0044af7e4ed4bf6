"""The server of a run's viewers: the page and its files, rows as they come, commands back."""

from __future__ import annotations

import asyncio
import base64
import json
import math
import os
import socket
from collections.abc import Callable, Collection, Mapping, Sequence
from http import HTTPStatus
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response
from websockets.typing import Subprotocol

from tautwave.config import Rig, load_rig
from tautwave.config.guard import parse_json
from tautwave.errors import ConfigError, RecordingError
from tautwave.reading import read_file
from tautwave.view.drawn import Drawn
from tautwave.view.facts import commands_of
from tautwave.view.foxglove import SUBPROTOCOLS, FoxgloveViewer
from tautwave.view.foxglove_layout import layout_of
from tautwave.view.guard import FOXGLOVE_SOCKET, HEADERS, PAGE_SOCKET, Door, refused
from tautwave.view.so_far import SoFar, silence_of
from tautwave.view.tuner import asked_of, tune
from tautwave.view.viewers import MAX_WAITING, Viewer
from tautwave.view.watched import STOP, Watched

LOOK_S = 1.0 / 30.0
"""From one look at the ring to the next; each brings all rows since the last."""

LOOKS_A_NUMBER = 6
"""Looks at the ring from one update of the page's numbers to the next: 0.2 s, for reading."""

LOOKS_A_PICTURE = 2
"""Looks at the ring from one picture of the arms to the next."""

WAIT_S, KNOCK_S = 0.2, 5.0
MAX_VIEWERS = 16
"""That get rows; one with the token takes the place of one without."""
BACKLOG = 1024
"""Connections that the kernel keeps until they are taken; it may allow fewer."""
AT_A_TURN = 8
MAX_STANDING = 64
"""Sockets without a place: of more, the oldest is closed."""
MAX_BEHIND = 4 << 20
"""[bytes] Of answers that a viewer has not taken, beside its rows; one that asks for more is
closed."""
NO_PLACE = (
    f"{MAX_VIEWERS} pages are open already: this page gets no data until one is closed; "
    "stop works, and so does the address with the token"
)
LARGEST = 1 << 16
"""[bytes] Of a message from a viewer."""

SOUND, SOUND_WAIT_S, AGAIN_S = "output.wav", 120.0, 2.0
MAX_SOUND = 64 << 20
"""[bytes] Of a sound: twelve minutes of it."""

LAYOUT = "/foxglove-layout.json"
TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}


class Page(NamedTuple):
    """A file of the page: its bytes and type."""

    body: bytes
    type: str


def page_files() -> Mapping[str, Page]:
    """Return the files that are served, by path."""
    root = files("tautwave.view").joinpath("page")
    pages: dict[str, Page] = {}
    for folder, path in ((root, "/"), (root.joinpath("uplot"), "/uplot/")):
        for entry in folder.iterdir():
            kind = TYPES.get(Path(entry.name).suffix)
            if entry.is_file() and kind is not None:
                pages[path + entry.name] = Page(entry.read_bytes(), kind)
    pages["/"] = pages["/index.html"]
    return pages


class Server:
    """Viewers of one run.

    Parameters
    ----------
    directory : Path
        Of the run, which may not have begun.
    door : Door
        Where viewers come in.
    announce : callable
        Called with the address once there is one.
    patience_s : float
        How long a run that is not there yet is waited for.
    foxglove : bool
        Serve Foxglove's protocol too.
    origins : collection of str
        Of pages elsewhere that may use it.
    starter : int or None
        The process that runs or will run it; once it is no longer this one's parent, a run that
        has not begun is no longer waited for.
    """

    def __init__(
        self,
        directory: Path,
        door: Door,
        announce: Callable[[str], None],
        *,
        patience_s: float = 0.0,
        foxglove: bool = False,
        origins: Collection[str] = (),
        starter: int | None = None,
    ) -> None:
        self.directory = directory
        self.door = door
        self.viewers: dict[Viewer, None] = {}  # the oldest first, as those that stand
        self._standing: dict[Viewer, None] = {}
        self.run: Watched | None = None
        self.rig: Rig | None = None
        self._announce = announce
        self._patience_s = patience_s
        self._files = page_files()
        self._origins = origins
        self._starter = starter
        self._sockets = {PAGE_SOCKET, *([FOXGLOVE_SOCKET] if foxglove else [])}
        self.news: list[Any] = []
        self.newest: Sequence[float] = ()
        self.so_far: SoFar | None = None
        self.drawn: Drawn | None = None
        self._one_change = asyncio.Lock()

    async def serve(self) -> None:
        """Serve until the run has ended.

        Raises
        ------
        RecordingError
            There is no run.
        ConfigError
            The port is taken.
        """
        if not self._patience_s:
            self._open()
        secured: dict[str, Any] = {"ssl_handshake_timeout": KNOCK_S} if self.door.tls else {}
        address, port = self.door.address, self.door.port
        family = socket.AF_INET6 if ":" in address else socket.AF_INET
        try:
            listener = socket.create_server((address, port), family=family)
            server = await serve(
                self._meet,
                sock=listener,
                ssl=self.door.tls,
                process_request=self._answer,
                select_subprotocol=_subprotocol,
                compression=None,  # rows hardly compress, and it costs time
                max_size=LARGEST,
                server_header=None,
                open_timeout=KNOCK_S,
                backlog=AT_A_TURN,  # asyncio takes as many before it attends to those it has
                **secured,
            )
        except OSError as error:
            reason = error.strerror or error
            raise ConfigError(f"--port: {address}:{port} cannot be served: {reason}") from error
        async with server:
            listener.listen(BACKLOG)
            self.door = self.door._replace(port=listener.getsockname()[1])
            self._announce(self.door.url)
            await self._begin()
            await self._watch()
            for viewer in self.viewers:
                viewer.tell("ended", directory=str(self.directory))
            await self._give_sound()

    async def _give_sound(self) -> None:
        """Send pages the sound of a scene that they played, once its report has made it."""
        if self.run is None or self.rig is None or self.rig.scene is None:
            return
        if self.run.facts.get("pointer") is None:
            return
        path = self.directory / SOUND
        for _ in range(round(SOUND_WAIT_S / WAIT_S)):
            if path.exists() or self._starter not in (None, os.getppid()):
                break
            await asyncio.sleep(WAIT_S)
        if path.exists():
            wav = base64.b64encode(read_file(path, MAX_SOUND)).decode()
            for _ in range(round(AGAIN_S / WAIT_S)):  # a page may be coming again
                if self.viewers:
                    break
                await asyncio.sleep(WAIT_S)
            for viewer in self.viewers:
                viewer.tell("ended", directory=str(self.directory))
                viewer.tell("sound", wav=wav, directory=str(self.directory))

    def _open(self) -> None:
        run = Watched.of_run(self.directory)
        self.rig = load_rig(self.directory / "rig.yaml", choose=False)
        self.so_far = SoFar(run.live.columns, silence_of(self.rig))
        self.drawn = Drawn(run.live.columns, self.rig)
        self.run = run

    async def _begin(self) -> None:
        """Wait for the run's first rows."""
        waited = 0.0
        while self.run is None:
            try:
                self._open()
            except (RecordingError, OSError):
                if waited > self._patience_s or self._starter not in (None, os.getppid()):
                    raise
                waited += WAIT_S
                await asyncio.sleep(WAIT_S)
        for viewer in self.viewers:
            viewer.greet()

    async def _watch(self) -> None:
        run, so_far = self.run, self.so_far
        assert run is not None
        assert so_far is not None
        assert self.drawn is not None
        width = len(run.live.columns)
        sent, told = "", so_far.facts()
        looks = 0
        while True:
            ended = run.ended
            first, rows = run.tap.take_bytes()
            if rows:
                values = memoryview(rows).cast("d")
                self.newest = values[-width:].tolist()
                so_far.take_rows(values)
            news = run.tap.news()
            for viewer in self.viewers:
                if rows and viewer.greeted:
                    viewer.offer(first, len(values) // width, run.tap.missed, rows)
            if news != sent:
                sent = news
                self.news = list(parse_json(news))
                so_far.take_news(self.news)
            looks += 1
            if rows and looks % LOOKS_A_PICTURE == 0 and (poses := self.drawn.pose(self.newest)):
                for viewer in self.viewers:
                    viewer.show(poses)
            if ended or looks % LOOKS_A_NUMBER == 0:
                kinds, facts = so_far.take_new(), so_far.facts()
                if kinds or facts != told:
                    for viewer in self.viewers:
                        viewer.tell("so_far", kinds=kinds, **facts)
                    told = facts
            if ended:
                return
            await asyncio.sleep(LOOK_S)

    # -- one viewer ---------------------------------------------------------------------------

    def _answer(self, socket: ServerConnection, request: Request) -> Response | None:
        """Return the response to a request, None for one that opens a socket."""
        path = request.path.partition("?")[0]
        hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
        why = refused(path, hosts, origins, self.door, self._origins)
        if why:
            return _response(HTTPStatus.FORBIDDEN, Page(f"{why}\n".encode(), "text/plain"))
        if path in self._sockets:
            return None
        page = self._files.get(path)
        if getattr(request, "method", "GET") != "GET":  # older versions know no other
            return _response(HTTPStatus.METHOD_NOT_ALLOWED, Page(b"only GET\n", "text/plain"))
        if path == LAYOUT and FOXGLOVE_SOCKET in self._sockets and self.run is not None:
            words = commands_of(self.run.live, self.rig) if self.rig else []
            body = json.dumps(layout_of(self.run.live, words), indent=1).encode()
            page = Page(body, "application/json")
        if page is None:
            return _response(HTTPStatus.NOT_FOUND, Page(b"not here\n", "text/plain"))
        return _response(HTTPStatus.OK, page)

    async def _meet(self, socket: ServerConnection) -> None:
        path = "" if socket.request is None else socket.request.path.partition("?")[0]
        kind = FoxgloveViewer if path == FOXGLOVE_SOCKET else Viewer
        viewer = kind(socket, self)
        try:
            if not self._seat(viewer):
                await self._stand(viewer)
            async for message in socket:
                await self._hear(viewer, message)
        except (ConnectionClosed, TimeoutError):
            pass
        finally:
            self.viewers.pop(viewer, None)
            self._standing.pop(viewer, None)
            if self._standing:
                self._seat(next(iter(self._standing)))

    async def _stand(self, viewer: Viewer) -> None:
        """Hear one without a place until it has one; from elsewhere it has one try, with the token.

        On this machine it may stop the run meanwhile, and for as long as it is there.
        """
        self._standing[viewer] = None
        if len(self._standing) > MAX_STANDING:
            oldest = next(iter(self._standing))
            del self._standing[oldest]
            oldest.socket.transport.abort()
        if self.door.local:
            viewer.tell_refused(NO_PLACE)
            async for message in viewer.socket:
                await self._hear(viewer, message)
                if self._seat(viewer):
                    return
            return
        async with asyncio.timeout(KNOCK_S):
            viewer.introduce(await viewer.socket.recv())
        if not self._seat(viewer):
            await viewer.socket.close(1008, "no place" if viewer.may else "token")

    def _seat(self, viewer: Viewer) -> bool:
        """Give a viewer rows, if it may have them and there is a place; return whether it has."""
        if viewer in self.viewers:
            return True
        if not (self.door.local or viewer.may):
            return False
        if len(self.viewers) >= MAX_VIEWERS:
            without = next((one for one in self.viewers if not one.may), None)
            if without is None or not viewer.may:
                return False
            del self.viewers[without]
            without.socket.transport.abort()  # its page comes again, and finds no place
        self._standing.pop(viewer, None)
        self.viewers[viewer] = None
        if self.run is not None:
            viewer.greet()
        return True

    async def _hear(self, viewer: Viewer, message: str | bytes) -> None:
        if viewer.socket.transport.get_write_buffer_size() > MAX_WAITING + MAX_BEHIND:
            await viewer.socket.close(1008, "answers are not read")
            return
        await viewer.hear(message)

    # -- what viewers ask for -----------------------------------------------------------------

    def knows(self, token: object) -> bool:
        """Return whether that is the token."""
        return self.door.knows(token)

    def command(self, may: bool, source: str, line: str) -> None:
        """Give the run a command.

        Raises
        ------
        ConfigError, RecordingError
            It needs the token, or the run takes none.
        """
        if not may and line.strip() != STOP:
            raise ConfigError(NEEDS_TOKEN)
        if self.run is None:
            raise RecordingError("the run has not begun")
        self.run.command(source, line)

    def point(self, may: bool, places: object) -> None:
        """Lead the hands of a run that follow a pointer; None: let them go.

        Raises
        ------
        ConfigError, RecordingError
            It needs the token, is none, or the run has no such hands.
        """
        if not may:
            raise ConfigError(NEEDS_TOKEN)
        if self.run is None:
            raise RecordingError("the run has not begun")
        if places is not None and not (
            isinstance(places, dict) and places and all(map(_is_place, places.values()))
        ):
            raise ConfigError("a pointer is places by name [rad or m]")
        self.run.point(places)

    async def change(self, may: bool, values: object) -> str:
        """Certify a change and hand it over, one at a time; return a sentence.

        Raises
        ------
        ConfigError, RecordingError, NotCertifiedError
            It needs the token, is none, or is not certified.
        """
        if not may:
            raise ConfigError(NEEDS_TOKEN)
        if self.run is None or self.rig is None or not self.newest:
            raise RecordingError("no row has come yet")
        if not isinstance(values, dict):
            raise ConfigError("a change is values by path")
        async with self._one_change:
            text = await tune(self.run, self.rig, asked_of(self.run, self.newest, values))
        for viewer in self.viewers:
            viewer.tuned()
        return text


NEEDS_TOKEN = (
    "without the token only viewing and stop are allowed: open the address that `view` printed"
)


def _is_place(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _response(status: HTTPStatus, page: Page) -> Response:
    headers = Headers(HEADERS)
    headers["Content-Type"] = page.type
    headers["Content-Length"] = str(len(page.body))
    headers["Connection"] = "close"
    return Response(status.value, status.phrase, headers, page.body)


def _subprotocol(socket: ServerConnection, offered: Sequence[Subprotocol]) -> Subprotocol | None:
    """Return the one that is spoken; pages offer none."""
    return next((one for one in offered if one in SUBPROTOCOLS), None)


def serve_run(
    directory: Path,
    door: Door,
    announce: Callable[[str], None],
    *,
    patience_s: float = 0.0,
    foxglove: bool = False,
    origins: Collection[str] = (),
    starter: int | None = None,
) -> None:
    """Serve a run's viewers until it has ended; as `Server`."""
    server = Server(
        directory,
        door,
        announce,
        patience_s=patience_s,
        foxglove=foxglove,
        origins=origins,
        starter=starter,
    )
    asyncio.run(server.serve())
