"""The parts of the page that have figures: pairs, the certificate."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from tautwave.canvas import alone, svg
from tautwave.errors import TautwaveError
from tautwave.files import write_bytes, write_text
from tautwave.report.html import anchor, image, picture, table
from tautwave.report.run import tables
from tautwave.report.run.rundir import Run
from tautwave.report.run.verdicts import describe_pair, units_of
from tautwave.report.run.views import EnergyView, PairView, view_energy, view_pair
from tautwave.report.units import quantity
from tautwave.summary.markup import Markup

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Picture(NamedTuple):
    """A figure in the page, and as an SVG beside it."""

    name: str
    figure: Figure
    alt: str
    caption: str = ""

    def keep(self, directory: Path) -> tuple[int, Callable[[], Markup]]:
        """Write the file; return its size, and a function that makes its HTML."""
        drawn = svg(self.figure, self.name, self.alt)
        write_text(directory / f"{self.name}.svg", alone(drawn))
        return len(drawn), lambda: picture(drawn, self.caption)

    def beside(self) -> Markup:
        """Return the note in the page if the figure is too large for it."""
        note = f"{self.alt}: too large for this page, in {self.name}.svg beside it."
        return Markup('<p class="note">{}</p>').format(note)


class Still(NamedTuple):
    """A drawing, as PNGs for light and dark backgrounds."""

    name: str
    light: bytes
    dark: bytes
    alt: str
    caption: str

    def keep(self, directory: Path) -> tuple[int, Callable[[], Markup]]:
        """Write the file; return its size in the page, and a function that makes its HTML."""
        write_bytes(directory / f"{self.name}.png", self.light)
        size = 4 * (len(self.light) + len(self.dark)) // 3
        return size, lambda: image(self.light, "png", self.alt, self.caption, self.dark)

    def beside(self) -> Markup:
        """Return the note in the page if the drawing is too large for it."""
        return Markup('<p class="note">{}: in {}.png next to this page.</p>').format(
            self.alt, self.name
        )


class File(NamedTuple):
    """A file of the run's directory, shown inside the page and linked."""

    path: Path
    show: Callable[[bytes], Markup]
    caption: str

    def keep(self, _directory: Path) -> tuple[int, Callable[[], Markup]]:
        """Return its size in the page, and a function that makes its HTML."""
        data = self.path.read_bytes()
        return 4 * len(data) // 3, lambda: self.show(data) + self._link("also as")

    def beside(self) -> Markup:
        """Return a link if the file is too large for the page."""
        return self._link("in")

    def _link(self, word: str) -> Markup:
        name = self.path.name
        return Markup('<p class="note">{}, {} <a href="{}">{}</a> next to this page.</p>').format(
            self.caption, word, name, name
        )


Part = Markup | Picture | Still | File


def pair_parts(run: Run) -> Iterator[Part]:
    """Yield the figures and contacts of every pair: several folded, below an overview."""
    views = [view_pair(run, pair) for pair in run.pairs]
    if len(views) < 2:
        for view in views:
            yield Markup('<h2 id="{}">Pair {}</h2>').format(anchor(view.name), view.name)
            yield from _pair(run, view)
        return
    yield Markup('<h2 id="pairs">Pairs</h2>')
    yield from _overview(run, views)
    for view in views:
        yield Markup('<h3 id="{}">Pair {}</h3>').format(anchor(view.name), view.name)
        yield Markup("<details><summary>{}</summary>").format(_summary(run, view.name))
        yield from _pair(run, view)
        yield Markup("</details>")


def _overview(run: Run, views: list[PairView]) -> Iterator[Part]:
    from tautwave.report.figures.overview import is_flat, overview_figure

    yield table(tables.tracking_table(run))
    if not run.rows:
        return
    figure = overview_figure(views)
    if figure is not None:
        yield Picture("pairs", figure, "positions and transmitted efforts of all pairs")
    flat = [view.name for view in views if is_flat(view)]
    if flat:
        note = f"Not shown, because nothing moved and nothing was transmitted: {', '.join(flat)}."
        yield Markup('<p class="note">{}</p>').format(note)


def _summary(run: Run, pair: str) -> str:
    """One line that summarises a folded section."""
    figures = run.result_of(pair)
    position, effort = units_of(run, pair)
    errors = (
        ("position", figures.position_error, position), ("effort", figures.effort_error, effort),
    )  # fmt: skip
    parts = [
        f"{what} error at most {quantity(error.max, unit)}"
        for what, error, unit in errors
        if error is not None and error.max is not None
    ]
    return f"Figures of {pair}" + (f": {', '.join(parts)}" if parts else "")


def _pair(run: Run, view: PairView) -> Iterator[Part]:
    from tautwave.report.figures import books, overview, pair

    name = view.name
    stem = anchor(name).removeprefix("part-")
    yield Markup('<p class="soft">{}</p>').format(describe_pair(run, name))
    if run.rows == 0:
        return
    offset = "" if "expected" not in view.lines else view.wording.offset_caption
    acting = "Efforts act on the device and are positive along its position."
    waves = "A wave arrives unchanged after the delay; half its square is a power."
    made: list[tuple[str, Callable[[PairView], Figure | None], str, str]] = [
        ("tracking", pair.tracking_figure, "position and position error", offset),
        ("velocity", overview.velocity_figure, "velocity against its limit", ""),
        ("effort", pair.effort_figure, "efforts of coupling, wall, hand and environment", acting),
        ("contact", pair.contact_figure, "force against depth in contact", ""),
        ("waves", pair.wave_figure, "waves in both directions", waves),
    ]
    for what, make, alt, caption in made:
        figure = make(view)
        if figure is not None:
            yield Picture(f"{stem}-{what}", figure, f"{name}: {alt}", caption)
        if what == "contact":
            yield from _contacts(run, view)
    energy: EnergyView = view_energy(run, name)
    energy.least = view.least.get("energy", 0.0)
    figure = books.energy_figure(energy, name)
    if figure is not None:
        yield Picture(f"{stem}-energy", figure, f"{name}: energy of every element")
    flat = [*view.flat, *energy.flat]
    if flat:
        note = f"Not shown, because it stays constant: {', '.join(flat)}."
        yield Markup('<p class="note">{}</p>').format(note)


def _contacts(run: Run, view: PairView) -> Iterator[Markup]:
    made = [table(content) for content in tables.contact_table(view)]
    if made:
        yield Markup('<div class="columns">{}</div>').format(Markup("<div>{}</div>").each(made))
        return
    known = [f"true.slave.{view.name}.environment_effort"]
    known += [f"{side}.{view.name}.wall_effort" for side in ("slave", "master")]
    if view.held:
        note = "The environment is a spring, always in contact: there are no contacts to list."
    elif any(column in run.columns for column in known):
        note = "No contact in this run."
    else:
        note = (
            "Contacts cannot be determined: the recording holds neither the true environment "
            "nor a virtual wall."
        )
    yield Markup('<p class="note">{}</p>').format(note)


def certificate_picture(run: Run) -> Picture | str:
    """Return the certificate's figure, or a note why there is none."""
    from tautwave.certificate.picture import certificate_figure

    if not run.rig_text:
        return "No rig file to certify."
    try:
        figure = certificate_figure(run.checked_rig)
    except (TautwaveError, ArithmeticError) as err:
        reason = str(err).splitlines()[0].replace(f"{run.directory}/", "")
        return f"The certificate of this rig cannot be drawn: {reason}"
    return Picture("certificate", figure, "certificate of this rig")
