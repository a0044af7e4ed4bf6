"""`tautwave bench`: what this machine can do. Offered where `tautwave.bench` is installed."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Any

import click

from tautwave.cli.options import echo_json, json_option, positive


@click.group(short_help="Measure loop timing and cost per step on this machine.")
def bench() -> None:
    """Measure loop timing and cost per step on this machine.

    \b
    Examples:
        tautwave bench loop --duration 60
        tautwave bench laws --json
    """


@bench.command(short_help="Period, lateness and compute time of the live loop.")
@click.option(
    "--duration",
    type=float,
    default=10.0,
    show_default=True,
    callback=positive,
    metavar="S",
    help="How long the real-time loop runs [s].",
)
@json_option
def loop(duration: float, as_json: bool) -> None:
    """Run the live loop on loopback devices and time it.

    \b
    Example:
        tautwave bench loop --duration 60
    """
    _print(_backend().loop(duration_s=duration), as_json)


@bench.command(short_help="Cost per step of each law, live and compiled.")
@json_option
def laws(as_json: bool) -> None:
    """Measure the cost per step of each law: live, compiled, and in plain C.

    \b
    Example:
        tautwave bench laws --json
    """
    _print(_backend().laws(), as_json)


def _backend() -> Any:
    return importlib.import_module("tautwave.bench")


def _print(result: Mapping[str, Any], as_json: bool) -> None:
    if as_json:
        echo_json(result)
    else:
        for line in _backend().lines(result):
            click.echo(line)
