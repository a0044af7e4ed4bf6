"""`tautwave scan`: what is on a bus."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from inspect import signature
from typing import Any

import click

from tautwave.contracts import DriverPlugin, ScanProgress
from tautwave.errors import ConfigError


@click.command(
    short_help="Find the devices on a bus.",
    context_settings={
        "ignore_unknown_options": True,
        "allow_extra_args": True,
        "help_option_names": [],
    },
    add_help_option=False,
)
@click.argument("driver", required=False)
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of a table.")
@click.option("-h", "--help", "wants_help", is_flag=True, help="Show this message and exit.")
@click.pass_context
def scan(ctx: click.Context, driver: str | None, as_json: bool, wants_help: bool) -> None:
    """Find the devices on a bus. `tautwave scan DRIVER --help` shows the options of a driver.

    Enables nothing and writes nothing to a device.

    \b
    Examples:
        tautwave scan canopen --interface socketcan --channel can0
        tautwave scan dynamixel --port /dev/ttyUSB0 --json
    """
    if driver is None:
        click.echo(ctx.get_help())
        return
    from tautwave.cli.options import echo_json
    from tautwave.cli.terminal.model_options import parse_model, print_help
    from tautwave.cli.terminal.progress import Progress
    from tautwave.cli.terminal.show import show
    from tautwave.registry import load_driver, require_modules
    from tautwave.tables import Table

    plugin = load_driver(driver)
    if plugin.scan_options is None:
        raise ConfigError(f"scan: driver {driver} does not support scanning")
    if wants_help:
        print_help(f"scan {driver}", f"Find devices: {plugin.summary}.", plugin.scan_options)
        return
    options = parse_model(plugin.scan_options, ctx.args, f"scan {driver}")
    require_modules(driver)
    with Progress(f"scan {driver}") as progress:
        devices = [dict(device) for device in _scanned(plugin, options, progress)]
    if as_json:
        echo_json(devices)
        return
    if not devices:
        click.echo(f"scan: no response on {driver}", err=True)
        return
    columns = tuple(dict.fromkeys(key for device in devices for key in device))
    rows = [tuple(_cell(device.get(key)) for key in columns) for device in devices]
    show([Table(f"Devices on {driver}", columns, rows)])


def _scanned(
    plugin: DriverPlugin, options: Any, progress: ScanProgress
) -> Sequence[Mapping[str, Any]]:
    """Scan; a plugin whose scan takes only the options shows no progress."""
    scan: Any = plugin.scan
    try:
        signature(scan).bind(options, progress)
    except TypeError:
        devices: Sequence[Mapping[str, Any]] = scan(options)
        return devices
    return plugin.scan(options, progress)


def _cell(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, list | tuple):
        return ", ".join(str(item) for item in value)
    return str(value)
