"""`tautwave report`: rebuild the page of a run, or compare two runs."""

from __future__ import annotations

from pathlib import Path

import click

from tautwave.cli.options import PATH, positive
from tautwave.errors import RecordingError


@click.command(short_help="Rebuild the report of a run, or compare two.")
@click.argument("directory", type=PATH, metavar="DIR")
@click.argument("other", type=PATH, metavar="[DIR2]", required=False)
@click.option(
    "--out",
    type=PATH,
    metavar="DIR",
    help="Output directory of a comparison (default: compare-DIR-DIR2 beside DIR2) or of the "
    "figures (default: DIR/figures).",
)
@click.option(
    "--figures",
    "kind",
    type=click.Choice(["pdf", "svg"]),
    help="For papers: write each figure of the report to its own file, without title, and no page.",
)
@click.option(
    "--width",
    type=click.FloatRange(40.0, 400.0),
    callback=positive,
    metavar="MM",
    help="Width of these figures; default 174, two columns of most journals (one is about 84).",
)
@click.option(
    "--font-size",
    type=click.FloatRange(4.0, 24.0),
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
) -> None:
    """Rebuild the report of the run in DIR, or compare it with the one in DIR2.

    Works from the recording, even if the run was killed before it could write its summary.

    \b
    Examples:
        tautwave report runs/first
        tautwave report runs/first runs/second --out runs/first-against-second
        tautwave report runs/first --figures pdf --width 84 --font 'DejaVu Serif'
    """
    for run in (directory, other):
        if run is not None and not run.is_dir():
            raise RecordingError(f"{run}: there is no such directory; give the --out of a run")
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

        click.echo(write_report(directory))
        return

    from tautwave.report import compare_reports

    names = f"compare-{directory.resolve().name}-{other.resolve().name}"
    click.echo(compare_reports(directory, other, out or other.resolve().parent / names))


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
        raise RecordingError(f"{directory}: there is nothing to draw; the recording has no rows")
