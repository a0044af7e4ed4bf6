"""The `tautwave` group: commands loaded when asked for, errors as sentences and exit codes."""

from __future__ import annotations

import errno
import importlib
import importlib.util
import shlex
from difflib import get_close_matches
from typing import Any, cast

import click

from tautwave import __version__
from tautwave.errors import TautwaveError

COMMANDS = ("run", "check", "sim", "scan", "sweep", "identify", "report", "drivers", "bench")
_PARSED = "tautwave.arguments"


class Commands(click.Group):
    """Commands that live in modules of their own, imported by name."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names in the order in which a person meets them."""
        return [name for name in COMMANDS if name != "bench" or _has_bench()]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import the command's module; None where there is no such command."""
        if cmd_name not in self.list_commands(ctx):
            return None
        module = importlib.import_module(f"tautwave.cli.{cmd_name}")
        return cast("click.Command", getattr(module, cmd_name))

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """As click does it, with a suggestion on a typing mistake."""
        name, known = args[0], self.list_commands(ctx)
        if name not in known and not name.startswith("-") and not ctx.resilient_parsing:
            near = get_close_matches(name, known, n=1, cutoff=0.5)
            hint = f"Did you mean {near[0]!r}?" if near else f"There are {', '.join(known)}."
            ctx.fail(f"No such command {name!r}. {hint}")
        return super().resolve_command(ctx, args)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Keep the words of the command line: they are written into the recording."""
        ctx.meta[_PARSED] = tuple(args)
        return super().parse_args(ctx, args)

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; an error becomes its sentence on stderr and its exit code."""
        try:
            return super().invoke(ctx)
        except TautwaveError as err:
            click.echo(str(err) or type(err).__name__, err=True)
            ctx.exit(err.exit_code)
        except (click.ClickException, click.exceptions.Exit, click.Abort):
            raise
        except Exception as err:  # the last boundary: nobody wants to read a traceback here
            if isinstance(err, OSError) and err.errno == errno.EPIPE:
                raise  # `tautwave check rig.yaml | head`: click ends quietly
            click.echo(_save_traceback(err, command_line(ctx)), err=True)
            ctx.exit(1)


def command_line(ctx: click.Context) -> str:
    """The command as it was typed, ready to be pasted."""
    return shlex.join(("tautwave", *ctx.meta.get(_PARSED, ())))


def _has_bench() -> bool:
    return importlib.util.find_spec("tautwave.bench") is not None


def _save_traceback(err: Exception, command: str) -> str:
    """Write the traceback into a file; return the sentence that says where it is."""
    import platform
    import sys
    import tempfile
    import traceback

    what = f"{type(err).__name__}: {err}".rstrip(": ").splitlines()[0]
    sentence = f"tautwave stopped on an error it did not expect ({what})"
    try:
        with tempfile.NamedTemporaryFile(
            "w", prefix="tautwave-error-", suffix=".txt", delete=False, encoding="utf-8"
        ) as file:
            file.write(f"{command}\n")
            file.write(f"tautwave {__version__}, Python {sys.version}, {platform.platform()}\n\n")
            file.write("".join(traceback.format_exception(err)))
    except OSError as failure:
        return f"{sentence}; its traceback could not be saved: {failure.strerror}"
    return f"{sentence}; the traceback is in {file.name}"


@click.command(
    "tautwave",
    cls=Commands,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="Exit codes: 0 fine, 2 usage or configuration, 3 not certified, 4 over the bus-time"
    " budget, 5 bus or device fault, 6 safety stop.",
)
@click.version_option(__version__, prog_name="tautwave", message="%(prog)s %(version)s")
def main() -> None:
    """Teleoperation over fieldbuses: two devices coupled by a taut string.

    A rig is one YAML file. Check it, run it, read the report:

    \b
        tautwave check configs/bench-1dof-loopback.yaml
        tautwave run configs/bench-1dof-loopback.yaml --clock fake --out runs/first
        tautwave report runs/first

    \b
    Shell completion (bash; zsh and fish likewise):
        eval "$(_TAUTWAVE_COMPLETE=bash_source tautwave)"
    """
