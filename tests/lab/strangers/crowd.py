"""Strangers at a TCP port, in a process of their own.

`python -m tests.lab.strangers.crowd PORT KIND COUNT FROM DIRECTORY`: FROM is `own`, the address of
the right peer on this machine, or `others`. DIRECTORY has the keys of another authority. Each
stranger has one connection at a time and comes again as soon as it is closed. It prints a line once
every stranger has been connected, and ends with its standard input.
"""

from __future__ import annotations

import asyncio
import socket
import ssl
import struct
import sys
from collections.abc import Awaitable, Callable
from contextlib import suppress
from functools import cache
from pathlib import Path

from tautwave.sites.certificates import identity_files
from tautwave.sites.control import client_context

HOST = "127.0.0.1"
PATIENT_S, DRIP_S, LATER_S = 5.0, 0.3, 20.0
ADDRESSES = 200
"""Of other strangers: 127.0.0.2 and on."""

Stay = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]


async def silent(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Say nothing, and come again after 5 s."""
    with suppress(TimeoutError):
        await asyncio.wait_for(reader.read(), PATIENT_S)


async def dripping(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Say 30 bytes that mean nothing, and one more every 0.3 s."""
    writer.write(b"x" * 30)
    while True:
        await writer.drain()
        await asyncio.sleep(DRIP_S)
        writer.write(b"x")


async def half(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Begin TLS, and say nothing more."""
    writer.write(client_hello())
    with suppress(TimeoutError):
        await asyncio.wait_for(asyncio.sleep(LATER_S), LATER_S)


async def hasty(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Say what means nothing, and reset the connection."""
    writer.write(b"x" * 30)
    linger = struct.pack("ii", 1, 0)
    writer.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)


async def foreign(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Present the certificate of another authority, and read why not."""
    await reader.read()


KINDS: dict[str, Stay] = {
    "silent": silent, "dripping": dripping, "half": half, "foreign": foreign, "hasty": hasty,
}  # fmt: skip


@cache
def client_hello() -> bytes:
    """Return the first bytes of a handshake."""
    came, goes = ssl.MemoryBIO(), ssl.MemoryBIO()
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    with suppress(ssl.SSLWantReadError):
        context.wrap_bio(came, goes, server_hostname="slave").do_handshake()
    return goes.read()


async def stranger(
    port: int, source: str, stay: Stay, context: ssl.SSLContext | None, met: asyncio.Event
) -> None:
    """Come again and again."""
    while True:
        try:
            reader, writer = await asyncio.open_connection(
                HOST, port, local_addr=(source, 0), ssl=context
            )
        except OSError:
            met.set()
            await asyncio.sleep(0.0)
            continue
        met.set()
        with suppress(OSError):
            await stay(reader, writer)
        writer.transport.abort()
        await asyncio.sleep(0.0)


async def crowd(port: int, kind: str, count: int, source: str, directory: Path) -> None:
    """Keep so many strangers at a port until the standard input ends."""
    context = None
    if kind == "foreign":
        context = client_context(identity_files(directory, "master"))
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    met = [asyncio.Event() for _ in range(count)]
    tasks = [
        asyncio.create_task(
            stranger(port, HOST if source == "own" else f"127.0.0.{2 + number % ADDRESSES}",
                     KINDS[kind], context, event)
        )
        for number, event in enumerate(met)
    ]  # fmt: skip
    for event in met:
        await event.wait()
    sys.stdout.write("here\n")
    sys.stdout.flush()
    await asyncio.to_thread(sys.stdin.read)
    for task in tasks:
        task.cancel()


if __name__ == "__main__":
    _, at, what, many, whence, keys = sys.argv
    asyncio.run(crowd(int(at), what, int(many), whence, Path(keys)))
