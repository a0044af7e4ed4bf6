"""`python -m tests.lab couplings --frontier`: error over motor noise, in table and figure."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from tautwave import canvas
from tautwave.bench.result import Goal, Suite, Table, Value
from tautwave.certificate import certify
from tests.lab.couplings.frontier import BEST, LAB, SETTINGS, Point, frontier, rig_of
from tests.lab.port.hands import Hand, recorded_hands, synthetic_hands

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Tell = Callable[[str], None]

NOISES = (1.5e-5, 9e-5)
"""As in the recordings; as the documents of the bench have it [rad]."""

BARS: Mapping[str, float] = {"free": 0.5, "foam": 0.5, "spring": 0.7, "rigid": 0.7}
LOUDEST = 1.5
"""Greatest effort above 20 Hz over that of the laboratory's law."""

PICTURE = "frontier"


def frontier_suite(
    *, recordings: Path | None, quick: bool = False, out: Path | None = None, tell: Tell
) -> Suite:
    """Run every setting on every hand, at both noises.

    Parameters
    ----------
    recordings : Path, optional
        Folder of recorded hands; synthetic ones if not given.
    quick : bool
        One hand per contact, the laboratory's law and the best setting, one noise.
    out : Path, optional
        Directory for the figure.
    tell : callable
        Called with what starts.

    Raises
    ------
    ConfigError
        The folder has no recordings.
    """
    hands = synthetic_hands() if recordings is None else recorded_hands(recordings)
    settings = SETTINGS
    if quick:
        hands = list({hand.contact: hand for hand in hands}.values())
        settings = (SETTINGS[0], BEST)
    whose = "hands recorded" if recordings is not None else "synthetic hands (--recordings DIR)"
    tables: list[Table] = []
    goals: list[Goal] = []
    found: dict[float, dict[str, list[Point]]] = {}
    for noise in NOISES[:1] if quick else NOISES:
        engine = "python" if quick else "compiled"
        points = frontier(hands, noise, settings=settings, engine=engine, tell=tell)
        found[noise] = points
        tables += [_table(points, noise, whose), each_hand(points, noise)]
        goals += _goals(points, noise)
    goals.append(_certified(hands))
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        noise = NOISES[0]
        figure = frontier_figure(found[noise], noise)
        drawn = canvas.svg(figure, PICTURE, "Tracking error over motor noise, by coupling")
        (out / f"{PICTURE}.svg").write_text(canvas.alone(drawn), encoding="utf-8")
        (out / f"{PICTURE}.pdf").write_bytes(canvas.paper(figure, "pdf"))
    return Suite("frontier", tables, goals)


def _table(points: Mapping[str, Sequence[Point]], noise: float, whose: str) -> Table:
    rows: list[list[Value]] = [
        [
            contact,
            at.setting.family,
            at.setting.name,
            1e3 * at.error,
            at.share,
            1e3 * at.effort,
            at.over_lab,
            at.ended or None,
        ]
        for contact, each in points.items()
        for at in each
    ]
    return Table(
        f"Error and motor noise, slave's encoder noise {noise:g} rad",
        f"Medians over the {whose}, the master's motion imposed: rms of master minus slave, over "
        "the recorded; both motors above 20 Hz, over those of the law that was recorded, in the "
        "same simulation; runs that ended early.",
        ("contact", "coupling", "setting", "error_mrad", "over recorded", "effort_mNm", "over lab",
         "ended"),
        rows,
    )  # fmt: skip


def each_hand(points: Mapping[str, Sequence[Point]], noise: float) -> Table:
    """Return the one setting on each of the hands."""
    rows: list[list[Value]] = [
        [it.hand, 1e3 * it.known, 1e3 * it.lab, 1e3 * it.error, it.share, it.over_lab]
        for each in points.values()
        for at in each
        if at.setting == BEST
        for it in at.scores
    ]
    return Table(
        f"{BEST.family}, {BEST.name}: each hand, {noise:g} rad",
        "rms of master minus slave: as recorded, of the laboratory's law in the same simulation, "
        "of this setting, and this over the recorded; its effort over that of the laboratory's "
        "law. A stiffer law of the laboratory (b, e; c, f) left less to be bettered.",
        ("hand", "recorded_mrad", "lab's_mrad", "error_mrad", "over recorded", "over lab"),
        rows,
    )


