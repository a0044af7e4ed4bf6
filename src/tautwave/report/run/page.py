"""The report of one run: figures beside the recording, and one self-contained page."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from pathlib import Path

from tautwave.canvas import Style, paper, styled
from tautwave.files import make_directory, write_bytes, write_text
from tautwave.report.html import (
    anchor,
    badge,
    banner,
    details,
    judged_banners,
    page,
    table,
    verdict_rows,
)
from tautwave.report.run import tables
from tautwave.report.run.operation import episode_table, journal_table
from tautwave.report.run.page_hooks import page_hooks
from tautwave.report.run.parts import Part, Picture, certificate_picture, pair_parts
from tautwave.report.run.rundir import Run
from tautwave.report.run.verdicts import outcome, uncertified, verdicts
from tautwave.report.units import plural, quantity
from tautwave.summary.ending import events
from tautwave.summary.markup import Markup

PAGE = "report.html"

PICTURE_BYTES = 2_000_000
"""Total size of figures, animations and sounds inside the page; anything beyond is a file beside
it."""


def write_page(run: Run) -> Path:
    """Write figures (SVG) and `report.html` into the directory of a run.

    Works with incomplete runs: a truncated recording, no simulation truth, no summary.

    Returns
    -------
    Path
        Of the page: one file, no script, nothing from the network.
    """
    parts: list[Markup] = []
    spent = 0
    for part in body_of(run):
        if isinstance(part, Markup):
            parts.append(part)
            continue
        size, inside = part.keep(run.directory)
        spent += size
        parts.append(inside() if spent <= PICTURE_BYTES else part.beside())
        spent -= size if spent > PICTURE_BYTES else 0
    target = run.directory / PAGE
    write_text(target, page(f"{run.name} – tautwave report", parts))
    return target


def write_figures(run: Run, out: Path, kind: str, style: Style) -> list[Path]:
    """Write every figure of a run's report into `out`, for a paper.

    Parameters
    ----------
    kind : `pdf` or `svg`
    style : width, font size and family

    Raises
    ------
    WritingError
        `out` cannot be written.
    """
    written = []
    with styled(style):
        for part in body_of(run):
            if isinstance(part, Picture):
                path = out / f"{part.name}.{kind}"
                make_directory(out)
                write_bytes(path, paper(part.figure, kind, salt=part.name))
                written.append(path)
    return written


def body_of(run: Run) -> Iterator[Part]:
    """Yield the parts of a run's page in their order."""
    yield from _head(run)
    if run.began:
        yield from _motion(run)
    yield from _certificate(run)
    yield from _axes(run)
    yield from _contents(run)
    yield from _reproduce(run)


def _motion(run: Run) -> Iterator[Part]:
    """The content for a run with at least one cycle."""
    yield from _operation(run)
    yield from _arms(run)  # before the pairs: pictures of many pairs leave no room for it
    yield from pair_parts(run)
    if run.ports:
        yield from page_hooks().parts(run)
    yield from _link(run)
    yield from _books(run)
    yield from _precision(run)
    yield from _reported(run)
    yield from _timing(run)


def _operation(run: Run) -> Iterator[Part]:
    if run.result.operation is not None:
        yield Markup('<h2 id="operation">Operation</h2>')
        yield table(episode_table(run))
        yield table(journal_table(run))


def _arms(run: Run) -> Iterator[Part]:
    from tautwave.report.arms.files import arm_parts, has_arms

    if has_arms(run):
        yield from arm_parts(run)


def _head(run: Run) -> Iterator[Markup]:
    ended = outcome(run)
    yield Markup('<header><div class="top"><h1>{}</h1>{}</div>').format(run.name, badge(ended))
    yield Markup('<p class="soft">{}</p></header>').format(_subtitle(run))
    if ended.status == "bad":
        yield banner(ended.topic.capitalize(), ended.sentences, "bad")
    else:
        yield Markup("<p>{}</p>").each(ended.sentences)
    if uncertified(run):
        title = "This rig ran without a certificate (--allow-uncertified)"
        yield banner(title, uncertified(run), "bad")
    yield from judged_banners(run)
    if run.notes:
        yield banner("This report is incomplete", run.notes, "note")
    yield verdict_rows(verdicts(run))
    links = []
    if run.began:
        links += [("Operation", "operation")] if run.result.operation else []
        links += [(f"Pair {pair}", anchor(pair)) for pair in run.pairs]
        links += [("Scene", "scene")] if run.ports else []
        links += [("Energy books", "books"), ("Precision", "precision"), ("Timing", "timing")]
    links += [
        ("Certificate", "certificate"),
        ("Axes", "axes"),
        ("Used and unused elements", "contents"),
        ("Rig and reproduction", "reproduce"),
    ]
    yield Markup("<nav>{}</nav>").format(
        Markup(" ").join(Markup('<a href="#{}">{}</a>').format(to, t) for t, to in links)
    )


