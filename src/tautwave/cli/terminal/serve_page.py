"""The page of a run, from a process of its own: `view --page`, or beside a `run --view`."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path

import click

from tautwave.errors import ConfigError

WAIT_S = 600.0
"""A certificate, a calibration and a slow bus may come before the first row."""

END_S = 3.0


def serve_page(
    directory: Path,
    address: str,
    port: int,
    certificate: Path | None,
    key: Path | None,
    wait_s: float,
    foxglove: Sequence[str] | None = None,
    starter: int | None = None,
) -> None:
    """Serve a run's page until the run or the user ends it.

    With `foxglove`, the origins that may use it, Foxglove's protocol is served too; with `starter`,
    the run's process, a run that has not begun ends with it.

    Raises
    ------
    ConfigError
        The extra `view` is missing, the address cannot be served, or others would reach it.
    """
    require_view()
    from tautwave.view.guard import open_door
    from tautwave.view.server import serve_run

    door = open_door(address, port, certificate, key)

    def announce(url: str) -> None:
        click.echo(f"page: {url}")
        if foxglove is not None:
            page, _, token = url.partition("/#")
            click.echo(f"foxglove: {page.replace('http', 'ws', 1)}/foxglove?token={token}")
            click.echo(f"its layout: {page}/foxglove-layout.json")

    serve_run(
        directory,
        door,
        announce,
        patience_s=wait_s,
        foxglove=foxglove is not None,
        origins=foxglove or (),
        starter=starter,
    )
    click.echo(f"{directory}: the run has ended; `tautwave report {directory}` writes its report")


def require_view() -> None:
    """Refuse if what the page needs is not installed.

    Raises
    ------
    ConfigError
        It is not.
    """
    if find_spec("websockets") is None:
        raise ConfigError("the page needs websockets; pip install 'tautwave[view]'")


@contextmanager
def page_beside(directory: Path, wanted: bool) -> Iterator[None]:
    """Serve the page of the run in the block from another process, whose fate the run ignores."""
    if not wanted:
        yield
        return
    require_view()
    child = subprocess.Popen(
        [sys.executable, "-m", __name__, str(directory), str(os.getpid())],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        start_new_session=True,  # Ctrl-C is for the loop
        preexec_fn=lambda: os.nice(10),
    )
    try:
        assert child.stdout is not None
        click.echo(child.stdout.readline().decode().strip() or "no page", err=True)
        yield
    finally:
        with suppress(subprocess.TimeoutExpired):
            child.wait(END_S)
        if child.poll() is None:
            child.terminate()
            child.wait()


def main() -> int:
    """Serve the page of the run in argv[1], which the process argv[2] has started."""
    from tautwave.errors import TautwaveError

    directory, starter = Path(sys.argv[1]), int(sys.argv[2])
    try:
        serve_page(directory, "127.0.0.1", 0, None, None, WAIT_S, starter=starter)
    except TautwaveError as error:
        click.echo(f"page: {error}", err=True)
        return error.exit_code
    except KeyboardInterrupt:
        return 0
    return 0


if __name__ == "__main__":
    sys.exit(main())
