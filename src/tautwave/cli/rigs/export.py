"""`tautwave export`: runs for other programs, by episode."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import click

from tautwave.cli.options import PATH, Number, Whole, of_kind, out_option
from tautwave.errors import RecordingError
from tautwave.kinds import RECORDING, RUN


@click.command(short_help="Write runs as tables, a LeRobot dataset or ROS 2 bags.")
@click.argument(
    "directories",
    type=PATH,
    nargs=-1,
    required=True,
    metavar="DIR...",
    callback=of_kind(RUN, RECORDING),
)
@click.option(
    "--to",
    type=click.Choice(["csv", "parquet", "npz", "mat", "lerobot", "rosbag"]),
    default="csv",
    show_default=True,
    help="Parquet and LeRobot need pyarrow (tautwave[parquet]), MAT SciPy (tautwave[analysis]), "
    "a ROS 2 bag rosbags (tautwave[ros]).",
)
@click.option("--columns", metavar="A,B", help="Tables: only these columns; default: all.")
@click.option(
    "--fps",
    type=Whole(1),
    help="LeRobot: frames a second; default: 30, with --resume those of the dataset.",
)
@click.option("--task", metavar="TEXT", help="LeRobot: the task of episodes that name none.")
@click.option("--velocities", is_flag=True, help="LeRobot: the action has velocities, too.")
@click.option(
    "--missing",
    type=click.Choice(["refuse", "cut"]),
    help="LeRobot: how to treat frames with a missing sample and episodes with less than 1 s; "
    "default: refuse.",
)
@click.option(
    "--only",
    type=click.Choice(["success"]),
    help="LeRobot: only episodes of which success was said; default: all, with what was said of "
    "them in the column success (1, 0 failed, -1 no verdict).",
)
@click.option(
    "--max-gap",
    type=Number(0.0),
    metavar="SECONDS",
    help="LeRobot: leave out episodes from whose middle more than this is cut in a row; default: "
    "none.",
)
@click.option(
    "--resume",
    is_flag=True,
    help="LeRobot: add the episodes to the dataset --out; refused where robot, rate, signals or "
    "cameras differ, or where it has a recording already.",
)
@click.option("--no-video", is_flag=True, help="LeRobot: omit the camera images.")
@out_option("Output directory; default: export in DIR. For a dataset it must not exist.")
def export(
    directories: tuple[Path, ...],
    to: str,
    columns: str | None,
    fps: int | None,
    task: str | None,
    velocities: bool,
    missing: str | None,
    only: str | None,
    max_gap: float | None,
    resume: bool,
    no_video: bool,
    out: Path | None,
) -> None:
    """Export runs, one file per episode, with episodes.csv as an index.

    A run without episodes becomes one file. Units are SI, as recorded. Several runs each get their
    own directory; in a LeRobot dataset (v3.0) they become its episodes. A ROS 2 bag has the joint
    states of a whole run.

    \b
    Examples:
        tautwave export runs/shift --to parquet
        tautwave export runs/shift --columns time_s,master.lever.position --out table
        tautwave export runs/shift runs/next --to lerobot --fps 30 --task "insert the peg" --out peg
        tautwave export runs/today --to lerobot --out peg --resume
    """
    lerobot = {"--fps": fps, "--task": task, "--velocities": velocities, "--missing": missing,
            "--only": only, "--max-gap": max_gap is not None, "--resume": resume,
            "--no-video": no_video}  # fmt: skip
    given = [name for name, value in lerobot.items() if value]
    for directory in directories:
        if not directory.exists():
            raise RecordingError(f"{directory}: no such directory; give the --out of a run")
    if to == "lerobot":
        if columns is not None:
            raise click.UsageError("--columns is for tables; a dataset has fixed columns")
        if out is None and len(directories) > 1:
            raise click.UsageError(
                "several runs are combined into one dataset: give its directory with --out DIR"
            )
        if resume and out is None:
            raise click.UsageError("--resume: name the dataset with --out DIR")
        from tautwave.report.export.lerobot import Choice, export_dataset

        where = _beside(directories[0]) if out is None else out
        choice = Choice(
            fps,
            task,
            velocities=velocities,
            cut=missing == "cut",
            video=not no_video,
            successes=only == "success",
            max_gap_s=math.inf if max_gap is None else max_gap,
            resume=resume,
        )
        click.echo(export_dataset(directories, where, choice))
        _tell_losses(directories)
        return
    if given:
        raise click.UsageError(f"{given[0]} is for --to lerobot")
    if to == "rosbag":
        if columns is not None:
            raise click.UsageError("--columns is for tables; a bag has the joint states")
        from tautwave.report.export.rosbag import export_bag

        for directory in directories:
            folder = _beside(directory) / "rosbag" if out is None else out
            several = out is not None and len(directories) > 1
            click.echo(export_bag(directory, folder / directory.name if several else folder))
        _tell_losses(directories)
        return
    from tautwave.report.export.tables import export_tables

    chosen = None if columns is None else [name.strip() for name in columns.split(",")]
    several = out is not None and len(directories) > 1
    names = [directory.resolve().name for directory in directories]
    if several and (twice := next((one for one in names if names.count(one) > 1), None)):
        raise click.UsageError(f"two runs are named {twice}; export them one by one")
    for directory, name in zip(directories, names, strict=True):
        folder = _beside(directory) if out is None else out / name if several else out
        for path in export_tables(directory, to, folder, chosen):
            click.echo(str(path))
    _tell_losses(directories)


def _tell_losses(directories: Sequence[Path]) -> None:
    """Name on stderr the recordings that hold less than was run, as the report's first lines do."""
    from tautwave.recordings.recording import read_recording

    for directory in directories:
        recording = read_recording(directory, ["time_s"])
        if recording.truncated:
            click.echo(
                f"{directory}: the recording is cut short, as when a run is killed; "
                f"{len(recording)} rows could be recovered and were exported",
                err=True,
            )
        if recording.damaged_chunks:
            click.echo(
                f"{directory}: {recording.damaged_chunks} chunks of the recording are damaged and "
                "were skipped",
                err=True,
            )


def _beside(run: Path) -> Path:
    return (run.parent if run.is_file() else run) / "export"
