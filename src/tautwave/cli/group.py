"""The `tautwave` group: commands loaded on demand, errors as sentences and exit codes."""

from __future__ import annotations

import errno
import gc
import importlib
import importlib.util
import os
import shlex
import signal
import sys
from typing import Any, cast

import click

from tautwave import __version__
from tautwave.cli.terminal.streams import drop, escaped, open_streams, suppress_output_errors
from tautwave.errors import ConfigError, TautwaveError, WritingError
from tautwave.files import create, reason

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # see `tautwave.session.certified`
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # it looks through all packages

DAILY = (
    "example", "new", "check", "run", "view", "scan", "sim", "calibrate", "accept", "identify",
    "report", "export", "sweep", "doctor",
)  # fmt: skip
MORE = ("trials", "ros", "replay-bus", "drivers", "bench", "compile", "keys", "link")
COMMANDS = DAILY + MORE
MODULES = {
    "keys": "sites",
    "link": "sites",
    "new": "rigs.new",
    "calibrate": "rigs.calibrate",
    "doctor": "rigs.doctor",
    "export": "rigs.export",
    "view": "rigs.view",
    "ros": "rigs.ros",
    "trials": "rigs.trials",
    "accept": "rigs.accept",
    "replay-bus": "rigs.replay_bus",
}
"""Where a command is, if not in a module of its name."""
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS)
NO_WAY = (errno.EACCES, errno.ENAMETOOLONG, errno.ELOOP)
"""What looking at a path fails with, before anything is read or written there."""
_PARSED = "tautwave.arguments"

SELDOM = 100_000
"""Objects more than were freed, after which a command's process looks for cycles of them."""


EXIT_CODES = (
    "Exit codes: 0 fine; 1 an unexpected error, with its traceback in a file; 2 usage or "
    "configuration; 3 not certified, or the certificate invalidated by the run's measurements; 4 "
    "bus-time budget exceeded; 5 bus or device fault; 6 safety stop; 7 a recording or another "
    "result is incomplete or cannot be written (3, 5 and 6 take precedence, and the last line "
    "names both); 129, 130, 143 ended by SIGHUP, Ctrl-C, SIGTERM before anything moved; 141 the "
    "output pipe was closed early."
)


