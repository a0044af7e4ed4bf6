"""The foreign devices on the real clock: a servo line on a pseudo-terminal, a drive on TCP."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import threading
import tty
from collections.abc import Callable, Iterator
from typing import Any

TICK_S = 0.001
"""How often what is due is sent, and time passes for the devices."""


@contextlib.contextmanager
def on_pty(line: Any) -> Iterator[str]:
    """Serve a transport on a pseudo-terminal; yield its path."""
    master, slave = os.openpty()
    tty.setraw(slave)
    try:
        with _thread(lambda done: _pump(line, master, done)):
            yield os.ttyname(slave)
    finally:
        os.close(slave)
        os.close(master)


@contextlib.contextmanager
def on_tcp(connect: Callable[[], Any]) -> Iterator[str]:
    """Serve what `connect` returns for each connection on TCP; yield its endpoint."""
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def serve(done: threading.Event) -> None:
            listener.settimeout(0.02)
            threads = []
            while not done.is_set():
                with contextlib.suppress(TimeoutError):
                    peer, _ = listener.accept()
                    peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                    threads.append(threading.Thread(target=_converse, args=(connect(), peer, done)))
                    threads[-1].start()
            for thread in threads:
                thread.join()

        with _thread(serve):
            yield f"tcp://127.0.0.1:{listener.getsockname()[1]}"


def _converse(port: Any, peer: socket.socket, done: threading.Event) -> None:
    with peer:
        _pump(port, peer.fileno(), done)


def _pump(port: Any, descriptor: int, done: threading.Event) -> None:
    """Pass bytes both ways until it is over, or the other end has gone."""
    with contextlib.suppress(OSError):
        while not done.is_set():
            if select.select([descriptor], [], [], TICK_S)[0]:
                data = os.read(descriptor, 4096)
                if not data:
                    return
                port.write(data)
            if answer := port.read():
                os.write(descriptor, answer)


@contextlib.contextmanager
def _thread(work: Callable[[threading.Event], None]) -> Iterator[None]:
    done = threading.Event()
    thread = threading.Thread(target=work, args=(done,))
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()
