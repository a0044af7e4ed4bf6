"""`tautwave sweep`: many closed-loop simulations over a grid, as a table and a picture."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import click

from tautwave.cli.options import PATH, echo_json, json_option, out_option

INTERRUPTED = 130
"""Exit code of a sweep that Ctrl-C ended early: a shell's own."""


@click.command(short_help="Simulate a grid of rigs; table and picture.")
@click.argument("file", type=PATH)
@out_option("Where points.csv and sweep.png go; default: runs/sweep-NAME.")
@click.option(
    "--jobs",
    type=click.IntRange(min=1),
    metavar="N",
    help="Processes that simulate; default: one per processor.",
)
@json_option
@click.pass_context
def sweep(
    ctx: click.Context, file: Path, out: Path | None, jobs: int | None, as_json: bool
) -> None:
    """Simulate every point of the sweep FILE: a rig, what is varied, what is measured.

    Rows go into points.csv as they come. Ctrl-C leaves what was done (exit code 130), and the
    same command goes on from there. No device is touched.

    \b
    Examples:
        tautwave sweep configs/sweeps/delay-stability.yaml
        tautwave sweep sweep.yaml --out runs/stiffness --jobs 4
    """
    from tautwave.cli.progress import Progress
    from tautwave.cli.show import show
    from tautwave.offline.sweep_file import load_sweep

    plan = load_sweep(file)
    name = plan.sweep.name
    stem = re.sub(r"[^\w.-]+", "-", name).strip("-.") or "unnamed"
    directory = out or Path("runs") / f"sweep-{stem}"

    from tautwave.offline.sweep import run_sweep
    from tautwave.report.sweep_figure import write_sweep_figure

    with Progress(name) as progress:
        result = run_sweep(
            plan, directory, jobs=jobs or len(os.sched_getaffinity(0)), progress=progress
        )
        if not result.interrupted:
            progress(1.0, "drawing")
        picture = write_sweep_figure(plan.sweep, result.rows, directory)
    if as_json:
        echo_json(
            {
                "name": name,
                "points": result.total,
                "done": len(result.rows),
                "resumed": result.resumed,
                "interrupted": result.interrupted,
                "table": str(result.table),
                "figure": None if picture is None else str(picture),
            }
        )
    else:
        show(sweep_sections(plan.sweep, result, picture))
    if result.interrupted:
        ctx.exit(INTERRUPTED)


def sweep_sections(sweep: Any, result: Any, picture: Path | None) -> list[Any]:
    """How many points were done, where each case is stable, and where the files are."""
    from tautwave.cli.show import NOTE, Section
    from tautwave.report.sweep_figure import curves_of, stability_sentences

    done = len(result.rows)
    headline = f"{sweep.name}: {done} of {result.total} points"
    if result.resumed:
        headline += f", {result.resumed} of them taken over"
    if result.interrupted:
        headline += ", interrupted; the same command goes on from here"
    verdicts = []
    if sweep.figure is not None:
        for curve in curves_of(sweep, sweep.figure, result.rows):
            verdicts += [(text,) for _, text in stability_sentences(curve, sweep.figure)]
    files = [(str(result.table),)] + ([] if picture is None else [(str(picture),)])
    return [
        Section(headline, (), (), NOTE if result.interrupted else "bold"),
        Section("Stability", ("",), verdicts),
        Section("Files", ("",), files),
    ]
