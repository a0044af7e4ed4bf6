"""`tautwave run`: one run from rig file to report."""

from __future__ import annotations

import json
import os
import re
import sys
from contextlib import nullcontext, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import cast

import click

from tautwave.cli.group import EXIT_CODES, Commands, command_line
from tautwave.cli.options import (
    at_site,
    clock_option,
    out_option,
    positive,
    rig_argument,
    run_flags,
    set_option,
    simulate_option,
    site_option,
)
from tautwave.errors import ConfigError
from tautwave.files import make_directory, writing
from tautwave.runtime.interrupts import interrupts

POINTER_S = 60.0
"""Duration of a run with --pointer, where none is given [s]."""


@click.command(short_help="Run a rig: check, move, record, report.", epilog=EXIT_CODES)
@rig_argument
@click.option(
    "--duration",
    type=float,
    callback=positive,
    metavar="S",
    help="Duration of the run [s]; default: from the rig.",
)
@out_option("Output directory, new or empty; default: runs/NAME-DATE-TIME (UTC).")
@clock_option()
@set_option
@site_option
@click.option("--allow-uncertified", is_flag=True, help="Run a rig that is not certified.")
@run_flags("--allow-unwatched", "--configure")
@simulate_option
@run_flags("--attach")
@click.option(
    "--commands",
    metavar="FILE",
    help="Commands for an operated rig: a file of lines `TIME COMMAND`, or - to read them from "
    "stdin.",
)
@click.option(
    "--task",
    metavar="TEXT",
    help="What is done in the episodes of an operated rig that name nothing else, for a dataset.",
)
@click.option(
    "--end-with-input",
    is_flag=True,
    help="With --commands -: stop when the input ends, for example because the program that "
    "writes it was killed.",
)
@click.option("--quiet", is_flag=True, help="Print only the summary at the end.")
@click.option(
    "--verbose",
    "-v",
    is_flag=True,
    help="Print all numbers at the end: books, timing, every pair, elements left out, files.",
)
@click.option(
    "--allow-tuning",
    is_flag=True,
    help="Allow anyone with the page's token to change tunable parameters.",
)
@click.option(
    "--view", is_flag=True, help="Serve the live page during the run, and print its address."
)
@click.option(
    "--pointer",
    is_flag=True,
    help="Move simulated masters by the mouse or a finger on the live page, which is served.",
)
@click.option(
    "--play",
    is_flag=True,
    help="Play the sound of a scene after the run, if there is an audio device.",
)
@click.pass_context
@interrupts()
def run(
    ctx: click.Context,
    rig: Path,
    duration: float | None,
    out: Path | None,
    clock: str,
    overrides: tuple[str, ...],
    site: str | None,
    allow_uncertified: bool,
    allow_unwatched: bool,
    configure: bool,
    simulate: bool | tuple[str, ...],
    attach: bool,
    commands: str | None,
    task: str | None,
    end_with_input: bool,
    quiet: bool,
    verbose: bool,
    view: bool,
    allow_tuning: bool,
    pointer: bool,
    play: bool,
) -> None:
    """Run RIG: check it, move, record, report.

    The first lines show how each bus runs: hardware, simulated here, or simulated elsewhere.
    Hardware named in the rig is opened unless --simulate is given.

    Ctrl-C, SIGTERM and a closed terminal (SIGHUP) ramp down, write the report and exit with 0; a
    second one stops immediately, and one during the report aborts only the report. The run's
    directory holds rig.yaml, summary.json, recording.mcap, report.html and its figures. On a
    terminal the prompt is back once the run is judged, and the figures are drawn in the background
    (not with --play); anywhere else, also in a pipe, the command ends when all files are there.

    A rig with an `operate` block accepts commands. Keys at the terminal: space engages and
    disengages, c clutches, p holds, r rests, e starts and ends an episode, q stops.

    \b
    Examples:
        tautwave run configs/bench-1dof-loopback.yaml
        tautwave run rig.yaml --clock fake --duration 2 --out runs/quick
        tautwave run rig.yaml --simulate arm
        tautwave run rig.yaml --view
        tautwave run rig.yaml --task "pick the red block"
        tautwave run rig.yaml --set coupling.delay_s=0.1 --set rate_hz=500
        tautwave run configs/scene-granular.yaml --play
        tautwave run configs/scene-resonator.yaml --pointer
        tautwave run rig.yaml --site slave
    """
    from tautwave.cli.terminal.keys import command_sources, keys_of
    from tautwave.cli.terminal.progress import Progress
    from tautwave.cli.terminal.serve_page import page_beside
    from tautwave.cli.terminal.show import show
    from tautwave.cli.terminal.streams import escaped, suppress_output_errors, warn
    from tautwave.cli.terminal.summary import summary_sections
    from tautwave.config import load_rig
    from tautwave.summary.ending import last_line

    stated = at_site(overrides, site)
    loaded = load_rig(rig, stated, choose=False)  # its certificate chooses, elsewhere
    if task is not None:
        if loaded.operate is None:
            raise ConfigError("--task: the rig has no `operate` block; write `operate: {}`")
        loaded = load_rig(rig, (*stated, f"operate.task={json.dumps(task)}"), choose=False)
    if play and loaded.scene is None:
        raise ConfigError("--play: this rig has no scene, so there is no sound to play")
    from tautwave import session

    if pointer:
        from tautwave.rig.led import led_by_pointer

        loaded, view = led_by_pointer(loaded), True
        duration = POINTER_S if duration is None else duration
    ways = session.describe_ways(loaded, clock=clock, simulate=simulate, attach=attach)
    with suppress_output_errors(sys.stdout):
        for sentence in ways:
            click.echo(sentence)
    # A script finds all files when the command ends; a person is shown the verdict at once.
    draw_later = sys.stdout.isatty() and not play and not (pointer and loaded.scene is not None)
    scripts, live = command_sources(commands, end_with_input=end_with_input)
    directory = fresh_directory(out, loaded.name)
    try:
        showing = nullcontext() if quiet else Progress(loaded.name, directory)
        with (
            page_beside(directory, view),
            showing as progress,
            keys_of(loaded, clock, commands) as keys,
        ):
            result = session.run(
                loaded,
                clock=clock,
                duration_s=duration,
                out=directory,
                command=command_line(ctx),
                allow_uncertified=allow_uncertified,
                allow_unwatched=allow_unwatched,
                configure=configure,
                attach=attach,
                simulate=simulate,
                allow_tuning=allow_tuning,
                scripts=scripts,
                live=[*live, *keys],
                progress=progress,
                warn=warn,
                draw_later=draw_later,
            )
    finally:
        with suppress(OSError):
            directory.rmdir()  # removes it only if empty: a run that never began leaves nothing
    if cast("Commands", ctx.find_root().command).owns_process:
        with interrupts() as heard:
            heard.ignore_further_signals()
    summary = result.summary
    with suppress_output_errors(sys.stdout):
        show(
            summary_sections(
                loaded.name,
                summary,
                result.directory,
                result.exit_code,
                draw_later,
                verbose=verbose,
            )
        )
    played = _played(result.directory) if play else ""
    with suppress_output_errors(sys.stderr):
        if played:
            click.echo(played, err=True)
        if result.exit_code:
            click.echo(escaped(last_line(loaded.name, summary, result.exit_code)), err=True)
    ctx.exit(result.exit_code)


def _played(directory: Path) -> str:
    """Play the sound of a run; return a sentence about it."""
    from tautwave.cli.terminal.play import play_sound

    sound = directory / "output.wav"
    if not sound.exists():
        return "not played: this run produced no sound"
    return play_sound(sound) or f"played {sound}"


def fresh_directory(out: Path | None, name: str) -> Path:
    """Create the run's directory; refuse one that is not empty."""
    if out is None:
        short = os.fsdecode(os.fsencode(name)[:150])  # file systems take 255 bytes
        stem = re.sub(r"[^\w.-]+", "-", short).strip("-.") or "run"
        out = first = Path("runs") / f"{stem}-{datetime.now(UTC):%Y%m%d-%H%M%S}"
        again = 2
        while out.exists():
            out = first.with_name(f"{first.name}-{again}")
            again += 1
    make_directory(out)
    with writing(out):
        holds_something = any(out.iterdir())
    if holds_something:
        raise ConfigError(
            f"{out}: not empty, and runs are never overwritten; give a new --out, or remove it "
            "first"
        )
    return out
