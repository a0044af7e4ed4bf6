"""`tautwave ros`: a run in progress, on the topics of ROS 2."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import click

from tautwave.cli.options import Number, run_argument, wait_option


@click.command(short_help="Publish a run in progress to ROS 2.")
@run_argument
@click.option(
    "--rate",
    type=Number(0.1),
    default=100.0,
    show_default=True,
    metavar="HZ",
    help="Rate of joint states and wrenches [Hz]; at most 100.",
)
@click.option(
    "--domain",
    type=click.IntRange(0, 232),
    default=0,
    envvar="ROS_DOMAIN_ID",
    show_envvar=True,
    show_default=True,
    help="DDS domain.",
)
@click.option("--namespace", default="/", show_default=True, metavar="NS", help="As /left.")
@click.option(
    "--interface",
    default="lo",
    show_default=True,
    metavar="NAME",
    help="The only network interface to use; lo: this machine only.",
)
@click.option(
    "--peer",
    multiple=True,
    metavar="ADDRESS",
    help="Address of a machine to contact directly where multicast does not pass; may be repeated.",
)
@click.option(
    "--allow-commands",
    is_flag=True,
    help="Engage while true is published repeatedly on /tautwave/engage "
    "(Bool); requires an `operate` block.",
)
@wait_option
def ros(
    directory: Path,
    rate: float,
    domain: int,
    namespace: str,
    interface: str,
    peer: tuple[str, ...],
    allow_commands: bool,
    wait: float,
) -> None:
    """Publish the run in DIR to ROS 2 while it is in progress; needs no ROS installation.

    Joint states of both sides, wrenches at the tips of arms, and /diagnostics. Reads the run's
    shared memory without writing to it. Ctrl-C stops publishing, not the run.

    DDS has no passwords: anyone who can reach the interface can read, and send commands if allowed.
    It is therefore limited to this machine unless --interface names another interface.

    \b
    Examples:
        tautwave ros runs/shift
        tautwave ros runs/shift --interface eth0 --domain 7
        tautwave ros runs/shift --allow-commands
    """
    from tautwave.clock import MonotonicClock
    from tautwave.config import load_rig
    from tautwave.errors import ConfigError

    if any(find_spec(name) is None for name in ("cyclonedds", "rosbags")):
        raise ConfigError("ROS 2 needs cyclonedds and rosbags; pip install 'tautwave[ros]'")
    from tautwave.view.ros.exporter import Exporter, refuse_rate
    from tautwave.view.ros.node import Node, check_namespace, configuration
    from tautwave.view.watched import begun

    refuse_rate(rate)
    check_namespace(namespace)
    configuration(interface, peer)  # refused before anything is waited for
    clock = MonotonicClock()
    run = begun(directory, clock, wait)
    rig = load_rig(directory / "rig.yaml", choose=False)
    node = Node("tautwave", namespace, domain, interface, peer)
    exporter = Exporter(run, rig, node, rate, allow_commands=allow_commands)
    click.echo(f"domain {domain}, {interface}: {', '.join(exporter.topics)}")
    exporter.export(clock)
    click.echo(
        f"{directory}: the run has ended; run `tautwave report {directory}` to write its report"
    )
