"""`tautwave calibrate`: show a rig its zero, directions and ranges by hand."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import click

from tautwave.cli.options import (
    clock_option,
    out_option,
    positive,
    rig_argument,
    run_flags,
    simulate_option,
)
from tautwave.errors import ConfigError

STEPS = ("zero", "direction", "range", "identify")


@click.command(short_help="Teach a rig its zero, directions and ranges by hand.")
@rig_argument
@click.option(
    "--axis", "axes", multiple=True, metavar="NAME", help="Only this one; may be repeated."
)
@click.option(
    "--steps",
    default="zero,direction,range",
    show_default=True,
    metavar="A,B",
    help="Any of zero, direction, range (by hand, without torque) and "
    "identify (inertia and friction).",
)
@click.option(
    "--stop",
    "stops",
    multiple=True,
    metavar="AXIS=POSITION",
    help="Find zero by a mechanical stop at this position [rad or m]: the axis moves there, with "
    "at most a fifth of its effort limit and 0.2 rad/s or m/s. May be repeated.",
)
@click.option(
    "--identify-s",
    type=float,
    default=8.0,
    show_default=True,
    callback=positive,
    metavar="S",
    help="Excitation time per axis for identify [s].",
)
@click.option(
    "--script",
    metavar="FILE",
    help="Answers from a file of lines `SECONDS [ANSWER]`: time after "
    "each question, and the answer.",
)
@out_option("Directory of the recordings; default: runs/calibrate-NAME-DATE-TIME.")
@clock_option()
@simulate_option
@run_flags("--attach", "--allow-unwatched", "--configure")
def calibrate(
    rig: Path,
    axes: Sequence[str],
    steps: str,
    stops: Sequence[str],
    identify_s: float,
    script: str | None,
    out: Path | None,
    clock: str,
    simulate: bool | tuple[str, ...],
    attach: bool,
    allow_unwatched: bool,
    configure: bool,
) -> None:
    """Calibrate the devices of RIG step by step; press Enter to continue.

    For zero you hold a pose; for direction and range you move the axes by hand, with torque off.
    --stop instead moves an axis to its mechanical stop, and identify excites each axis. The result
    is stored next to RIG with the suffix .calibration.yaml, and RIG refers to it by its SHA-256. A
    run rejects a device whose identity has changed since.

    \b
    Examples:
        tautwave calibrate arms.yaml
        tautwave calibrate arms.yaml --steps range,identify --axis master.j1
        tautwave calibrate arms.yaml --stop slave.j6=-1.57
    """
    from tautwave.cli.rigs.talking import conversation
    from tautwave.cli.run import fresh_directory
    from tautwave.cli.terminal.progress import Progress
    from tautwave.session.calibration.calibrating import Asked, load_to_calibrate
    from tautwave.session.calibration.calibrating import calibrate as run
    from tautwave.session.guided.running import Ways

    wanted = [step.strip() for step in steps.split(",")]
    wrong = [step for step in wanted if step not in STEPS]
    if wrong:
        raise ConfigError(f"calibrate: --steps: {wrong[0]!r} is not one of {', '.join(STEPS)}")
    loaded = load_to_calibrate(
        rig, lambda _: None, choose=False
    )  # what is not taken of it is said below
    asked = Asked(axes or tuple(loaded.axes), wanted, _stops(stops), identify_s)
    directory = fresh_directory(out, f"calibrate-{loaded.name}")
    ways = Ways(clock, simulate, attach, allow_unwatched, configure)
    try:
        with Progress("calibrate") as progress:
            file, calibration = run(
                rig, asked, conversation(script), out=directory, ways=ways, progress=progress
            )
    finally:
        with suppress(OSError):
            directory.rmdir()  # removes it only if it is empty
    for name, one in calibration.items():
        low, high = one.get("position_range", ("?", "?"))
        span = f", range {low:.3f} to {high:.3f}" if "position_range" in one else ""
        click.echo(f"{name}: zero {one['zero']:+.4f}, direction {one['direction']:+d}{span}")
    click.echo(f"{file}: {len(calibration)} axes, named in {rig}")


def _stops(given: Sequence[str]) -> dict[str, float]:
    stops = {}
    for text in given:
        name, _, at = text.partition("=")
        try:
            stops[name] = float(at)
        except ValueError as err:
            raise ConfigError(f"calibrate: --stop {text!r}: write AXIS=POSITION") from err
    return stops
