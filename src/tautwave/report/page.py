"""The report of one run: figures beside the recording, and one page that needs nothing else."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from tautwave.report import tables
from tautwave.report.html import (
    anchor,
    badge,
    banner,
    details,
    page,
    picture,
    table,
    verdict_rows,
)
from tautwave.report.loading import load_run
from tautwave.report.rundir import Run, is_space
from tautwave.report.units import plural, quantity
from tautwave.report.verdicts import describe_pair, invalidated, outcome, uncertified, verdicts
from tautwave.report.views import PairView, view_energy, view_pair

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PICTURE_BYTES = 1_900_000  # of all PNGs together; base64 and the rest keep the page under 3 MB


_OFFSET = {
    True: "Dotted in the error: the offset F τ / b of a line of delay τ and impedance b that "
    "transmits F. The rest is what the devices' own dynamics cost.",
    False: "Dotted in the error: by how much the effort F stretches the coupling's spring K.",
}


class Picture(NamedTuple):
    """A figure as it stands on the page and as a file beside it."""

    name: str
    png: bytes
    alt: str
    caption: str


def write_report(directory: Path) -> Path:
    """Write figures (PNG) and `report.html` into the directory of a run.

    Works from whatever the run left: a cut recording, no simulation truth, no summary.

    Returns
    -------
    Path
        Of the page: one file, no script, nothing from the network.

    Raises
    ------
    RecordingError
        There is neither a summary nor a readable recording.
    """
    directory = Path(directory)
    run = load_run(directory)
    dpi = 115.0 if len(run.pairs) <= 3 else 90.0 if len(run.pairs) <= 6 else 72.0
    parts: list[str] = []
    spent = 0
    for part in _body(run, dpi):
        if isinstance(part, str):
            parts.append(part)
            continue
        (directory / part.name).write_bytes(part.png)
        spent += len(part.png)
        if spent <= PICTURE_BYTES:
            parts.append(picture(part.png, part.alt, part.caption))
        else:
            parts.append(
                f'<p class="note">{escape(part.alt)}: too large for this page, in '
                f"{escape(part.name)} beside it.</p>"
            )
    target = directory / "report.html"
    write_whole(target, page(f"{run.name} – tautwave report", parts))
    return target


def write_whole(target: Path, text: str) -> None:
    """Replace a file in one step, so that nobody ever sees half a page."""
    draft = target.with_name(target.name + ".part")
    draft.write_text(text, encoding="utf-8")
    os.replace(draft, target)


def _body(run: Run, dpi: float) -> Iterator[str | Picture]:
    yield from _head(run)
    for pair in run.pairs:
        yield from _pair(run, pair, dpi)
    if run.ports:
        yield from _scene(run, dpi)
    yield from _books(run)
    yield from _precision(run)
    yield from _timing(run, dpi)
    yield from _axes(run)
    yield from _contents(run)
    yield from _reproduce(run)


def _head(run: Run) -> Iterator[str]:
    ended = outcome(run)
    yield f'<header><div class="top"><h1>{escape(run.name)}</h1>{badge(ended)}</div>'
    yield f'<p class="soft">{escape(_subtitle(run))}</p></header>'
    if ended.status == "bad":
        yield banner(ended.topic.capitalize(), ended.sentences, "bad")
    else:
        yield "".join(f"<p>{escape(sentence)}</p>" for sentence in ended.sentences)
    if uncertified(run):
        title = "This rig was not certified, and ran with --allow-uncertified"
        yield banner(title, uncertified(run), "bad")
    if invalidated(run):
        title = "What this run measured breaks its certificate"
        yield banner(title, invalidated(run), "bad")
    if run.notes:
        yield banner("This report is incomplete", run.notes, "note")
    yield verdict_rows(verdicts(run))
    links = [(f"Pair {pair}", anchor(pair)) for pair in run.pairs]
    links += [("Scene", "scene")] if run.ports else []
    links += [
        ("Energy books", "books"),
        ("Precision", "precision"),
        ("Timing", "timing"),
        ("Axes", "axes"),
        ("In and left out", "contents"),
        ("Rig and reproduction", "reproduce"),
    ]
    yield "<nav>" + " ".join(f'<a href="#{to}">{escape(t)}</a>' for t, to in links) + "</nav>"


def _subtitle(run: Run) -> str:
    summary = run.summary
    parts = []
    started = summary.get("started_utc") or run.metadata.get("started_utc")
    if started:
        parts.append(str(started).replace("T", " ").replace("Z", " UTC").replace("+00:00", " UTC"))
    if summary.get("duration_s") is not None:
        parts.append(f"{quantity(summary['duration_s'], 's')} recorded")
    if run.rate_hz == run.rate_hz:
        parts.append(quantity(run.rate_hz, "Hz"))
    parts.append("a scene" if run.ports else plural(len(run.pairs), "pair"))
    clock = summary.get("clock")
    if clock:
        parts.append("simulated clock" if clock == "fake" else f"{clock} clock")
    return " · ".join(parts)


def _pair(run: Run, pair: str, dpi: float) -> Iterator[str | Picture]:
    from tautwave.report import books_figures, figures
    from tautwave.report.canvas import png

    yield f'<h2 id="{anchor(pair)}">Pair {escape(pair)}</h2>'
    yield f'<p class="soft">{escape(describe_pair(run, pair))}</p>'
    if run.rows == 0:
        return
    view = view_pair(run, pair)
    made: list[tuple[str, Callable[[], Figure | None], str, str]] = [
        (
            "tracking",
            lambda: figures.tracking_figure(view),
            "position and position error",
            "" if "expected" not in view.lines else _OFFSET[view.law == "wave"],
        ),
        (
            "effort",
            lambda: figures.effort_figure(view),
            "efforts of coupling, wall, hand and environment",
            "Efforts act on the device and are positive along its position.",
        ),
        ("contact", lambda: figures.contact_figure(view), "force against depth in contact", ""),
        (
            "waves",
            lambda: figures.wave_figure(view),
            "waves in both directions",
            "A wave arrives as it left, later by the delay; half its square is a power.",
        ),
    ]
    for name, make, alt, caption in made:
        figure = make()
        if figure is not None:
            file = f"{anchor(pair).removeprefix('part-')}-{name}.png"
            yield Picture(file, png(figure, dpi), f"{pair}: {alt}", caption)
        if name == "contact":
            yield from _contacts(run, view)
    energy = view_energy(run, pair)
    figure = books_figures.energy_figure(energy, pair)
    if figure is not None:
        file = f"{anchor(pair).removeprefix('part-')}-energy.png"
        yield Picture(file, png(figure, dpi), f"{pair}: energy of every element", "")


def _scene(run: Run, dpi: float) -> Iterator[str | Picture]:
    from tautwave.report import scene_figure, scene_view
    from tautwave.report.canvas import png

    yield '<h2 id="scene">Scene</h2>'
    if is_space(run):
        yield from _space(run, dpi)
        return
    view = scene_view.view_scene(run)
    if view is None:
        yield '<p class="note">Nothing of the scene was recorded.</p>'
        return
    network = view.network
    ports = ", ".join(network.ports)
    told = f"{plural(len(network.masses), 'mass')} and {plural(len(network.links), 'link')}"
    told = told.replace("masss", "masses")
    yield f'<p class="soft">{escape(told)} under {escape(ports)}.</p>'
    alt = "positions, effort and energies of the scene"
    yield Picture("scene.png", png(scene_figure.scene_figure(view), dpi), alt, "")
    yield _drawn(scene_figure.still(view))
    yield table(tables.scene_table(run))


def _space(run: Run, dpi: float) -> Iterator[str | Picture]:
    from tautwave.report import space_drawing, space_figure, space_view
    from tautwave.report.canvas import png

    view = space_view.view_space(run)
    if view is None:
        yield '<p class="note">Nothing of the scene was recorded.</p>'
        return
    network = view.network
    ports = ", ".join(f"{port.name} ({', '.join(port.axes)})" for port in network.ports)
    told = f"{len(network.masses)} masses and {len(network.links)} links in space under {ports}."
    yield f'<p class="soft">{escape(told)}</p>'
    alt = "heights, efforts and energies of the scene"
    yield Picture("scene.png", png(space_figure.space_figure(view), dpi), alt, "")
    yield _drawn(space_drawing.space_still(view))
    yield table(tables.scene_table(run))


def _drawn(still: bytes) -> Picture:
    caption = "The scene when the device felt most; scene.gif moves, output.wav sounds."
    return Picture("scene-still.png", still, "the scene, drawn", caption)


def _contacts(run: Run, view: PairView) -> Iterator[str]:
    made = [table(content) for content in tables.contact_table(view)]
    if made:
        yield f'<div class="columns">{"".join(f"<div>{part}</div>" for part in made)}</div>'
        return
    known = [f"true.slave.{view.name}.environment_effort"]
    known += [f"{side}.{view.name}.wall_effort" for side in ("slave", "master")]
    if view.held:
        told = "The environment is a spring that never lets go: there are no contacts to list."
    elif any(column in run.columns for column in known):
        told = "There was no contact in this run."
    else:
        told = (
            "Contacts cannot be told here: the recording holds neither the true environment nor "
            "a virtual wall."
        )
    yield f'<p class="note">{told}</p>'


def _books(run: Run) -> Iterator[str]:
    yield '<h2 id="books">Energy books</h2>'
    yield table(tables.books_table(run))
    yield table(tables.element_table(run))
    yield table(tables.plant_table(run))


def _precision(run: Run) -> Iterator[str]:
    from tautwave.report.precision_table import precision_sentences, precision_tables

    yield '<h2 id="precision">Precision</h2>'
    sentences = list(precision_sentences(run))
    for sentence in sentences or ["Not computed for this run."]:
        yield f'<p class="soft">{escape(sentence)}</p>'
    for content in precision_tables(run):
        yield table(content)


def _timing(run: Run, dpi: float) -> Iterator[str | Picture]:
    yield '<h2 id="timing">Timing</h2>'
    if run.summary.get("clock") == "fake":
        yield (
            '<p class="note">A simulated clock ran this loop as fast as it computes: no cycle was '
            "late, and there is nothing to draw.</p>"
        )
    elif run.rows:
        from tautwave.report.books_figures import timing_figure
        from tautwave.report.canvas import png

        figure = timing_figure(run)
        if figure is not None:
            alt = "histograms of period, lateness and compute time, and the slow cycles in time"
            yield Picture("timing.png", png(figure, dpi), alt, "")
    both = (table(tables.timing_table(run)), table(tables.loop_table(run)))
    yield f'<div class="columns"><div>{both[0]}</div><div>{both[1]}</div></div>'
    told = run.summary.get("realtime")
    if isinstance(told, list) and told:
        yield "<h3>What the machine permitted</h3><ul>"
        yield "".join(f"<li>{escape(str(sentence))}</li>" for sentence in told) + "</ul>"


def _axes(run: Run) -> Iterator[str]:
    yield '<h2 id="axes">Axes</h2>'
    yield table(tables.axis_table(run)) or '<p class="note">No counts were recorded.</p>'
    yield from _buses(run)


def _buses(run: Run) -> Iterator[str]:
    """What each driver found, wrote and read back before it enabled anything."""
    buses = run.summary.get("buses")
    for name, found in buses.items() if isinstance(buses, dict) else ():
        notes = found.get("notes") if isinstance(found, dict) else None
        if not isinstance(notes, list) or not notes:
            continue
        yield f"<h3>Bus {escape(str(name))}: found and set before enabling</h3><ul>"
        yield "".join(f"<li>{escape(str(note))}</li>" for note in notes) + "</ul>"


def _contents(run: Run) -> Iterator[str]:
    yield '<h2 id="contents">In and left out</h2>'
    both = (
        table(tables.included_table(run), "text"),
        table(tables.left_out_table(run), "text")
        or '<p class="note">Nothing is said to have been left out.</p>',
    )
    yield f'<div class="columns"><div>{both[0]}</div><div>{both[1]}</div></div>'


def _reproduce(run: Run) -> Iterator[str]:
    summary = run.summary
    yield '<h2 id="reproduce">Rig and reproduction</h2>'
    command = summary.get("command") or run.metadata.get("command")
    yield "<p>The command of this run:</p>"
    yield f"<pre>{escape(str(command or 'not recorded'))}</pre>"
    yield "<p>The same run from its own resolved rig, and this page again:</p>"
    folder = escape(run.directory.name or str(run.directory))
    clock = " --clock fake" if summary.get("clock") == "fake" else ""
    yield f"<pre>tautwave run {folder}/rig.yaml{clock}\ntautwave report {folder}</pre>"
    version = summary.get("version") or run.metadata.get("version")
    told = [f"tautwave {version}" if version else "version not recorded"]
    for name, value in (summary.get("versions") or {}).items():
        told.append(f"{name} {value}")
    yield f'<p class="soft">{escape(", ".join(told))}</p>'
    if run.rig_text:
        yield details("The resolved rig, rig.yaml", run.rig_text)