class Commands(click.Group):
    """Commands in separate modules, imported by name."""

    owns_process = False
    """Whether the process was started for one command and ends with it."""

    def main(self, args: Any = None, *more: Any, **keys: Any) -> Any:
        """As in click; without arguments from a caller the process belongs to the command."""
        self.owns_process = args is None
        if self.owns_process:
            # Keys, laws and plugins stay as long as the process: a tenth of its start went into
            # looking for some that do not.
            gc.set_threshold(SELDOM)
            open_streams()
        try:
            return super().main(args, *more, **keys)
        except OSError as err:  # of this group's own help and version
            drop(sys.stdout)
            _say(f"output: cannot be written: {reason(err)}")
            sys.exit(WritingError.exit_code)
        finally:
            if self.owns_process:
                # The process takes all memory with it; its last search for cycles is a sixth of
                # what a check costs.
                gc.freeze()

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names in the order in which a user needs them."""
        return [name for name in COMMANDS if name != "bench" or _has_bench()]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the commands of a day's work, then the others; a group of its own has one list."""
        known = self.list_commands(ctx)
        grouped = (("Daily", DAILY), ("More", MORE), ("Commands", known))
        shown: set[str] = set()
        for heading, names in grouped:
            fresh = [name for name in names if name in known and name not in shown]
            shown.update(fresh)
            commands = [(name, self.get_command(ctx, name)) for name in fresh]
            rows = [(name, one.get_short_help_str(60)) for name, one in commands if one is not None]
            if rows:
                with formatter.section(heading):
                    formatter.write_dl(rows)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import the command's module; None if there is no such command."""
        if cmd_name not in self.list_commands(ctx):
            return None
        where = MODULES.get(cmd_name, cmd_name)
        module = importlib.import_module(f"tautwave.cli.{where}")
        builtin = "_" if cmd_name == "compile" else ""
        return cast("click.Command", getattr(module, cmd_name.replace("-", "_") + builtin))

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """As in click, with a suggestion on a typing mistake."""
        name, known = args[0], self.list_commands(ctx)
        if name not in known and not name.startswith("-") and not ctx.resilient_parsing:
            from difflib import get_close_matches

            near = get_close_matches(name, known, n=1, cutoff=0.5)
            hint = f"Did you mean {near[0]!r}?" if near else f"There are {', '.join(known)}."
            ctx.fail(f"No such command {name!r}. {hint}")
        return super().resolve_command(ctx, args)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Keep the command line's arguments for the recording."""
        ctx.meta[_PARSED] = tuple(args)
        return super().parse_args(ctx, args)

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; an error becomes its sentence on stderr and its exit code."""
        try:
            return super().invoke(ctx)
        except TautwaveError as err:
            _say(str(err) or type(err).__name__)
            ctx.exit(err.exit_code)
        except click.ClickException as err:
            with suppress_output_errors(sys.stderr):
                err.show()
            ctx.exit(err.exit_code)
        except (click.exceptions.Exit, click.Abort):
            raise
        except KeyboardInterrupt as err:
            command = ctx.invoked_subcommand or "tautwave"
            message = f"{command}: ended by {str(err) or 'Ctrl-C'}"
            if command == "run":
                message += " before anything moved; no directory was created"
            _say(message)
            ctx.exit(getattr(err, "exit_code", 130))
        except Exception as err:  # noqa: BLE001  the last boundary: a traceback helps no user
            if isinstance(err, OSError) and err.errno == errno.EPIPE:
                drop(sys.stdout)  # `tautwave bench | head`: as with any other program
                ctx.exit(128 + signal.SIGPIPE)
            if isinstance(err, OSError) and err.errno in NO_ROOM:
                where = "output" if err.filename is None else str(err.filename)
                if err.filename is None:
                    drop(sys.stdout)
                _say(f"{where}: cannot be written: {reason(err)}")
                ctx.exit(WritingError.exit_code)
            if isinstance(err, OSError) and err.errno in NO_WAY and err.filename is not None:
                _say(f"{err.filename}: cannot be reached: {reason(err)}")
                ctx.exit(ConfigError.exit_code)
            _say(_save_traceback(err, command_line(ctx)))
            ctx.exit(1)


def command_line(ctx: click.Context) -> str:
    """The command as it was typed, ready to paste."""
    return shlex.join(("tautwave", *ctx.meta.get(_PARSED, ())))


def _say(sentence: str) -> None:
    """Print on stderr; if that is closed or full, the exit code still tells."""
    with suppress_output_errors(sys.stderr):
        click.echo(escaped(sentence), err=True)


def _has_bench() -> bool:
    return importlib.util.find_spec("tautwave.bench") is not None


def _save_traceback(err: Exception, command: str) -> str:
    """Write the traceback into a file; return a sentence with its path."""
    import platform
    import secrets
    import tempfile
    import traceback

    what = f"{type(err).__name__}: {err}".rstrip(": ").splitlines()[0]
    sentence = f"tautwave stopped on an unexpected error ({what})"
    try:
        folder = tempfile.gettempdir()
        path = os.path.join(folder, f"tautwave-error-{secrets.token_hex(4)}.txt")
        with open(create(path, replace=False), "w", encoding="utf-8") as file:
            file.write(f"{command}\n")
            file.write(f"tautwave {__version__}, Python {sys.version}, {platform.platform()}\n\n")
            file.write("".join(traceback.format_exception(err)))
    except OSError as failure:
        return f"{sentence}; its traceback could not be saved: {failure.strerror}"
    return f"{sentence}; the traceback is in {path}"


@click.command(
    "tautwave",
    cls=Commands,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog=EXIT_CODES,
)
@click.version_option(__version__, prog_name="tautwave", message="%(prog)s %(version)s")
def main() -> None:
    """Teleoperation over fieldbuses: two devices coupled by a taut string.

    A rig is one YAML file. Copy one, check it, run it, read the report:

    \b
        tautwave example bench-1dof-loopback
        tautwave check bench-1dof-loopback.yaml
        tautwave run bench-1dof-loopback.yaml --clock fake --out runs/first
        tautwave report runs/first

    \b
    Shell completion (bash; zsh and fish likewise):
        eval "$(_TAUTWAVE_COMPLETE=bash_source tautwave)"
    """