def _subtitle(run: Run) -> str:
    summary = run.result
    parts = []
    started = summary.started_utc or run.metadata.get("started_utc")
    if started:
        parts.append(str(started).replace("T", " ").replace("Z", " UTC").replace("+00:00", " UTC"))
    if summary.duration_s is not None:
        parts.append(f"{quantity(summary.duration_s, 's')} recorded")
    if run.rate_hz == run.rate_hz:
        parts.append(quantity(run.rate_hz, "Hz"))
    parts.append("a scene" if run.ports else plural(len(run.pairs), "pair"))
    parts += events(summary)
    clock = summary.clock
    if clock:
        parts.append("simulated clock" if clock == "fake" else f"{clock} clock")
    return " · ".join(parts)


def _link(run: Run) -> Iterator[Markup]:
    if run.site is not None:
        from tautwave.report.joined import session_table

        yield Markup('<h2 id="link">Other site</h2>')
        yield table(session_table(run))


def _books(run: Run) -> Iterator[Markup]:
    yield Markup('<h2 id="books">Energy books</h2>')
    yield table(tables.claim_table(run))
    yield table(tables.books_table(run))
    yield table(tables.element_table(run))
    yield table(tables.plant_table(run))


def _precision(run: Run) -> Iterator[Markup]:
    from tautwave.report.precision.table import precision_sentences, precision_tables

    yield Markup('<h2 id="precision">Precision</h2>')
    sentences = list(precision_sentences(run))
    for sentence in sentences or ["Not computed for this run."]:
        yield Markup('<p class="soft">{}</p>').format(sentence)
    for content in precision_tables(run):
        yield table(content)


def _reported(run: Run) -> Iterator[Markup]:
    own = tables.reported_table(run)
    if own.rows:
        yield Markup('<h2 id="reported">Drivers and law</h2>')
        yield table(own)


def _certificate(run: Run) -> Iterator[Part]:
    yield Markup('<h2 id="certificate">Certificate</h2>')
    made = certificate_picture(run)
    yield made if isinstance(made, Picture) else Markup('<p class="note">{}</p>').format(made)
    from tautwave.report.feel import feel_of, feel_table  # simulates

    felt = feel_of(run)
    if felt:
        yield table(feel_table(felt))


def _timing(run: Run) -> Iterator[Part]:
    yield Markup('<h2 id="timing">Timing</h2>')
    if run.result.clock == "fake":
        yield (
            Markup(
                '<p class="note">This loop ran on the simulated clock: no cycle can be late, '
                "so there is nothing to draw.</p>"
            )
        )
    elif run.rows:
        from tautwave.report.figures.books import timing_figure

        figure = timing_figure(run)
        if figure is not None:
            alt = "histograms of period, lateness and compute time, and the slow cycles in time"
            yield Picture("timing", figure, alt)
    both = (table(tables.timing_table(run)), table(tables.loop_table(run)))
    yield Markup('<div class="columns"><div>{}</div><div>{}</div></div>').format(both[0], both[1])
    sentences = run.result.realtime
    if sentences:
        yield Markup("<h3>What the machine permitted</h3><ul>")
        yield Markup("<li>{}</li>").each(sentences) + Markup("</ul>")


def _axes(run: Run) -> Iterator[Markup]:
    yield Markup('<h2 id="axes">Axes</h2>')
    yield table(tables.axis_table(run)) or Markup('<p class="note">No counts were recorded.</p>')
    yield table(tables.watch_table(run))
    yield table(tables.way_table(run))
    yield from _buses(run)


def _buses(run: Run) -> Iterator[Markup]:
    """What each driver found, wrote and read back before enabling."""
    for name, bus in run.result.buses.items():
        if not bus.notes:
            continue
        yield Markup("<h3>Bus {}: found and set before enabling</h3><ul>").format(name)
        yield Markup("<li>{}</li>").each(bus.notes) + Markup("</ul>")


def _contents(run: Run) -> Iterator[Markup]:
    yield Markup('<h2 id="contents">Used and unused elements</h2>')
    both = (
        table(tables.included_table(run)),
        table(tables.left_out_table(run)) or Markup('<p class="note">All elements are used.</p>'),
    )
    yield Markup('<div class="columns"><div>{}</div><div>{}</div></div>').format(both[0], both[1])


def _as_typed(directory: Path) -> str:
    """Return a directory as a person would type it here: below this folder, else from the root."""
    whole = directory.resolve()
    here = Path.cwd()
    return shlex.quote(str(whole.relative_to(here) if whole.is_relative_to(here) else whole))


def _reproduce(run: Run) -> Iterator[Markup]:
    summary = run.result
    yield Markup('<h2 id="reproduce">Rig and reproduction</h2>')
    command = summary.command or run.metadata.get("command")
    yield Markup("<p>Command of this run:</p>")
    yield Markup("<pre>{}</pre>").format(command or "not recorded")
    yield Markup("<p>The same run from its own resolved rig, and this page again:</p>")
    folder = _as_typed(run.directory)
    clock = " --clock fake" if summary.clock == "fake" else tables.simulated_by(run)
    yield Markup("<pre>tautwave run {}/rig.yaml{}\ntautwave report {}</pre>").format(
        folder, clock, folder
    )
    version = summary.version or run.metadata.get("version")
    version_text = f"tautwave {version}" if version else "version not recorded"
    yield Markup('<p class="soft">{}</p>').format(version_text)
    if run.rig_text:
        yield details("The resolved rig, rig.yaml", run.rig_text)
