"""Arguments and options that several commands share."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import click

from tautwave.cli.terminal.streams import suppress_output_errors
from tautwave.errors import ConfigError
from tautwave.kinds import RUN, kind_of_keys, kind_of_path, mistaken

PATH = click.Path(path_type=Path)


class Number(click.FloatRange):
    """A finite number in a range; click itself takes `nan` as in any."""

    name = "number"

    def _describe_range(self) -> str:
        """Return the range for the help text; click has `x<=None` for one without bounds."""
        return "" if self.min is None and self.max is None else super()._describe_range()

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the number."""
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number.", param, ctx)
        return number


class Whole(click.IntRange):
    """A whole number from `least` on that a machine can count."""

    def __init__(self, least: int) -> None:
        super().__init__(least, 2**53)

    def _describe_range(self) -> str:
        """Return the range for the help text: its end is left out."""
        return f"x>={self.min}"


def of_kind(*wanted: str) -> Callable[..., Any]:
    """Return a callback for paths that refuses one of another kind by what it is."""

    def check(ctx: click.Context, _param: click.Parameter, value: Any) -> Any:
        if not ctx.resilient_parsing and value is not None:
            for path in value if isinstance(value, tuple) else (value,):
                refuse_other(path, *wanted)
        return value

    return check


def refuse_other(path: Path, *wanted: str) -> None:
    """Refuse what is there, but of another kind; what cannot be determined is left to its reader.

    Raises
    ------
    ConfigError
        It is none of the `wanted` kinds; the sentence says what it is.
    """
    from tautwave.config.text.document import open_document, read_text

    kind = kind_of_path(path)
    if not kind and path.is_file():
        with suppress(ConfigError):
            kind = kind_of_keys(open_document(read_text(path, "file"), "", path, "file").value)
    if sentence := mistaken(path, kind, *wanted):
        raise ConfigError(sentence)


run_argument = click.argument("directory", type=PATH, metavar="DIR", callback=of_kind(RUN))
rig_argument = click.argument("rig", type=PATH)

set_option = click.option(
    "--set",
    "overrides",
    multiple=True,
    metavar="KEY=VALUE",
    help="Change one key of the rig, typed and checked like the file; may be repeated."
    " Example: --set coupling.delay_s=0.05",
)

EVERY_BUS = ""


def _simulated(
    ctx: click.Context, param: click.Parameter, value: tuple[str, ...]
) -> bool | tuple[str, ...]:
    """Return True if no bus is named, else the names."""
    for name in value:
        if name.endswith((".yaml", ".yml")):
            raise click.BadParameter(
                f"took {name!r} as a bus name; put it after the rig file", ctx, param
            )
    return True if EVERY_BUS in value else value


simulate_option = click.option(
    "--simulate",
    is_flag=False,
    flag_value=EVERY_BUS,
    multiple=True,
    metavar="[BUS]",
    callback=_simulated,
    help="Simulate BUS although it names hardware (a serial port, a TCP address, a physical CAN"
    " channel); may be repeated. Without a name: every bus. Comes after RIG.",
)


def file_options(for_what: str) -> Callable[[Any], Any]:
    """What files do not say themselves, for the files of one option or argument."""
    options = (
        click.option(
            "--time-unit",
            type=click.Choice(("s", "ms", "us", "ns")),
            help=f"{for_what}: unit of the time column; default: from its name and values.",
        ),
        click.option(
            "--rate",
            type=float,
            callback=positive,
            metavar="HZ",
            help=f"{for_what}: rows are evenly spaced at this rate; its own times are not read.",
        ),
        click.option(
            "--columns",
            metavar="A,B",
            help=f"{for_what}: names of the columns of a text file without a heading.",
        ),
        click.option(
            "--episode",
            type=Whole(0),
            metavar="N",
            help=f"{for_what}: the episode of a LeRobot dataset; default: its only one.",
        ),
    )

    def decorate(command: Any) -> Any:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


def stated_of(options: Mapping[str, Any]) -> Any:
    """Return the `recordings.stated.Stated` of the values of `file_options`, by their names."""
    from tautwave.recordings.stated import Stated

    names = options["columns"]
    columns = tuple(name.strip() for name in names.split(",")) if names else ()
    return Stated(options["time_unit"], options["rate"], columns, options["episode"])


CLOCK = "real: real time; fake: as fast as possible, reproducible, no devices."
RUN_FLAGS = {
    "--allow-unwatched": "Run devices without a watchdog.",
    "--configure": "Write lasting settings that differ into devices.",
    "--attach": "Use simulated devices that `tautwave sim RIG` already serves in another terminal.",
}


def clock_option(text: str = CLOCK) -> Callable[[Any], Any]:
    """`--clock`, with its own help text where it is for some inputs only."""
    return click.option(
        "--clock",
        type=click.Choice(["real", "fake"]),
        default="real",
        show_default=True,
        help=text,
    )


def run_flags(*names: str, of: str = "") -> Callable[[Any], Any]:
    """Flags of run that other commands have, too; `of`: the input that they are for."""

    def add(command: Any) -> Any:
        for name in reversed(names):
            text = RUN_FLAGS[name]
            text = f"{of}{text[0].lower()}{text[1:]}" if of else text
            command = click.option(name, is_flag=True, help=text)(command)
        return command

    return add


site_option = click.option(
    "--site",
    type=click.Choice(["master", "slave"]),
    help="The half of a rig for two machines that runs here; the other half's buses are ignored.",
)


def at_site(overrides: tuple[str, ...], site: str | None) -> tuple[str, ...]:
    """Return overrides of a rig, of which this machine runs one half."""
    return overrides if site is None else (*overrides, f"sites.here={site}")


json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON instead of tables.")


wait_option = click.option(
    "--wait",
    type=Number(0.0, 3600.0),
    default=0.0,
    metavar="S",
    help="Wait this long for a run to start [s].",
)


def out_option(text: str) -> Callable[[Any], Any]:
    """`--out DIR` with its own help text."""
    return click.option("--out", type=PATH, metavar="DIR", help=text)


def positive(ctx: click.Context, param: click.Parameter, value: float | None) -> float | None:
    """Accept only finite numbers above 0; click's FloatRange accepts NaN and inf."""
    if value is not None and not (value > 0.0 and math.isfinite(value)):
        raise click.BadParameter(f"must be a finite number above 0 (got {value:g})", ctx, param)
    return value


def echo_json(value: Any) -> None:
    """Print `value` as readable JSON."""
    with suppress_output_errors(sys.stdout, BrokenPipeError):
        click.echo(json.dumps(value, indent=2, ensure_ascii=False))
