"""`python -m tests.lab papers`: figures and tables of the papers this started from."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from tautwave.cli.options import echo_json, json_option, out_option
from tautwave.cli.terminal.show import plain_text, show
from tautwave.errors import TautwaveError
from tautwave.tables import BAD, Cell, Table


@click.command(short_help="Reproduce the figures and tables of the original papers.")
@click.argument("name", required=False)
@out_option(
    "Write the figures (SVG and PNG) and the table (TXT and JSON) of the chapter NAME to DIR; "
    "without NAME, of all chapters."
)
@json_option
@click.pass_context
def papers(ctx: click.Context, name: str | None, out: Path | None, as_json: bool) -> None:
    """Recompute the numbers of chapter NAME and show them next to the published ones.

    Without NAME and --out: list the chapters. Exit code 1 if a number differs by more than the
    published digits allow.

    \b
    Examples:
        python -m tests.lab papers
        python -m tests.lab papers resonator
        python -m tests.lab papers --out papers
    """
    from tests.lab.papers import CHAPTERS, chapter, draw_chapter

    if name is None and out is None:
        if as_json:
            echo_json([{"name": key, "summary": text} for key, text in CHAPTERS.items()])
        else:
            show([Table("Chapters", ("name", "what it shows"), list(CHAPTERS.items()))])
        return
    names = list(CHAPTERS) if name is None else [name]
    chapters = {key: chapter(key) for key in names}
    found = {key: one.rows() for key, one in chapters.items()}
    sections = [_section(key, computed) for key, computed in found.items()]
    data = {key: [{**row._asdict(), "agrees": row.agrees} for row in computed]
            for key, computed in found.items()}  # fmt: skip
    drawn: list[Path] = []
    if out is not None:
        from tautwave.files import make_directory, write_text

        make_directory(out)
        for key, section in zip(names, sections, strict=True):
            write_text(out / f"{key}.txt", plain_text([section]))
            text = json.dumps(data[key], indent=2, ensure_ascii=False)
            write_text(out / f"{key}.json", f"{text}\n")
            drawn += draw_chapter(key, out)
    if as_json:
        echo_json(data)
    else:
        show([*sections, Table("Figures", ("",), [(str(path),) for path in drawn])])
    differ = [
        f"{key}: {row.what}"
        for key, computed in found.items()
        for row in computed
        if not row.agrees
    ]
    if differ:
        raise DiffersError(f"differs from the reference: {'; '.join(differ)}")


class DiffersError(TautwaveError):
    """A number differs from its reference."""

    exit_code = 1


def _section(name: str, computed: Sequence[Any]) -> Table:
    rows: list[tuple[str | Cell, ...]] = []
    for row in computed:
        verdict: str | Cell = "" if row.agrees else Cell("differs", BAD)
        rows.append((row.what, f"{row.obtained:.9g}", f"{row.reference:.9g}", row.unit,
                     row.source, verdict))  # fmt: skip
    heads = ("", ">obtained", ">reference", "unit", "source", "")
    return Table(name, heads, rows)
