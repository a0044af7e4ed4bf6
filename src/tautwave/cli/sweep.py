"""`tautwave sweep`: many closed-loop simulations over a grid, as a table and a picture."""

from __future__ import annotations

import os
import re
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

import click

from tautwave.cli.options import PATH, Whole, echo_json, json_option, out_option

INTERRUPTED = 130
"""Exit code of a sweep that Ctrl-C ended early, as in a shell."""


@click.command(short_help="Simulate a grid of rigs; table and picture.")
@click.argument("file", type=PATH)
@out_option("Directory for points.csv and sweep.png, .svg and .pdf; default: runs/sweep-NAME.")
@click.option(
    "--jobs",
    type=Whole(1),
    metavar="N",
    help="Worker processes; default: one per CPU core.",
)
@click.option(
    "--scheduler",
    metavar="ADDRESS|FILE.json",
    help="Simulate on the workers of this Dask scheduler; needs tautwave[cluster].",
)
@json_option
@click.pass_context
def sweep(
    ctx: click.Context,
    file: Path,
    out: Path | None,
    jobs: int | None,
    scheduler: str | None,
    as_json: bool,
) -> None:
    """Simulate every point of the sweep FILE: a rig, what is varied, what is measured.

    Rows are appended to points.csv as they finish. If a sweep is interrupted (Ctrl-C: exit code
    130), the same command resumes it. If pyarrow is installed the finished table is also written as
    Parquet. No device is touched.

    A file with planes is a map: wall stiffness over another quantity, with the predicted and
    simulated passive and stable limits.

    \b
    Examples:
        tautwave sweep configs/sweeps/delay-stability.yaml
        tautwave sweep configs/sweeps/wall-kb-plane.yaml
        tautwave sweep configs/sweeps/many-walls.yaml --out runs/walls
        tautwave sweep sweep.yaml --out runs/stiffness --jobs 4
        tautwave sweep sweep.yaml --scheduler tcp://10.0.0.5:8786
    """
    from tautwave.cli.terminal.progress import Progress
    from tautwave.cli.terminal.show import show
    from tautwave.sweep.file import load_sweep
    from tautwave.sweep.map import is_map

    if scheduler is not None and (jobs is not None or is_map(file)):
        other = "--jobs" if jobs is not None else "a map; maps are computed on this machine"
        raise click.UsageError(f"--scheduler cannot be combined with {other}")
    if is_map(file):
        draw_map(file, out, as_json=as_json)
        return
    plan = load_sweep(file)
    name = plan.sweep.name
    directory = out or default_directory(name)

    from tautwave.report.figures.sweep import write_sweep_figure
    from tautwave.sweep.runs import run_sweep

    with Progress(name) as progress, ExitStack() as stack:
        cluster = None
        if scheduler is not None:
            from tautwave.sweep.cluster import Cluster

            cluster = stack.enter_context(closing(Cluster(scheduler)))
            jobs = cluster.jobs
        jobs = jobs or len(os.sched_getaffinity(0))
        result = run_sweep(plan, directory, jobs=jobs, executor=cluster, progress=progress)
        if not result.interrupted:
            progress(1.0, "drawing")
        rows = list(result.rows) if plan.sweep.figure is not None else []
        picture = write_sweep_figure(plan.sweep, rows, directory)
    if as_json:
        echo_json(
            {
                "name": name,
                "points": result.total,
                "done": len(result.rows),
                "resumed": result.resumed,
                "interrupted": result.interrupted,
                "table": str(result.table),
                "parquet": None if result.parquet is None else str(result.parquet),
                "figure": None if picture is None else str(picture),
            }
        )
    else:
        show(sweep_sections(plan.sweep, result, rows, picture))
    if result.interrupted:
        ctx.exit(INTERRUPTED)


def default_directory(name: str) -> Path:
    """Return the directory for the results of a sweep of this name."""
    stem = re.sub(r"[^\w.-]+", "-", name).strip("-.") or "unnamed"
    return Path("runs") / f"sweep-{stem}"


def draw_map(file: Path, out: Path | None, *, as_json: bool) -> None:
    """Compute the planes of a map file, write and draw them, and report their agreement."""
    from tautwave.cli.terminal.progress import Progress
    from tautwave.cli.terminal.show import show
    from tautwave.report.figures.map import write_map_figure
    from tautwave.sweep.map import agreement_sentence, load_map, run_map
    from tautwave.tables import Table

    plan = load_map(file)
    directory = out or default_directory(plan.file.name)
    with Progress(plan.file.name) as progress:
        result = run_map(plan, directory, progress=progress)
        progress(1.0, "drawing")
        picture = write_map_figure(plan, result, directory)
    if as_json:
        echo_json(
            {
                "name": plan.file.name,
                "planes": {
                    name: {
                        "points": int(plane.growth.size),
                        "mismatched": plane.mismatched,
                        "boundaries": len(plane.edges),
                        "disagreement": plane.disagreement,
                    }
                    for name, plane in result.planes.items()
                },
                "boundaries": str(result.boundaries),
                "table": str(result.points),
                "figure": str(picture),
            }
        )
        return
    rows = [(f"{name}: {agreement_sentence(plane)}",) for name, plane in result.planes.items()]
    files = [(str(path),) for path in (result.boundaries, result.points, picture)]
    show(
        [
            Table(
                f"{plan.file.name}: {len(result.planes)} planes; every bus simulated in memory",
                (),
                (),
            ),
            Table("Agreement", ("",), rows),
            Table("Files", ("",), files),
        ]
    )


def sweep_sections(sweep: Any, result: Any, rows: list[Any], picture: Path | None) -> list[Any]:
    """Report the number of points, where each case is stable, and where the files are."""
    from tautwave.report.figures.sweep import curves_of, stability_sentences
    from tautwave.sweep.parquet import NO_PYARROW
    from tautwave.tables import NOTE, Table

    done = len(result.rows)
    headline = f"{sweep.name}: {done} of {result.total} points"
    if result.resumed:
        headline += f", {result.resumed} already done before"
    if result.interrupted:
        headline += ", interrupted; run the same command to resume"
    headline += "; every bus simulated in memory"
    verdicts = []
    if sweep.figure is not None:
        for curve in curves_of(sweep, sweep.figure, rows):
            verdicts += [(text,) for _, text in stability_sentences(curve, sweep.figure)]
    files = [(str(path),) for path in (result.table, result.parquet, picture) if path is not None]
    if result.parquet is None and not result.interrupted:
        files.append((NO_PYARROW,))
    return [
        Table(headline, (), (), level=NOTE if result.interrupted else ""),
        Table("Stability", ("",), verdicts),
        Table("Files", ("",), files),
    ]
