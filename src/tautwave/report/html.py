"""Pieces of the page: escaped text, tables, pictures inside the file. No script, no network."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from tautwave.canvas import DARK, INK, PAPER, alone, dark_rules, svg
from tautwave.canvas.paint import DARK_QUERY
from tautwave.files import write_text
from tautwave.report.run.rundir import Run
from tautwave.report.run.verdicts import Verdict, generated, invalidated, warnings
from tautwave.summary.markup import Markup
from tautwave.tables import Cell, Table, text_of, titled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STYLE = """
:root { color-scheme: light dark; --paper: #ffffff; --ink: #1b1f23; --soft: #57606a;
  --rule: #d8dee4; --pale: #f6f8fa; --head: #8c959f; --on: #ffffff;
  --ok: #1a6b3c; --note: #8a5a00; --bad: #a61b1b; --open: #4a5568; --info: #1f4e79;
  --bad-ground: #fdf1f1; --note-ground: #fdf7ea; }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 28px 24px 64px; max-width: 1040px; background: var(--paper);
  color: var(--ink); font: 15px/1.5 system-ui, "Segoe UI", "Noto Sans", "DejaVu Sans", sans-serif; }
h1 { font-size: 27px; line-height: 1.2; margin: 0; overflow-wrap: anywhere; }
h2 { font-size: 20px; margin: 44px 0 6px; padding-bottom: 5px; border-bottom: 2px solid var(--ink);
  overflow-wrap: anywhere; }
h3 { font-size: 15px; margin: 22px 0 6px; }
p { margin: 6px 0; }
.top { display: flex; flex-wrap: wrap; align-items: center; gap: 8px 14px; }
.soft, figcaption, .note { color: var(--soft); font-size: 13.5px; }
.badge { color: var(--on); border-radius: 4px; padding: 3px 10px; font-size: 14px; font-weight: 600;
  white-space: nowrap; }
.badge.ok { background: var(--ok); } .badge.note { background: var(--note); }
.badge.bad { background: var(--bad); } .badge.open { background: var(--open); }
.badge.info { background: var(--info); }
.banner { border: 1px solid; border-left-width: 7px; border-radius: 4px; padding: 9px 14px;
  margin: 14px 0 0; }
.banner.bad { border-color: var(--bad); background: var(--bad-ground); }
.banner.note { border-color: var(--note); background: var(--note-ground); }
.banner b { display: block; }
.verdicts { margin: 18px 0 0; border-top: 1px solid var(--rule); }
.verdict { display: grid; grid-template-columns: 120px 152px 1fr; gap: 4px 14px; padding: 9px 0;
  border-bottom: 1px solid var(--rule); align-items: baseline; }
.verdict > b { font-size: 15px; }
.verdict p { margin: 0; }
.mark { font-weight: 600; font-size: 13.5px; white-space: nowrap; }
.mark::before { content: ""; display: inline-block; width: 10px; height: 10px; margin-right: 7px;
  border-radius: 50%; background: currentColor; }
.mark.ok { color: var(--ok); } .mark.note { color: var(--note); } .mark.bad { color: var(--bad); }
.mark.info { color: var(--info); } .mark.open { color: var(--open); }
.mark.open::before { background: none; border: 2px solid currentColor; }
.mark.bad::before { border-radius: 0; }
nav { margin: 14px 0 0; font-size: 14px; }
nav a { margin-right: 14px; color: var(--info); }
figure { margin: 16px 0 4px; max-width: 880px; break-inside: avoid; }
figure img, figure svg { display: block; width: 100%; height: auto; }
figure img.drawn { width: auto; max-width: min(100%, 560px); max-height: 720px;
  border: 1px solid var(--rule); border-radius: 6px; }
audio { display: block; width: 100%; max-width: 560px; margin: 10px 0; }
details { margin: 8px 0; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; margin: 6px 0 4px; font-size: 14px;
  font-variant-numeric: tabular-nums; break-inside: avoid; }
caption { text-align: left; font-weight: 600; padding: 12px 0 4px; }
th, td { padding: 4px 14px 4px 0; text-align: right; border-bottom: 1px solid var(--rule);
  vertical-align: top; }
