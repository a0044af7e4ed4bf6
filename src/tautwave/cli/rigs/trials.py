"""`tautwave trials`: run a user study, trial by trial."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tautwave.cli.options import PATH, clock_option, out_option, run_flags, simulate_option
from tautwave.cli.terminal.streams import warn
from tautwave.errors import ConfigError

if TYPE_CHECKING:
    from tautwave.session.trials.protocol import Trial


@click.command(short_help="Run a user study from its protocol, and write its table.")
@click.argument("protocol", type=PATH)
@click.option("--participant", required=True, metavar="NAME", help="The participant, one word.")
@out_option("Directory of runs and table; default: runs/NAME-OF-THE-PROTOCOL.")
@click.option("--list", "only_list", is_flag=True, help="Show the participant's order, and end.")
@click.option("--yes", is_flag=True, help="Begin each trial immediately, without asking.")
@clock_option()
@simulate_option
@run_flags("--attach", "--allow-unwatched")
def trials(
    protocol: Path,
    participant: str,
    out: Path | None,
    only_list: bool,
    yes: bool,
    clock: str,
    simulate: bool | tuple[str, ...],
    attach: bool,
    allow_unwatched: bool,
) -> None:
    """Run the trials of PROTOCOL for one participant, one run per trial, and write trials.csv.

    The order is determined by the protocol's seed and the participant. Before each trial it waits
    for Enter; then the rig engages and an episode runs until its time is up or `e` is pressed. If
    restarted, the study resumes after the last trial in the table.

    \b
    Examples:
        tautwave trials delay-study.yaml --participant P01
        tautwave trials delay-study.yaml --participant P01 --list
    """
    from tautwave.cli.terminal.keys import keys_of
    from tautwave.clock import MonotonicClock
    from tautwave.session.trials.protocol import read_protocol, trials_of
    from tautwave.session.trials.running import Study, run_study

    if not re.fullmatch(r"[\w.-]+", participant):
        raise ConfigError(f"trials: --participant {participant!r}: write one word, such as P01")
    loaded = read_protocol(protocol)
    order = trials_of(loaded, participant)
    if only_list:
        for trial in order:
            click.echo(f"{trial.number:4d}  {trial.condition}  {trial.repetition}")
        return

    def ready(trial: Trial, rested: bool) -> None:
        if yes:
            return
        if rested and loaded.break_s:
            click.echo(f"break of {loaded.break_s:g} s")
            now = MonotonicClock()
            now.sleep_until(now.now_ns() + round(1e9 * loaded.break_s))
        click.prompt(
            f"trial {trial.number} of {len(order)}; press Enter to start",
            default="", show_default=False, prompt_suffix=" ",
        )  # fmt: skip

    def judge(trial: Trial) -> bool | None:
        return None if yes else click.confirm("a success?")

    ways = {"clock": clock, "simulate": simulate, "attach": attach}
    study = Study(
        loaded,
        participant,
        protocol.parent,
        Path("runs") / protocol.stem if out is None else out,
        {**ways, "allow_unwatched": allow_unwatched, "warn": warn},
    )
    try:
        table = run_study(study, ready, judge, lambda rig: keys_of(rig, clock, None))
    except click.Abort as err:
        raise ConfigError(
            "trials: the input has ended, so the question cannot be answered; run the same command "
            "to continue, or use --yes"
        ) from err
    count = f"{len(order)} trial{'s'[: len(order) != 1]}"
    click.echo(f"{table}: all {count} of {participant} done")
