"""`tautwave doctor`: what of this machine costs a run time, and the command that mends it."""

from __future__ import annotations

from pathlib import Path

import click

from tautwave.cli.options import PATH, echo_json, json_option


@click.command(short_help="Check this machine for what makes a run late, and how to fix it.")
@click.argument("rig", type=PATH, required=False)
@json_option
@click.pass_context
def doctor(ctx: click.Context, rig: Path | None, as_json: bool) -> None:
    """Check this machine: kernel, limits, governor, clock, serial ports, CAN interfaces.

    With RIG: also check that the ports and interfaces of its buses match it. Each problem is listed
    with its effect and the command that fixes it. Nothing is changed. Exits with 5 if something
    prevents a run, such as a port without access permission.

    \b
    Examples:
        tautwave doctor
        tautwave doctor arms.yaml --json
    """
    from tautwave.config import load_rig
    from tautwave.errors import DriverError
    from tautwave.session.doctor.examining import examine
    from tautwave.session.doctor.finding import BARS, GOOD

    findings = examine(None if rig is None else load_rig(rig, choose=False))
    if as_json:
        echo_json([finding._asdict() for finding in findings])
    else:
        wide = max(len(finding.what) for finding in findings)
        for finding in findings:
            click.echo(f"{finding.state:<7}  {finding.what:<{wide}}  {finding.found}")
            if finding.cost:
                click.echo(f"         {finding.cost}")
            if finding.command:
                click.echo(f"         fix: {finding.command}")
        costing = sum(finding.state != GOOD for finding in findings)
        click.echo(f"{len(findings)} checked, {costing} to fix" if costing else "nothing to fix")
    if any(finding.state == BARS for finding in findings):
        ctx.exit(DriverError.exit_code)