thead th { color: var(--soft); font-weight: 600; font-size: 13px;
  border-bottom-color: var(--head); }
td.text, th.text { text-align: left; }
td.ok { color: var(--ok); } td.note { color: var(--note); } td.bad { color: var(--bad); }
td.faint { color: var(--soft); }
td:first-child { font-weight: 500; min-width: 7.5em; overflow-wrap: anywhere; }
.sides { display: grid; grid-template-columns: 1fr 1fr; gap: 0 40px; }
.sides .verdict { grid-template-columns: 1fr; }
.columns { display: flex; flex-wrap: wrap; gap: 0 52px; }
pre { background: var(--pale); border: 1px solid var(--rule); border-radius: 4px;
  padding: 10px 12px;
  font: 12.5px/1.45 ui-monospace, "DejaVu Sans Mono", monospace; white-space: pre-wrap;
  overflow-wrap: anywhere; }
summary { cursor: pointer; font-weight: 600; }
@media print { body { padding: 0; max-width: none; font-size: 11pt; } nav { display: none; }
  h2 { break-after: avoid; } .badge, .banner, .mark::before { print-color-adjust: exact; } }
@media (max-width: 700px) { body { padding: 16px 12px 48px; }
  .verdict, .sides { grid-template-columns: 1fr; } th, td { padding-right: 9px; } }
