"""`tautwave keys` and `tautwave link`: who the other site is, and what the path to it is like."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import click

from tautwave.cli.options import PATH, Number, echo_json, json_option

PORT = 7447

keys_option = click.option(
    "--keys", "directory", type=PATH, required=True, metavar="DIR",
    help="Directory with this site's .pem and .key, and authority.pem; see tautwave keys init.",
)  # fmt: skip


def _name_option(key: str, default: str, text: str) -> Callable[[Any], Any]:
    return click.option(key, default=default, show_default=True, help=text)


def _bind(_ctx: click.Context, _param: click.Parameter, value: str) -> str:
    """Refuse a port in the address to listen on."""
    if ":" in value:
        from tautwave.config.keys.sites import without_port

        try:
            without_port(value, where="--port")
        except ValueError as err:
            raise click.BadParameter(f"{err}.") from None
    return value


@click.group("link", short_help="Measure the path between two sites.")
def link() -> None:
    """Measure the path between two sites: loss, delay, order, clocks.

    One site serves, the other tests; nothing moves. TCP and UDP use the same port number: forward
    both, or use a VPN.

    \b
    Examples:
        tautwave link serve --keys keys                      (on the slave's machine)
        tautwave link test 10.0.0.2 --keys keys --duration 30
    """


@link.command("serve", short_help="Let the other site test the path.")
@keys_option
@_name_option("--site", "slave", "Name of this site.")
@_name_option("--peer", "master", "Name of the other site.")
@click.option("--bind", default="", callback=_bind, help="Address to listen on; default: all.")
@click.option("--port", type=click.IntRange(0, 65535), default=PORT, show_default=True)
@click.option("--once", is_flag=True, help="End after the first test.")
def serve(directory: Path, site: str, peer: str, bind: str, port: int, once: bool) -> None:
    """Let the other site test the path; ends with Ctrl-C.

    \b
    Examples:
        tautwave link serve --keys keys
        tautwave link serve --keys keys --site clinic --peer lab --port 7000
    """
    from tautwave.sites.path import serve_tests

    for line in serve_tests(directory, site, peer, (bind, port), once=once):
        click.echo(line)


@link.command("test", short_help="Test the path to a site that is serving.")
@click.argument("address", metavar="HOST[:PORT]")
@keys_option
@_name_option("--site", "master", "Name of this site.")
@_name_option("--peer", "slave", "Name of the other site.")
@click.option(
    "--rate", type=Number(1.0, 10000.0), default=1000.0, show_default=True,
    help="Datagrams per second each way [Hz].",
)  # fmt: skip
@click.option("--duration", type=Number(1.0, 3600.0), default=10.0, show_default=True, help="[s]")
@click.option("--rig", type=PATH, help="Show what the delay means for this rig's pairs.")
@click.option(
    "--record", type=PATH, metavar="FILE",
    help="Write what was received to a CSV file: time_s, delay_s, lost.",
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
    """Test the path to a site that runs `tautwave link serve`.

    \b
    Examples:
        tautwave link test 10.0.0.2 --keys keys --duration 30
        tautwave link test 10.0.0.2 --keys keys --rig rig.yaml --record trace.csv
    """
    from tautwave.sites.path import Asked, run_test, table, trace

    result = run_test(address, directory, site, peer, Asked(rate, duration))
    if record is not None:
        from tautwave.files import write_bytes

        write_bytes(record, trace(result, rate).encode())
    if as_json:
        echo_json(result.as_dict())
        return
    for line in table(result, site, peer):
        click.echo(line)
    if rig is not None:
        from tautwave.config import load_rig

        click.echo("")
        for line in _compliance(load_rig(rig), result.delay_s):
            click.echo(line)


def _compliance(rig: Any, delay: float) -> Iterator[str]:
    from tautwave.registry import coupling_messages
    from tautwave.rig import command_delays

    messages, delays = coupling_messages(rig.coupling.law), command_delays(rig)
    for name in rig.coupling.pairs:
        offset = messages.standing(rig, name, delays, delay).offset
        if offset > 0.0:
            unit = "mrad per N m" if rig.master.axes[name].kind == "rotary" else "mm per N"
            yield (
                f"pair {name}: over {1e3 * delay:.3g} ms each way, a steady force causes an "
                f"offset of {1e3 * offset:.3g} {unit} between master and slave"
            )


@click.group("keys", short_help="Create the keys with which two sites authenticate each other.")
def keys() -> None:
    """Create the keys with which two sites authenticate each other.

    \b
    Examples:
        tautwave keys init keys
    """


@keys.command("init", short_help="Create an authority and one certificate per site.")
@click.argument("directory", type=click.Path(path_type=Path))
@click.option(
    "--site",
    "sites",
    multiple=True,
    default=("master", "slave"),
    show_default=True,
    help="Name of a site; give at least two.",
)
@click.option(
    "--days", type=click.IntRange(1, 3650), default=825, show_default=True, help="Validity [days]."
)
def init(directory: Path, sites: tuple[str, ...], days: int) -> None:
    """Create an authority and one certificate per site in DIRECTORY, which must be new or empty.

    Copy authority.pem and the site's own .pem and .key to each machine, and nothing else. The
    authority's key is not kept: to add or revoke a site, create all keys again.

    \b
    Examples:
        tautwave keys init keys
        tautwave keys init keys --site lab --site clinic --days 90
    """
    from tautwave.sites.certificates import make_authority

    for path in make_authority(directory, sites, days):
        click.echo(path)
    click.echo(
        "Copy to each site authority.pem and its own .pem and .key; then "
        "delete the remaining files here."
    )
