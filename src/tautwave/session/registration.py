"""Registrations of servers of simulated devices on this machine: one small file each.

`tautwave sim RIG` writes it, so that `tautwave run RIG --attach` finds the endpoints, and so does a
run that serves devices on an endpoint named in the rig, to reserve it. Only the user can access the
directory. The file of a killed server is recognised by its process, which has gone or has another
start time.
"""

from __future__ import annotations

import fcntl
import json
import os
import stat
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from secrets import token_hex
from typing import Any, NamedTuple, TextIO

from tautwave.config import Rig
from tautwave.config.guard import parse_json, read_guarded
from tautwave.errors import ConfigError, DriverError
from tautwave.files import create

SIM, RUN = "sim", "run"
PRIVATE = 0o700
LARGEST = 1 << 20
"""Largest size of a registration [bytes]."""


class Server(NamedTuple):
    """A process that serves simulated devices.

    `began` is its start [clock ticks since boot], `kind` `sim` or `run`, `rig` the rig's identity,
    `endpoints` those named in the rig, `buses` its announcements by bus.
    """

    pid: int
    began: int
    kind: str
    rig: str
    endpoints: tuple[str, ...]
    buses: Mapping[str, Mapping[str, Any]]

    @property
    def alive(self) -> bool:
        """Whether its process still runs."""
        return began(self.pid) == self.began

    def describe(self) -> str:
        """Return a description for messages."""
        return f"process {self.pid} (tautwave {self.kind})"


def began(pid: int) -> int | None:
    """Return the start of a process [clock ticks since boot], None if there is none (proc(5))."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return None
    fields = text.rpartition(")")[2].split()
    return None if fields[0] in "ZX" else int(fields[19])


def identity(rig: Rig) -> str:
    """Return the identity of a rig: the file, the name, and the drivers of the buses by name."""
    file = "" if rig.source is None else str(rig.source.resolve())
    return json.dumps([file, rig.name, {name: bus.driver for name, bus in rig.buses.items()}])


def directory() -> Path:
    """Return the user's private directory of registrations, created if needed.

    Raises
    ------
    DriverError
        It cannot be created, or others can write to it.
    """
    given = os.environ.get("XDG_RUNTIME_DIR", "")
    path = Path(tempfile.gettempdir()) / f"tautwave-{os.getuid()}"
    if given and Path(given).is_dir():
        path = Path(given) / "tautwave"
    try:
        path.mkdir(PRIVATE, exist_ok=True)
        status = path.lstat()
    except OSError as err:
        raise DriverError(f"{path}: cannot be made: {err.strerror}; set XDG_RUNTIME_DIR") from err
    private = stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid()
    if not private or status.st_mode & 0o077:
        raise DriverError(
            f"{path}: should be a directory accessible only to you (mode 700); remove it, or set "
            "XDG_RUNTIME_DIR"
        )
    return path


def find_server(rig: Rig) -> Server | None:
    """Return the server that `tautwave sim` runs for a rig, None if there is none.

    Raises
    ------
    DriverError
        There was one, but it has died.
    """
    mine = identity(rig)
    dead = None
    for path, server in _servers():
        if server.kind != SIM or server.rig != mine:
            continue
        if server.alive:
            return server
        dead = server
        path.unlink(missing_ok=True)
    if dead is not None:
        raise DriverError(
            f"{rig.name}: --attach: {dead.describe()} served its devices and has ended; "
            f"{start(rig)}"
        )
    return None


def start(rig: Rig, *simulate: str) -> str:
    """Return the remedy if a rig is not served."""
    options = "".join(f" --simulate {bus}" for bus in simulate)
    return f"start `tautwave sim {rig.source or 'RIG'}{options}` in another terminal"


class Registration:
    """The file of this process."""

    def __init__(self, path: Path, server: Server) -> None:
        self._path = path
        self._server = server

    def announce(self, bus: str, endpoint: Mapping[str, Any]) -> None:
        """Add what is served on a bus."""
        self._server = self._server._replace(buses={**self._server.buses, bus: dict(endpoint)})
        self.write()

    def write(self) -> None:
        """Replace the file in one step."""
        draft = self._path.with_suffix(".part")
        with _new(draft) as file:
            json.dump(self._server._asdict(), file)
        draft.replace(self._path)


@contextmanager
def registered(rig: Rig, kind: str, endpoints: Sequence[str]) -> Iterator[Registration]:
    """Register as the server of a rig inside the block.

    Parameters
    ----------
    kind : str
        `sim`, of which a rig has one; or `run`.
    endpoints : sequence of str
        Endpoints named in the rig and served now.

    Raises
    ------
    DriverError
        Another process is registered, or serves one of the endpoints.
    """
    folder = directory()
    server = Server(os.getpid(), began(os.getpid()) or 0, kind, identity(rig), _here(endpoints), {})
    path = folder / f"{server.pid}-{token_hex(4)}.json"
    with _new(folder / "lock") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        for other_path, other in _servers():
            if not other.alive:
                other_path.unlink(missing_ok=True)
                continue
            _refuse_second(rig, server, other)
        mine = Registration(path, server)
        mine.write()
    try:
        yield mine
    finally:
        with suppress(OSError):
            path.unlink(missing_ok=True)


def _refuse_second(rig: Rig, server: Server, other: Server) -> None:
    attach = " use --attach, or" if other.kind == SIM and server.kind == RUN else ""
    for endpoint in set(server.endpoints) & set(other.endpoints):
        raise DriverError(
            f"{rig.name}: {endpoint.partition('@')[0]} is already served by "
            f"{other.describe()};{attach} stop that first"
        )
    if server.kind == other.kind == SIM and server.rig == other.rig:
        raise DriverError(
            f"{rig.name}: {other.describe()} already serves its devices; run with --attach, or "
            "stop that first"
        )


def _here(endpoints: Sequence[str]) -> tuple[str, ...]:
    """Return endpoints with the network namespace of their names."""
    try:
        space = os.stat("/proc/self/ns/net").st_ino
    except OSError:
        space = 0
    return tuple(f"{endpoint}@{space}" for endpoint in endpoints)


def _servers() -> list[tuple[Path, Server]]:
    """Return all registrations, dead or alive; other files are ignored."""
    servers = []
    for path in sorted(directory().glob("*.json")):
        try:
            keys = parse_json(read_guarded(path, "registration", LARGEST))
            keys["endpoints"] = tuple(keys["endpoints"])
            servers.append((path, Server(**keys)))
        except (ConfigError, ValueError, TypeError, KeyError):
            continue
    return servers


def _new(path: Path) -> TextIO:
    """Open a file for writing; the directory's mode keeps it private."""
    return os.fdopen(create(path), "w", encoding="utf-8")