"""
_DARK = f"""
@media {DARK_QUERY} {{
:root {{ --paper: {DARK[PAPER]}; --ink: {DARK[INK]}; --soft: #9aa4ad; --rule: #313a43;
  --pale: #1d232a; --head: #6b7680; --on: #10141a; --ok: #5ccb8f; --note: #e3b14f; --bad: #ff8d86;
  --open: #a7b2bd; --info: #79b8f2; --bad-ground: #331c1e; --note-ground: #30291a; }}
{dark_rules("figure")}
img.turned {{ filter: invert(0.92) hue-rotate(180deg); border-color: #d8dee4; }}
}}
"""

_MARKS = {
    "ok": "OK",
    "note": "warning",
    "bad": "failed",
    "open": "not evaluated",
    "info": "measured",
}


def page(title: str, body: Iterable[object]) -> Markup:
    """A whole document, complete in one file; what is no `Markup` in it is escaped."""
    policy = "default-src 'none'; img-src data:; media-src data:; style-src 'unsafe-inline'"
    return Markup("\n").join(
        [
            Markup("<!DOCTYPE html>"),
            Markup('<html lang="en">'),
            Markup("<head>"),
            Markup('<meta charset="utf-8">'),
            Markup('<meta http-equiv="Content-Security-Policy" content="{}">').format(policy),
            Markup('<meta name="viewport" content="width=device-width, initial-scale=1">'),
            Markup("<title>{}</title>").format(title),
            Markup("<style>{}{}</style>").format(Markup(STYLE), Markup(_DARK)),
            Markup("</head>"),
            Markup("<body>"),
            *body,
            Markup("</body>"),
            Markup("</html>"),
            "",
        ]
    )


def picture(drawn: str, caption: str = "") -> Markup:
    """A figure's SVG inside the page; it carries its own description for screen readers."""
    return Markup("<figure>{}{}</figure>").format(Markup(drawn), _under(caption))


def image(data: bytes, kind: str, alt: str, caption: str = "", dark: bytes = b"") -> Markup:
    """A PNG or a GIF inside the page, and its dark counterpart.

    Without one the browser inverts lightness and keeps the hues approximately.
    """
    other = Markup()
    if dark:
        media = Markup(' media="{}"').format(DARK_QUERY)
        other = Markup('<source{} srcset="{}">').format(media, _inside(dark, f"image/{kind}"))
    looks = "drawn" if dark else "drawn turned"
    shown = Markup('<img class="{}" src="{}" alt="{}">').format(
        looks, _inside(data, f"image/{kind}"), alt
    )
    return Markup("<figure><picture>{}{}</picture>{}</figure>").format(
        other, shown, _under(caption)
    )


def sound(data: bytes, label: str) -> Markup:
    """A WAV file inside the page, with the browser's controls."""
    source = _inside(data, "audio/wav")
    return Markup('<audio controls preload="none" src="{}" aria-label="{}"></audio>').format(
        source, label
    )


def _inside(data: bytes, kind: str) -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode('ascii')}"


def _under(caption: str) -> Markup:
    return Markup("<figcaption>{}</figcaption>").format(caption) if caption else Markup()


def table(content: Table) -> Markup:
    """A table, or nothing if it has no rows."""
    if not content.rows:
        return Markup()

    def cells(row: Sequence[str | Cell], tag: str) -> Markup:
        return Markup().join(
            Markup("<{}{}>{}</{}>").format(tag, _class(name, cell), text_of(cell), tag)
            for name, cell in zip(content.columns, row, strict=True)
        )

    rows = Markup("\n").join(Markup("<tr>{}</tr>").format(cells(row, "td")) for row in content.rows)
    note = Markup('<p class="note">{}</p>').format(content.note) if content.note else Markup()
    caption = Markup("<caption>{}</caption>").format(content.title) if content.title else Markup()
    return Markup(
        '<div class="wide"><table>{}<thead><tr>{}</tr></thead><tbody>{}</tbody></table></div>{}'
    ).format(caption, cells(titled(content.columns), "th"), rows, note)


def _class(column: str, cell: str | Cell) -> Markup:
    """Return the classes of a cell: those of its column, and of how serious it is."""
    words = [] if column.startswith(">") else ["text"]
    words += [cell.level] if isinstance(cell, Cell) and cell.level else []
    return Markup(' class="{}"').format(" ".join(words)) if words else Markup()


def verdict_rows(verdicts: Iterable[Verdict]) -> Markup:
    """The verdicts, each with its status as text and colour."""
    rows = []
    for topic, status, sentences in verdicts:
        mark = "not yet evaluated" if topic == "Certificate" and status == "open" else None
        text = Markup("<p>{}</p>").each(sentences)
        rows.append(
            Markup(
                '<div class="verdict"><b>{}</b><span class="mark {}">{}</span><div>{}</div></div>'
            ).format(topic, status, mark or _MARKS[status], text)
        )
    return Markup('<div class="verdicts">{}</div>').format(Markup().join(rows))


def banner(title: str, sentences: Iterable[str], status: str) -> Markup:
    """A prominent box."""
    text = Markup("<p>{}</p>").each(sentences)
    return Markup('<div class="banner {}"><b>{}</b>{}</div>').format(status, title, text)


def judged_banners(run: Run) -> Iterator[Markup]:
    """Yield what a run's measurements broke, in red, and what it has to be warned of."""
    if invalidated(run):
        title = "What this run measured invalidates its certificate"
        if generated(run):
            title = "This run generated energy"
        yield banner(title, invalidated(run), "bad")
    warned = warnings(run)
    if warned:
        yield banner("Warnings", warned, "note")


def badge(verdict: Verdict) -> Markup:
    """The outcome as a coloured word."""
    return Markup('<span class="badge {}">{}</span>').format(verdict.status, verdict.topic)


def details(title: str, text: str) -> Markup:
    """Long text that opens on a click, without any script."""
    return Markup("<details><summary>{}</summary><pre>{}</pre></details>").format(title, text)


def folded(title: str, parts: Iterable[Markup]) -> Iterable[Markup]:
    """Parts of a page that open on a click."""
    yield Markup("<details><summary>{}</summary>").format(title)
    yield from parts
    yield Markup("</details>")


def anchor(text: str) -> str:
    """A safe identifier for a heading, whatever the name of the pair."""
    return "part-" + file_stem(text)


def file_stem(name: str) -> str:
    """A pair's name as a part of a file's."""
    return "".join(c if c.isascii() and c.isalnum() else "-" for c in name)


def kept_picture(folder: Path, name: str, figure: Figure, alt: str) -> Markup:
    """A figure for the page that is kept as `name`.svg in `folder` as well."""
    drawn = svg(figure, name, alt)
    write_text(folder / f"{name}.svg", alone(drawn))
    return picture(drawn)
