"""`tautwave run`: one run from rig file to report."""

from __future__ import annotations

import re
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path

import click

from tautwave.cli.group import command_line
from tautwave.cli.options import out_option, positive, rig_argument, set_option
from tautwave.errors import ConfigError


@click.command(short_help="Run a rig: check, move, record, report.")
@rig_argument
@click.option(
    "--duration",
    type=float,
    callback=positive,
    metavar="S",
    help="How long to run [s]; default: what the rig says.",
)
@out_option("Where the run is kept; default: runs/NAME-DATE-TIME (UTC). Has to be new or empty.")
@click.option(
    "--clock",
    type=click.Choice(["real", "fake"]),
    default="real",
    show_default=True,
    help="real: keeps time; fake: as fast as it computes, reproducible, no device.",
)
@set_option
@click.option("--allow-uncertified", is_flag=True, help="Run a rig that is not certified.")
@click.option(
    "--allow-unwatched", is_flag=True, help="Run devices without a watchdog of their own."
)
@click.option("--configure", is_flag=True, help="Write settings into devices where they differ.")
@click.option(
    "--attach",
    is_flag=True,
    help="Use simulated devices that `tautwave sim RIG` serves already, in another terminal.",
)
@click.option(
    "--play", is_flag=True, help="Play the sound of a scene after the run, where there is a device."
)
@click.pass_context
def run(
    ctx: click.Context,
    rig: Path,
    duration: float | None,
    out: Path | None,
    clock: str,
    overrides: tuple[str, ...],
    allow_uncertified: bool,
    allow_unwatched: bool,
    configure: bool,
    attach: bool,
    play: bool,
) -> None:
    """Run RIG: check it, move, record, report.

    Ctrl-C ramps down, writes the report and exits 0; a second Ctrl-C stops at once. The run's
    directory holds rig.yaml, summary.json, recording.mcap, report.html and its figures.

    \b
    Examples:
        tautwave run configs/bench-1dof-loopback.yaml
        tautwave run rig.yaml --clock fake --duration 2 --out runs/quick
        tautwave run rig.yaml --set coupling.delay_s=0.1 --set rate_hz=500
        tautwave run configs/scene-granular.yaml --play
    """
    from tautwave.cli.progress import Progress
    from tautwave.cli.show import show
    from tautwave.cli.summary import outcome, summary_sections
    from tautwave.config import load_rig

    loaded = load_rig(rig, overrides)
    if play and loaded.scene is None:
        raise ConfigError("--play: this rig has no scene, so there is no sound to play")
    directory = fresh_directory(out, loaded.name)

    from tautwave import session

    if allow_unwatched:
        click.echo(
            "UNWATCHED: by --allow-unwatched a device without a watchdog is moved all the same, "
            "and goes on with its last command when this program falls silent; keep a hand on the "
            "emergency stop",
            err=True,
        )
    try:
        with Progress(loaded.name) as progress:
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
                progress=progress,
            )
    finally:
        with suppress(OSError):
            directory.rmdir()  # works on an empty one only: a run that never began leaves nothing
    show(summary_sections(loaded.name, result.summary, result.directory, result.exit_code))
    for bus in result.summary.get("buses", {}).values():
        for note in bus.get("notes", ()):
            if note.startswith(("UNWATCHED", "NOT WATCHED")):
                click.echo(note, err=True)
    if play:
        click.echo(_played(result.directory), err=True)
    if result.exit_code:
        word, sentence = outcome(result.summary, result.exit_code)
        if result.exit_code == 3:
            after = result.summary.get("certificate", {}).get("after_run", {})
            sentence = "\n".join(after.get("sentences", ())) or sentence
        click.echo(sentence or f"{loaded.name}: {word}", err=True)
    ctx.exit(result.exit_code)


def _played(directory: Path) -> str:
    """Play the sound of a run; return what is to be said about it."""
    from tautwave.cli.play import play_sound

    sound = directory / "output.wav"
    if not sound.exists():
        return "not played: this run left no sound"
    return play_sound(sound) or f"played {sound}"


def fresh_directory(out: Path | None, name: str) -> Path:
    """Create the run's directory; never one that already holds something."""
    if out is None:
        stem = re.sub(r"[^\w.-]+", "-", name).strip("-.") or "run"
        out = first = Path("runs") / f"{stem}-{datetime.now(UTC):%Y%m%d-%H%M%S}"
        again = 2
        while out.exists():
            out = first.with_name(f"{first.name}-{again}")
            again += 1
    try:
        out.mkdir(parents=True, exist_ok=True)
        holds_something = any(out.iterdir())
    except OSError as err:
        raise ConfigError(f"{out}: cannot be used as the run's directory: {err.strerror}") from err
    if holds_something:
        raise ConfigError(
            f"{out}: is not empty, and a run never overwrites another one;"
            " give a new --out, or remove it first"
        )
    return out
