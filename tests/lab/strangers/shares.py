"""The share of right dials that get in within 5 s while strangers are at the port."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import click
from websockets.exceptions import WebSocketException

from tautwave.bench.result import Goal, Suite, Table, Value
from tautwave.bench.sites.order import free_port
from tautwave.cli.options import json_option
from tautwave.cli.terminal.measured import print_suites
from tautwave.errors import LinkError
from tautwave.session.sites.desk_line import DeskLine
from tautwave.sites.certificates import identity_files, make_authority
from tautwave.sites.control import client_context, dial
from tautwave.sites.desk import Order
from tautwave.sites.path import PURPOSE
from tests.lab.kept import append_option, append_suites
from tests.lab.strangers.crowd import HOST, KINDS
from tests.view.served import elsewhere, knock, served

COUNTS = (1, 10, 100)
SOURCES = ("others", "own")
WITHIN_S, AGAIN_S = 5.0, 0.25
SHARED = {"rate_hz": 1000.0}
MAIN = "from tautwave.cli import main; main(prog_name='tautwave')"

Dial = Callable[[], None]
"""Get in once and leave; raises `LinkError` where one attempt failed."""


@contextmanager
def serving_site(keys: Path) -> Iterator[tuple[int, Dial]]:
    """Serve as a site of a run does: the process beside its loop."""
    port = free_port()
    line = DeskLine(Order("slave", "master", True, HOST, port, str(keys), SHARED, {}))
    context = client_context(identity_files(keys, "master"))

    def once() -> None:
        channel, _ = dial((HOST, port), context, "slave", SHARED, {})
        channel.close()
        while line.poll() is not None:  # as a loop would
            pass

    try:
        _listens(port)
        yield port, once
    finally:
        line.close()


@contextmanager
def serving_link(keys: Path) -> Iterator[tuple[int, Dial]]:
    """Serve as `tautwave link serve` does."""
    port = free_port()
    words = ("link", "serve", "--keys", str(keys), "--bind", HOST, "--port", str(port))
    server = subprocess.Popen(
        [sys.executable, "-c", MAIN, *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    context = client_context(identity_files(keys, "master"))
    facts = {"rate_hz": 1000.0, "duration_s": 1.0}

    def once() -> None:
        channel, _ = dial((HOST, port), context, "slave", PURPOSE, facts)
        channel.receive()
        channel.close()

    try:
        _listens(port)
        yield port, once
    finally:
        server.kill()
        server.wait()


@contextmanager
def serving_page(keys: Path) -> Iterator[tuple[int, Dial]]:
    """Serve the page of a run by TLS; who shows the token is in."""
    with tempfile.TemporaryDirectory() as text:
        (Path(text) / "run").mkdir()
        closed, context = elsewhere(Path(text) / "keys")
        with served(Path(text) / "run", door=closed) as (_, door):

            def once() -> None:
                try:
                    with knock(door, context, open_timeout=WITHIN_S) as socket:
                        socket.send(json.dumps({"op": "hello", "token": door.token}))
                        socket.recv(WITHIN_S)
                except (OSError, TimeoutError, WebSocketException) as err:
                    raise LinkError(str(err)) from err

            yield door.port, once


SERVING = {"site": (serving_site, 0.0), "link": (serving_link, 3.5), "page": (serving_page, 0.0)}
"""What serves, and how long it is busy with one that got in and left [s]."""


def _listens(port: int) -> None:
    for _ in range(600):
        found = Path("/proc/net/tcp").read_text(encoding="ascii")
        if f"0100007F:{port:04X} 00000000:0000 0A" in found:
            return
        time.sleep(0.1)
    raise click.ClickException(f"nothing serves port {port}")


@contextmanager
def strangers(port: int, kind: str, count: int, source: str, keys: Path) -> Iterator[None]:
    """Keep strangers at a port."""
    words = [str(port), kind, str(count), source, str(keys)]
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.lab.strangers.crowd", *words],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        assert process.stdout is not None
        if process.stdout.readline() != b"here\n":
            raise click.ClickException(f"the strangers ({kind}) did not come")
        yield
    finally:
        process.kill()
        process.communicate()


def entered(once: Dial) -> float | None:
    """Dial as a site does, again after each failure; return when it got in [s], None if late."""
    began = time.monotonic()
    while (spent := time.monotonic() - began) < WITHIN_S:
        with suppress(LinkError):
            once()
            spent = time.monotonic() - began
            return spent if spent <= WITHIN_S else None
        time.sleep(AGAIN_S)
    return None


def measure(whom: Sequence[str], kinds: Sequence[str], counts: Sequence[int], dials: int) -> Suite:
    """Measure the share of right dials for what serves, each kind, number and origin."""
    rows: list[list[Value]] = []
    with tempfile.TemporaryDirectory() as text:
        ours, theirs = Path(text) / "ours", Path(text) / "theirs"
        for keys in (ours, theirs):
            make_authority(keys, ["master", "slave"])
        for name in whom:
            serve, busy_s = SERVING[name]
            for kind in kinds:
                for source in SOURCES:
                    for count in counts:
                        took: list[float | None] = []
                        with (
                            serve(ours) as (port, once),
                            strangers(port, kind, count, source, theirs),
                        ):
                            for _ in range(dials):
                                took.append(entered(once))
                                time.sleep(busy_s if took[-1] is not None else 0.0)
                        got = [one for one in took if one is not None]
                        share = len(got) / dials
                        rows.append([name, kind, source, count, share, max(got, default=None)])
    table = Table(
        "Strangers",
        f"share of {dials} right dials that got in within {WITHIN_S:g} s, and the longest of these,"
        " while strangers of a kind were at the port, from other loopback addresses or from that "
        "of the right peer",
        ("serving", "strangers", "from", "count", "share", "longest_s"),
        rows,
    )
    least = min(float(row[4] or 0.0) for row in rows)
    return Suite("strangers", [table], [Goal("least share", 1.0, "", least, at_least=True)])


@click.command("strangers", short_help="Right dials that get in while strangers are at the port.")
@click.option("--serving", "whom", multiple=True, type=click.Choice(list(SERVING)),
              default=tuple(SERVING), help="What serves; default: all.")  # fmt: skip
@click.option("--kind", "kinds", multiple=True, type=click.Choice(list(KINDS)),
              default=tuple(KINDS), help="Strangers; default: all kinds.")  # fmt: skip
@click.option("--count", "counts", multiple=True, type=click.IntRange(0, 1000), default=COUNTS,
              show_default=True, help="Strangers at once.")  # fmt: skip
@click.option("--dials", type=click.IntRange(1), default=10, show_default=True,
              help="Right dials of each cell.")  # fmt: skip
@append_option
@json_option
def shares(
    whom: Sequence[str],
    kinds: Sequence[str],
    counts: Sequence[int],
    dials: int,
    append: Path | None,
    as_json: bool,
) -> None:
    """Measure the share of right dials that get in within 5 s while strangers are at the port.

    Five kinds of strangers, each with one connection at a time that it renews at once: silent,
    dripping (a byte every 0.3 s), half (begins TLS), foreign (another authority), hasty (resets).

    \b
    Examples:
        python -m tests.lab strangers
        python -m tests.lab strangers --serving site --kind half --count 100
    """
    suites = [measure(whom, kinds, counts, dials)]
    append_suites(append, suites)
    print_suites(suites, as_json)
