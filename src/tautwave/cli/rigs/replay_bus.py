"""`tautwave replay-bus`: recorded traffic plays the devices for our drivers."""

from __future__ import annotations

from pathlib import Path

import click

from tautwave.cli.options import PATH


@click.command(short_help="Have a driver run on the recorded traffic of a bus.")
@click.argument("file", type=PATH)
@click.option("--rig", type=PATH, metavar="RIG", help="Rig file whose bus it is; default: FILE's.")
@click.option("--bus", metavar="NAME", help="Bus of the rig; default: the first with traffic.")
@click.option("--stage", metavar="NAME", help="Of a shared file; default: the last with traffic.")
@click.pass_context
def replay_bus(
    ctx: click.Context, file: Path, rig: Path | None, bus: str | None, stage: str | None
) -> None:
    """Play the devices of a bus from FILE for the driver of a rig: a report becomes a test.

    FILE is one of `tautwave accept --share`, which brings its rig; a log of `candump -L`; or lines
    of TIME BUS > HEX (sent) and TIME BUS < HEX (received), of a serial line or a TCP connection.
    The driver opens, enables and runs with zero commands on a fake clock; no device is opened. Each
    request gets the answer that the recording has. A recording of another host is played as far as
    its answers suffice, and it is said where they do not. Exit code 5 where the driver ended early.

    \b
    Examples:
        tautwave replay-bus drives.json
        tautwave replay-bus candump.log --rig drives.yaml --bus can
    """
    from tautwave.config import load_rig
    from tautwave.errors import ConfigError
    from tautwave.session.bus_replay import read_traffic, shared_rig
    from tautwave.session.bus_replay import replay_bus as played
    from tautwave.traffic import LEAVING

    events, text = read_traffic(file, stage)
    if rig is None and not text:
        raise ConfigError(f"{file}: has no rig; name the one whose bus this is with --rig")
    loaded = shared_rig(text, file.stem) if rig is None else load_rig(rig, choose=False)
    named = list(dict.fromkeys(one.bus for one in events if one.bus != LEAVING))
    chosen = bus or next((one for one in named if one in loaded.buses), None)
    chosen = chosen or (next(iter(loaded.buses)) if len(loaded.buses) == 1 else None)
    if chosen is None or chosen not in loaded.buses:
        raise ConfigError(
            f"{file}: its traffic is of {', '.join(named) or 'no bus'}, the rig has "
            f"{', '.join(loaded.buses)}; choose with --bus"
        )
    if chosen in named:
        events = [one for one in events if one.bus in (chosen, LEAVING)]
    outcome = played(loaded, chosen, events)
    for note in outcome.notes:
        click.echo(note)
    for fault in dict.fromkeys(outcome.faults):
        click.echo(f"fault: {fault}")
    if outcome.unknown:
        many = sum(outcome.unknown.values())
        click.echo(f"{many} of {outcome.asked} requests are not in the recording, such as "
                   f"{', '.join(list(outcome.unknown)[:3])}")  # fmt: skip
    state = (
        f"enabled, {outcome.cycles} cycles, {outcome.samples} valid samples"
        if outcome.enabled
        else ("not enabled")
    )
    click.echo(f"bus {chosen}: {state}")
    if outcome.said:
        click.echo(outcome.said, err=True)
        if outcome.unknown:
            click.echo(
                f"{file} was recorded with another host, other settings or another version of "
                "this driver: it has not all answers that this driver needs, and is played no "
                "further",
                err=True,
            )
        ctx.exit(5)
