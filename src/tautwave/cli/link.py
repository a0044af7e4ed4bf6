"""`tautwave link`: what the path between two sites is like, before anything moves."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import click

from tautwave.cli.options import PATH, echo_json, json_option

PORT = 7447

keys_option = click.option(
    "--keys", "directory", type=PATH, required=True, metavar="DIR",
    help="Where this site's .pem and .key and authority.pem are; see tautwave keys init.",
)  # fmt: skip


def _name_option(key: str, default: str, text: str) -> Callable[[Any], Any]:
    return click.option(key, default=default, show_default=True, help=text)


@click.group("link", short_help="Measure the path between two sites.")
def link() -> None:
    """Measure the path between two sites: loss, delay, order, clocks.

    One site serves, the other tests; nothing moves. TCP and UDP use the same port number: forward
    both, or use a VPN of your own.

    \b
    Examples:
        tautwave link serve --keys keys                      (on the slave's machine)
        tautwave link test 10.0.0.2 --keys keys --duration 30
    """


@link.command("serve", short_help="Let the other site test the path.")
@keys_option
@_name_option("--site", "slave", "Name of this site.")
@_name_option("--peer", "master", "Name of the other site.")
@click.option("--bind", default="", help="Address to serve at; default: all.")
@click.option("--port", type=click.IntRange(0, 65535), default=PORT, show_default=True)
@click.option("--once", is_flag=True, help="End after the first test.")
def serve(directory: Path, site: str, peer: str, bind: str, port: int, once: bool) -> None:
    """Let the other site test the path; ends with Ctrl-C."""
    from tautwave.link.path import serve_tests

    for line in serve_tests(directory, site, peer, (bind, port), once=once):
        click.echo(line)


@link.command("test", short_help="Test the path to a site that serves.")
@click.argument("address", metavar="HOST[:PORT]")
@keys_option
@_name_option("--site", "master", "Name of this site.")
@_name_option("--peer", "slave", "Name of the other site.")
@click.option(
    "--rate", type=click.FloatRange(1.0, 10000.0), default=1000.0, show_default=True,
    help="Datagrams a second each way [Hz].",
)  # fmt: skip
@click.option(
    "--duration", type=click.FloatRange(1.0, 3600.0), default=10.0, show_default=True, help="[s]"
)
@click.option("--rig", type=PATH, help="Say what the delay means for this rig's pairs.")
@click.option(
    "--record", type=PATH, metavar="FILE",
    help="Write what came from there: a CSV of time_s, delay_s, lost.",
)  # fmt: skip
@json_option
def test(
    address: str,
    directory: Path,
    site: str,
    peer: str,
    rate: float,
    duration: float,
    rig: Path | None,
    record: Path | None,
    as_json: bool,
) -> None:
    """Test the path to a site that runs `tautwave link serve`."""
    from tautwave.link.path import Asked, run_test, table, trace

    found = run_test(address, directory, site, peer, Asked(rate, duration))
    if record is not None:
        from tautwave.files import write_bytes

        write_bytes(record, trace(found, rate).encode())
    if as_json:
        echo_json(found.as_dict())
        return
    for line in table(found, site, peer):
        click.echo(line)
    if rig is not None:
        from tautwave.config import load_rig

        click.echo("")
        for line in _compliance(load_rig(rig), found.delay_s):
            click.echo(line)


def _compliance(rig: Any, delay: float) -> Iterator[str]:
    for name, pair in rig.coupling.pairs.items():
        impedance = getattr(pair, "wave_impedance", None)
        if isinstance(impedance, float):
            rotary = rig.master.axes[name].kind == "rotary"
            unit = "mrad per N m" if rotary else "mm per N"
            yield (
                f"pair {name}: a line of {1e3 * delay:.3g} ms each way at wave_impedance "
                f"{impedance:g} gives {1e3 * delay / impedance:.3g} {unit} (tau / b)"
            )
