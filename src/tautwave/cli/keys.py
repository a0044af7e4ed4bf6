"""`tautwave keys`: who may be the other site."""

from __future__ import annotations

from pathlib import Path

import click


@click.group("keys", short_help="Make the keys with which two sites know each other.")
def keys() -> None:
    """Make the keys with which two sites know each other."""


@keys.command("init", short_help="Make an authority and a certificate per site.")
@click.argument("directory", type=click.Path(path_type=Path))
@click.option(
    "--site",
    "sites",
    multiple=True,
    default=("master", "slave"),
    show_default=True,
    help="Name of a site; give two or more.",
)
@click.option(
    "--days", type=click.IntRange(1, 3650), default=825, show_default=True, help="Validity [days]."
)
def init(directory: Path, sites: tuple[str, ...], days: int) -> None:
    """Make an authority and a certificate per site in DIRECTORY, which is new or empty.

    Copy to each machine authority.pem and the site's own .pem and .key, nothing else. The
    authority's own key is not kept: to add a site or to withdraw one, make all anew.

    \b
    Examples:
        tautwave keys init keys
        tautwave keys init keys --site lab --site clinic --days 90
    """
    from tautwave.link.certificates import make_authority

    for path in make_authority(directory, sites, days):
        click.echo(path)
    click.echo(
        "Copy to each site authority.pem and its own .pem and .key; then remove the rest here."
    )
