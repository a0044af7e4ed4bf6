"""`tautwave report`: rebuild the page of a run, or compare it with another or with a recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from tautwave.cli.options import (
    PATH,
    Number,
    echo_json,
    file_options,
    of_kind,
    positive,
    run_argument,
    stated_of,
)
from tautwave.errors import RecordingError
from tautwave.kinds import RECORDING, RUN, TABLE


def _print_schema(ctx: click.Context, param: click.Parameter, wanted: bool) -> None:
    if not wanted or ctx.resilient_parsing:
        return
    from tautwave.summary import summary_schema

    echo_json(summary_schema())
    ctx.exit(0)


@click.command(short_help="Rebuild the report of a run, or compare two.")
@run_argument
@click.option(
    "--schema",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_print_schema,
    help="Print the JSON Schema of summary.json and exit.",
)
@click.argument("other", type=PATH, metavar="[DIR2]", required=False, callback=of_kind(RUN))
@click.option(
    "--out",
    type=PATH,
    metavar="DIR",
    help="Output directory of a comparison (default: compare-DIR-DIR2 beside DIR2) or of the "
    "figures (default: DIR/figures).",
)
@click.option(
    "--against",
    type=PATH,
    callback=of_kind(RECORDING, RUN, TABLE),
    metavar="FILE",
    help="Compare the run with a recording of the same motion: run, MCAP, CSV or MAT file.",
)
@click.option(
    "--map",
    "mapped",
    multiple=True,
    metavar="OURS=THEIRS",
    help="--against: the file's column for one of the run's; it may have a sign or factor "
    "(slave.lever.commanded=-tau). Default: match by name.",
)
@click.option("--time", metavar="COLUMN", help="--against: the file's column of the time.")
@file_options("--against")
@click.option(
    "--from",
    "begin_s",
    type=Number(),
    metavar="S",
    help="[s] --against: compare from this time on.",
)
@click.option("--to", "end_s", type=Number(), metavar="S", help="--against: up to here.")
@click.option(
    "--figures",
    "kind",
    type=click.Choice(["pdf", "svg"]),
    help="For papers: write each figure of the report to its own file, without titles or a page.",
)
@click.option(
    "--width",
    type=Number(40.0, 400.0),
    callback=positive,
    metavar="MM",
    help="Width of these figures; default 174, two columns of most journals (one is about 84).",
)
@click.option(
    "--font-size",
    type=Number(4.0, 24.0),
    callback=positive,
    metavar="PT",
    help="Font size of these figures [pt]; default 8.",
)
@click.option(
    "--font",
    metavar="NAME",
    help="Font family, such as 'DejaVu Serif'; default DejaVu Sans. Embedded in a PDF, outlined "
    "in an SVG.",
)
def report(
    directory: Path,
    other: Path | None,
    out: Path | None,
    kind: str | None,
    width: float | None,
    font_size: float | None,
    font: str | None,
    against: Path | None,
    mapped: tuple[str, ...],
    time: str | None,
    time_unit: str | None,
    rate: float | None,
    columns: str | None,
    episode: int | None,
    begin_s: float | None,
    end_s: float | None,
) -> None:
    """Rebuild the report of the run in DIR, or compare it with the one in DIR2 or with a FILE.

    Works from the recording, even if the run was killed before it could write its summary.

    \b
    Examples:
        tautwave report runs/first
        tautwave report runs/first runs/second --out runs/first-against-second
        tautwave report runs/first --against bench.csv
        tautwave report runs/first --figures pdf --width 84 --font 'DejaVu Serif'
    """
    for run in (directory, other):
        if run is not None and not run.is_dir():
            raise RecordingError(f"{run}: no such directory; give the --out of a run")
    only: dict[str, Any] = {"--map": mapped, "--time": time, "--time-unit": time_unit}
    told = {"time_unit": time_unit, "rate": rate, "columns": columns, "episode": episode}
    only |= {"--rate": rate, "--columns": columns, "--episode": episode}
    only |= {"--from": begin_s, "--to": end_s}
    if against is not None:
        if other is not None or kind is not None:
            raise click.UsageError("--against compares one run with one file; give no other run.")
        part = {"time": time, "begin_s": begin_s, "end_s": end_s, "stated": stated_of(told)}
        _against(directory, against, mapped, out, part)
        return
    for name, value in only.items():
        if value not in (None, ()):
            raise click.UsageError(f"{name} requires --against FILE.")
    if kind is not None:
        if other is not None:
            raise click.UsageError("--figures works on one run; give one directory.")
        _figures(directory, out or directory / "figures", kind, width, font_size, font)
        return
    if width is not None or font_size is not None or font is not None:
        raise click.UsageError("--width, --font-size and --font require --figures pdf|svg.")
    if other is None:
        if out is not None:
            raise click.UsageError("--out is only for a comparison or --figures.")
        from tautwave.report import write_report

        click.echo(write_report(directory, replace=False))
        return

    from tautwave.report import compare_reports

    names = f"compare-{directory.resolve().name}-{other.resolve().name}"
    click.echo(compare_reports(directory, other, out or other.resolve().parent / names))


def _against(
    directory: Path, file: Path, mapped: Sequence[str], out: Path | None, part: Mapping[str, Any]
) -> None:
    import json

    from tautwave.canvas import png
    from tautwave.cli.terminal.show import show
    from tautwave.files import make_directory, write_bytes, write_text
    from tautwave.recordings.columns import recording_file
    from tautwave.report.against import compare_recording
    from tautwave.report.figures.against import against_figure
    from tautwave.report.run.loading import load_run
    from tautwave.report.units import quantity, significant
    from tautwave.tables import Table

    if not recording_file(file).exists():
        raise RecordingError(f"{file}: no such recording")
    run = load_run(directory)
    notes: list[str] = []
    compared = compare_recording(run, file, mapped, notes=notes, **part)
    folder = out or directory / f"against-{file.resolve().stem}"
    make_directory(folder)
    written = folder / "against.json"
    listed = {one.name: one.as_dict() for one in compared}
    write_text(written, json.dumps({"file": str(file), "columns": listed}, indent=2) + "\n")
    picture = folder / "against.png"
    title = f"{run.name} against {file.resolve().name}"
    write_bytes(picture, png(against_figure(title, compared)))
    rows = []
    for one in compared:
        recorded, ours, apart = one.rms
        rows.append(
            (
                one.name,
                quantity(recorded, one.unit, 3),
                quantity(ours, one.unit, 3),
                significant(ours / recorded, 3) if recorded else "-",
                quantity(apart, one.unit, 3),
                "-" if one.explained is None else f"{max(one.explained, 0.0):.0%}",
            )
        )
    heads = ("rms of", ">recorded", ">this run", ">ratio", ">difference", ">explained")
    first, last = compared[0].time_s[0], compared[0].time_s[-1]
    show(
        [
            Table(f"{title}, {first:.3g} to {last:.3g} s", (), ()),
            Table("", heads, rows),
            *([Table("Notes", ("",), [(note,) for note in notes])] if notes else []),
            Table("Files", ("",), [(str(written),), (str(picture),)]),
        ]
    )


def _figures(
    directory: Path,
    out: Path,
    kind: str,
    width: float | None,
    size: float | None,
    font: str | None,
) -> None:
    from tautwave.canvas import Style, find_font
    from tautwave.report import write_figures

    style = Style((width or 174.0) / 25.4, size or 8.0, titled=False)
    if font is not None:
        style = style._replace(family=find_font(font))
    written = write_figures(directory, out, kind, style)
    for path in written:
        click.echo(path)
    if not written:
        raise RecordingError(f"{directory}: nothing to draw: the recording has no rows")