def _goals(points: Mapping[str, Sequence[Point]], noise: float) -> list[Goal]:
    goals = []
    for contact, each in points.items():
        best = next(at for at in each if at.setting == BEST)
        where = f"{contact}, {noise:g} rad"
        goals += [
            Goal(f"error over the recorded, {where}", BARS[contact], "times", best.share),
            Goal(f"effort above 20 Hz over lab's, {where}", LOUDEST, "times", best.over_lab),
        ]
    return goals


def _certified(hands: Sequence[Hand]) -> Goal:
    """Return whether the best setting passes on everything that the hands meet."""
    one_each = {hand.contact: hand for hand in hands}.values()
    with TemporaryDirectory() as folder:
        passed = all(
            certify(rig_of(BEST, hand, noise, Path(folder))).as_dict()["passed"]
            for hand in one_each
            for noise in NOISES
        )
    return Goal(f"{BEST.family}, {BEST.name}, is certified", 1.0, "", float(passed), at_least=True)


TICKS = (0.5, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0)

LOOKS: Mapping[str, tuple[str, str]] = {
    LAB: (canvas.INK, "s"),
    "wave": (canvas.MASTER, "o"),
    "position, account": (canvas.SLAVE, "^"),
    "four_channel, account": (canvas.WALL, "D"),
    BEST.family: (canvas.LINE, "P"),
}


def frontier_figure(points: Mapping[str, Sequence[Point]], noise: float) -> Figure:
    """Return error over effort for each contact, a curve per coupling, the laboratory's points."""
    title = f"Error over motor noise on recorded hands, encoder {noise:g} rad"
    figure, axes = canvas.panels([2.0] * ((len(points) + 1) // 2), title, False, columns=2)
    for panel, (contact, each) in zip(axes, points.items(), strict=False):
        _panel(panel, contact, each)
    for panel in axes[len(points) :]:
        panel.set_axis_off()
    for panel in axes[-2:]:
        panel.set_xlabel("motors above 20 Hz, over the laboratory's")
    for panel in axes[::2]:
        panel.set_ylabel("error over recorded")
    canvas.key(figure)
    return figure


def _panel(panel: Axes, contact: str, each: Sequence[Point]) -> None:
    low, high = 0.3, 1.3 * max(at.over_lab for at in each if at.over_lab == at.over_lab)
    panel.fill_between(
        [low, LOUDEST], 0.0, BARS[contact], color=canvas.PASSIVE, linewidth=0, label="asked for"
    )
    for family, (colour, marker) in LOOKS.items():
        own = [at for at in each if at.setting.family == family]
        panel.plot(
            [at.over_lab for at in own],
            [at.share for at in own],
            color=colour,
            marker=marker,
            markersize=4,
            linestyle="none" if family == LAB else "-",
            label=canvas.plain(family),
        )
    for at in each:
        place = (at.over_lab, at.share)
        if at.setting.family == LAB:
            panel.annotate(
                at.setting.name, place, xytext=(4, 4), textcoords="offset points",
                color=canvas.SOFT, fontsize="x-small",
            )  # fmt: skip
        elif at.setting == BEST:
            panel.plot(
                *([value] for value in place), color=canvas.INK, marker="o", markersize=9,
                linestyle="none", markerfacecolor="none", label="one setting for all",
            )  # fmt: skip
    panel.set_xscale("log")
    panel.set_xlim(low, high)
    ticks = [it for it in TICKS if low <= it <= high]
    panel.set_xticks(ticks, [f"{it:g}" for it in ticks])
    panel.set_xticks([], minor=True)
    panel.set_ylim(0.0, 1.1 * max(at.share for at in each if at.share == at.share))
    canvas.heading(panel, contact)
