"""`tautwave accept`: the first day with real drives, led, measured, recorded and sealed."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import click

from tautwave.cli.options import (
    PATH,
    clock_option,
    out_option,
    positive,
    run_flags,
    simulate_option,
)
from tautwave.errors import ConfigError

KEEP = ("names", "serial", "paths", "hosts")
STAGES = (
    "identity", "hand", "limits", "noise", "silence", "watchdog", "touch", "motion", "delay",
    "effort", "gentle", "walls", "full",
)  # fmt: skip


@click.command(short_help="Guide you through commissioning real drives: measure, record, seal.")
@click.argument("rig", type=PATH)
@click.option("--by", metavar="NAME", help="Who accepts.")
@click.option("--keys", type=PATH, metavar="DIR", help="Sign with a key of tautwave keys init.")
@click.option(
    "--site", default="master", show_default=True, metavar="NAME", help="Whose key of --keys."
)
@click.option(
    "--axis", "axes", multiple=True, metavar="NAME", help="Only this one; may be repeated."
)
@click.option(
    "--stages",
    metavar="A,B",
    help=f"In this order, from low to high risk; default: {','.join(STAGES)}.",
)
@click.option(
    "--resume",
    type=PATH,
    metavar="DIR",
    help="Go on with an acceptance of the same rig and devices; its passed stages are kept.",
)
@click.option("--redo", default="", metavar="A,B", help="With --resume: do these stages again.")
@click.option(
    "--run-s",
    type=float,
    default=5.0,
    show_default=True,
    callback=positive,
    metavar="S",
    help="Length of the coupled runs [s].",
)
@click.option("--script", metavar="FILE", help="Answers from a file, as for calibrate.")
@click.option(
    "--share",
    type=PATH,
    metavar="FILE",
    help="One file to hand on, of RIG's acceptance or of RIG as a kept acceptance.json.",
)
@click.option(
    "--share-with",
    "kept",
    default="",
    metavar="A,B",
    help=f"What --share leaves out unless named here: {', '.join(KEEP)}.",
)
@click.option("--verify", is_flag=True, help="RIG is an acceptance.json: verify it.")
@out_option("Directory, new or empty; default: runs/accept-NAME-DATE-TIME.")
@clock_option()
@simulate_option
@run_flags("--attach", "--allow-unwatched", "--configure")
@click.pass_context
def accept(
    ctx: click.Context,
    rig: Path,
    by: str | None,
    keys: Path | None,
    site: str,
    axes: Sequence[str],
    stages: str | None,
    resume: Path | None,
    redo: str,
    run_s: float,
    script: str | None,
    share: Path | None,
    kept: str,
    verify: bool,
    out: Path | None,
    clock: str,
    simulate: bool | tuple[str, ...],
    attach: bool,
    allow_unwatched: bool,
    configure: bool,
) -> None:
    """Run acceptance tests on the devices of RIG, stage by stage from low to high risk.

    Without torque: identity, sign and scale by hand, limits. Enabled with zero effort: noise at
    rest, the watchdogs by silence, then by unplugging the cable. With effort: a light pull in your
    hand, small motions both ways against all signs, delay by a step, effort with a spring scale.
    Then the coupled rig at a tenth of its effort, the same with walls, and at full effort. Before a
    stage with torque it waits until every axis is off its ends. On a terminal it pauses between
    stages, and a stage can be done again; one that failed is always asked for again, and ends it
    otherwise: exit code 6, a device refused in the first stage 5. What was passed is kept after
    every stage, also on Ctrl-C: --resume DIR goes on, if rig and devices are the same.
    acceptance.json holds every result, sealed by the SHA-256 of every recording and of itself;
    --keys signs it, and with --verify shows who signed. Real devices that passed identity and
    motion are kept in RIG.accepted.json beside RIG, and compared in every run. --share writes one
    file that may be handed on, after it was printed in full: no names, hosts, users, paths or
    serial numbers.

    \b
    Examples:
        tautwave accept drives.yaml --by 'A. Person'
        tautwave accept drives.yaml --by me --stages identity,hand
        tautwave accept drives.yaml --resume runs/accept-drives --redo hand
        tautwave accept drives.yaml --by 'A. Person' --keys keys --site lab
        tautwave accept runs/accept-drives/acceptance.json --verify --keys keys
        tautwave accept runs/accept-drives/acceptance.json --share drives.json
    """
    from tautwave.session.acceptance import document

    if verify:
        verified = document.verify(rig, keys)
        for sentence in verified.wrong:
            click.echo(sentence, err=True)
        if not verified.wrong:
            by = f", signed with the key of site {verified.signer}" if verified.signer else ""
            click.echo(f"{rig}: unchanged since it was sealed{by}")
        ctx.exit(2 if verified.wrong else 0)
    keep = [word.strip() for word in kept.split(",") if word.strip()]
    unknown = [word for word in keep if word not in KEEP]
    if unknown:
        raise ConfigError(f"accept: --share-with: {unknown[0]!r} is not one of {', '.join(KEEP)}")
    if share is not None and share.exists():
        raise ConfigError(
            f"accept: {share} already exists and is not overwritten; give --share another file name"
        )
    if share is not None and rig.suffix == ".json":
        _share(rig, share, keep)
        return
    if redo and resume is None:
        raise ConfigError("accept: --redo goes with --resume DIR, which has the stages")
    if resume is not None and out is not None:
        raise ConfigError("accept: --resume DIR goes on in DIR; leave --out away")
    from tautwave.bench.result import machine
    from tautwave.cli.rigs.talking import conversation
    from tautwave.cli.run import fresh_directory
    from tautwave.config import load_rig
    from tautwave.session.acceptance.accepting import accept as lead
    from tautwave.session.acceptance.accepting import go_on
    from tautwave.session.acceptance.day import Acceptance, begun
    from tautwave.session.guided.running import Ways

    wanted, again = _stages(stages, "--stages") or list(STAGES), _stages(redo, "--redo")
    if resume is not None:
        before = begun(resume)
        by, axes = by or before.by, axes or before.axes
        wanted = wanted if stages else before.stages
    if by is None or not by.strip():
        raise click.UsageError("--by is missing: who performs the acceptance?")
    loaded = load_rig(rig, choose=False)
    asked = Acceptance(rig, axes or tuple(loaded.axes), wanted, run_s, by, keys, site, machine())
    directory = resume or fresh_directory(out, f"accept-{loaded.name}")
    ways = Ways(clock, simulate, attach, allow_unwatched, configure)
    try:
        path, checks, refused, left = lead(
            asked, conversation(script), out=directory, ways=ways, resume=resume is not None,
            redo=again,
        )  # fmt: skip
    finally:
        with suppress(OSError):
            directory.rmdir()  # removes it only if it is empty
    if share is not None:
        _share(path, share, keep)
    good = sum(check.good for check in checks)
    how = "sealed" if keys is None else f"signed with the key of site {site}"
    ended = f"accepted by {by}, {how}"
    if left:
        ended = f"NOT {ended}; left: {', '.join(left)}; {go_on(rig, directory)}"
    click.echo(f"{path}: {good} of {len(checks)} checks passed, {ended}")
    if refused is not None:
        raise refused
    ctx.exit(6 if left else 0)


def _stages(text: str | None, option: str) -> list[str]:
    """Return the stages of an option, none of ''."""
    stages = [stage.strip() for stage in (text or "").split(",") if stage.strip()]
    wrong = [stage for stage in stages if stage not in STAGES]
    if wrong:
        raise ConfigError(f"accept: {option}: {wrong[0]!r} is not one of {', '.join(STAGES)}")
    return stages


def _share(document: Path, target: Path, keep: Sequence[str]) -> None:
    """Print what may be handed on of an acceptance, then write it."""
    from tautwave.session.acceptance.shared import shared, text_of, write_shared

    acceptance = shared(document, keep)
    click.echo(text_of(acceptance), nl=False)
    write_shared(target, acceptance)
    click.echo(f"{target}: as printed above; nothing is sent anywhere", err=True)
