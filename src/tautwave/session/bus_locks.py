"""One master at a time on a bus: a lock for each endpoint that a run opens.

The lock is a socket of an abstract name, which the kernel removes with its process, however that
ends. Its names belong to a network namespace, as CAN interfaces and addresses do. A process that
finds it taken connects to it, and the kernel says which process holds it. What serves devices,
scans or views takes none: a bus has one master, and others beside it.
"""

from __future__ import annotations

import hashlib
import os
import socket
import struct
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path

from tautwave.errors import DriverError

CREDENTIALS = struct.Struct("iII")
"""Process, user and group behind a socket, SO_PEERCRED of unix(7)."""
WITHIN_PROCESS = "virtual:"
"""python-can's own kind of bus, which reaches no other process."""
LONGEST = 100


@contextmanager
def sole_master(endpoints: Mapping[str, str]) -> Iterator[None]:
    """Be the only master of these endpoints on this machine inside the block.

    Parameters
    ----------
    endpoints : mapping
        By bus; several are separated by ", ". Empty: nothing is opened.

    Raises
    ------
    DriverError
        Another process is the master of one of them.
    """
    with ExitStack() as stack:
        for bus, named in endpoints.items():
            for endpoint in filter(None, named.split(", ")):
                if not endpoint.startswith(WITHIN_PROCESS):
                    stack.enter_context(_held(bus, endpoint))
        yield


@contextmanager
def _held(bus: str, endpoint: str) -> Iterator[None]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as lock:
        name = _name(endpoint)
        try:
            lock.bind(name)
            lock.listen()
        except OSError as err:
            holder = _holder(name)
            if holder != os.getpid():  # of this process another bus, or a part of the same command
                raise DriverError(
                    f"bus {bus}: {endpoint} has a master on this machine, {_described(holder)}; "
                    "a second one would switch off devices that are in use. End that first, or "
                    "put all devices of this bus into one rig"
                ) from err
        yield


def _name(endpoint: str) -> str:
    """Return the name of an endpoint's lock: the same for all ways to write it."""
    if endpoint.startswith("/"):
        endpoint = os.path.realpath(endpoint)
    elif endpoint.startswith("tcp://"):
        host, _, port = endpoint.removeprefix("tcp://").rpartition(":")
        try:
            addresses = socket.getaddrinfo(host.strip("[]"), port, type=socket.SOCK_STREAM)
            endpoint = "tcp://{}:{}".format(*addresses[0][4][:2])
        except OSError:  # the driver says so when it opens it
            pass
    return f"\0tautwave-bus-{hashlib.sha256(endpoint.encode()).hexdigest()[:32]}"


def _holder(name: str) -> int:
    """Return the process that holds a lock, 0 if it cannot be known."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as asking:
        try:
            asking.connect(name)
            credentials = asking.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, CREDENTIALS.size)
        except OSError:
            return 0
    return int(CREDENTIALS.unpack(credentials)[0])


def _described(process: int) -> str:
    if not process:
        return "a process that cannot be seen from here"
    try:
        words = Path(f"/proc/{process}/cmdline").read_bytes().decode(errors="replace").split("\0")
    except OSError:
        words = []
    joined = " ".join(word for word in words if word)
    shown = "".join(letter if letter.isprintable() else "?" for letter in joined)
    return f"process {process}" + (f" ({shown[:LONGEST]})" if shown else "")
