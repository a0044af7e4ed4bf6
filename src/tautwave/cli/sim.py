"""`tautwave sim`: simulated devices on real endpoints, for this or any other software."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

import click

from tautwave.cli.options import set_option, simulate_option
from tautwave.errors import ConfigError


@click.command(
    short_help="Serve simulated devices on real endpoints.",
    context_settings={
        "ignore_unknown_options": True,
        "allow_extra_args": True,
        "help_option_names": [],
    },
    add_help_option=False,
)
@click.argument("what", metavar="RIG|DRIVER", required=False)
@set_option
@simulate_option
@click.option(
    "--hand",
    is_flag=True,
    help="DRIVER: move the devices with lines on stdin, `IDS POSITION [SECONDS]` or `IDS free`.",
)
@click.option("-h", "--help", "wants_help", is_flag=True, help="Show this message and exit.")
@click.pass_context
def sim(
    ctx: click.Context,
    what: str | None,
    overrides: tuple[str, ...],
    simulate: bool | tuple[str, ...],
    hand: bool,
    wants_help: bool,
) -> None:
    """Serve the simulated devices of RIG, or of DRIVER without a rig, until interrupted.

    Prints one line of JSON per endpoint on stdout, then nothing. `tautwave sim DRIVER --help` shows
    the options of a driver. `tautwave run RIG --attach` finds the served devices of RIG.

    \b
    Examples:
        tautwave sim configs/bench-canopen-vcan.yaml
        tautwave sim canopen --nodes 1,2 --interface socketcan --channel vcan0
        tautwave sim dynamixel --model XM430-W350 --ids 1,2 --hand
        tautwave sim modbus --profile dsy-rs --tcp 127.0.0.1:0
    """
    if what is None:
        click.echo(ctx.get_help())
        return
    if _is_rig(what):
        if wants_help:
            click.echo(ctx.get_help())
            return
        if hand:
            raise ConfigError(
                "sim: --hand is for devices without a rig; a rig file has `simulation.hand`"
            )
        if ctx.args:
            raise ConfigError(f"sim: {ctx.args[0]!r} cannot be combined with a rig file; use --set")
        _serve_rig(Path(what), overrides, simulate)
        return
    _serve_driver(what, ctx.args, wants_help, hand=hand)


def _is_rig(what: str) -> bool:
    return Path(what).suffix in (".yaml", ".yml") or "/" in what or Path(what).is_file()


def _serve_driver(driver: str, arguments: list[str], wants_help: bool, *, hand: bool) -> None:
    from tautwave.cli.terminal.model_options import parse_model, print_help
    from tautwave.registry import driver_names, load_simulator, require_modules

    plugin = load_simulator(driver)
    if plugin.bench is None or plugin.bench_options is None or plugin.serve is None:
        raise ConfigError(f"sim: {driver} has no endpoint that other software can open")
    if wants_help:
        print_help(f"sim {driver}", f"Serve {plugin.summary}.", plugin.bench_options)
        return
    if driver in driver_names():
        require_modules(driver)
    bench = plugin.bench(parse_model(plugin.bench_options, arguments, f"sim {driver}"))

    from tautwave.config.keys.coupling import Loop
    from tautwave.session.serving import print_line, serve

    look = None
    if hand:
        from tautwave.session.guided.hands import TypedHands

        hands = TypedHands(sys.stdin.fileno(), lambda text: click.echo(text, err=True))
        bench = hands.on(bench)
        look = hands.look
    serve(driver, bench, print_line, Loop().fifo_priority, look)


def _serve_rig(path: Path, overrides: tuple[str, ...], simulate: bool | tuple[str, ...]) -> None:
    from tautwave.config import load_rig
    from tautwave.session.devices import serve_rig
    from tautwave.session.serving import print_line

    rig = load_rig(path, overrides, choose=False)

    def ready(buses: Sequence[str]) -> None:
        command = ["tautwave", "run", str(path)]
        for override in overrides:
            command += ["--set", override]
        for bus in buses:
            command += ["--simulate", bus]
        click.echo(
            f"{rig.name}: served by process {os.getpid()} until Ctrl-C; in another terminal: "
            f"{shlex.join([*command, '--attach'])}",
            err=True,
        )

    serve_rig(rig, simulate, print_line, ready)
