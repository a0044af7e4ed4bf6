"""Both sites of a session on one page: their recordings joined by slot, the books of the pair.

Slots of the two sites differ by a constant, `slots_ahead` of their summaries, known to half the
least round trip; energies do not depend on it but for what is under way in between.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tautwave.report.figures.envelope import Floats
from tautwave.report.html import file_stem, judged_banners, kept_picture, page, table
from tautwave.report.run.complete import sensing_gap
from tautwave.report.run.rebuild import element_books
from tautwave.report.run.rundir import Run, kind_of, pair_settings
from tautwave.report.units import axis_units, number, quantity, ratio
from tautwave.summary.markup import Markup
from tautwave.summary.model import Motors, Session
from tautwave.tables import Table, of_numbers

SIDES = ("master", "slave")
STEP = 0.05
"""Slots between two offsets of the clocks at which energy between the sites is looked at."""


class Common(NamedTuple):
    """One session that both sites recorded, of master and slave.

    `rows` slot by slot; `all_rows`, and when the cycles of these began and ended, in slots of the
    slave; `offset`: the slave's position [rad or m] for master 0, by pair; `doubt`: slots by which
    the clocks may be off.
    """

    session: str
    rows: tuple[Any, Any]
    offset: dict[str, float]
    begins: tuple[Floats, Floats]
    ends: tuple[Floats, Floats]
    all_rows: tuple[Any, Any]
    doubt: float


def sites_of(runs: tuple[Run, Run]) -> tuple[Run, Run] | None:
    """Return the master's and the slave's run if they share a session, else None."""
    by_side = {run.site: run for run in runs}
    if set(by_side) != set(SIDES):
        return None
    ids = [{s.id for s in _sessions(run)} for run in runs]
    return (by_side["master"], by_side["slave"]) if ids[0] & ids[1] else None


def _sessions(run: Run) -> Sequence[Session]:
    link = run.result.link
    return () if link is None else link.sessions


def common_sessions(master: Run, slave: Run) -> Iterator[Common]:
    """Yield what both sites recorded of each session that both engaged in."""
    theirs = {s.id: (at, s) for at, s in enumerate(_sessions(slave), 1)}
    for at, mine in enumerate(_sessions(master), 1):
        other_at, other = theirs.get(mine.id, (0, None))
        if other is None or mine.engaged_s is None or other.engaged_s is None:
            continue
        # Each side sees the other's packets a little late: the mean of both is right.
        seen = (mine.slots_ahead, other.slots_ahead)
        known = [sign * one for sign, one in zip((1.0, -1.0), seen, strict=True) if one is not None]
        ahead = sum(known) / len(known) if known else 0.0
        doubt = 1.0 + max((abs(one - ahead) for one in known), default=0.0)
        if not known:  # too short to know, and what was under way at a time is not known either
            doubt = math.inf
        elif len(known) < 2:  # only the way of one side's packets is known, and not for how long
            doubt = 1.0 + 2.0 * max(_unknown(run) * run.rate_hz for run in (master, slave))
        slots, places, begins, ends = [], [], [], []
        for run, count, less in ((master, at, ahead), (slave, other_at, 0.0)):
            read = run.read("link.session", "link.slot", "lateness_us", "compute_us")
            rows = np.flatnonzero((read["link.session"] == count) & (read["link.slot"] >= 0))
            slots.append(read["link.slot"][rows] - round(less))
            late = 1e-6 * read["lateness_us"][rows] * run.rate_hz
            begins.append(read["link.slot"][rows] - less + late)
            ends.append(begins[-1] + 1e-6 * read["compute_us"][rows] * run.rate_hz)
            places.append(rows)
        _, one, two = np.intersect1d(slots[0], slots[1], return_indices=True)
        offset = {
            pair: (other.began_at.get(pair) or 0.0) - _ratio(master, pair) * (begin or 0.0)
            for pair, begin in mine.began_at.items()
        } | {pair: at or 0.0 for pair, at in other.offsets.items()}
        paired = (places[0][one], places[1][two])
        yield Common(
            mine.id,
            paired,
            offset,
            (begins[0], begins[1]),
            (ends[0], ends[1]),
            (places[0], places[1]),
            doubt,
        )


def _unknown(run: Run) -> float:
    """Return by how much a site's idea of the other's clock may be off [s]."""
    link = run.result.link
    return 0.0 if link is None or link.clocks is None else link.clocks.unknown_s or 0.0


def _ratio(run: Run, pair: str) -> float:
    """Return slave motion per master motion."""
    keys = pair_settings(run, pair)
    sign = number(keys.get("sign"))
    return (1.0 if sign is None else sign) * (number(keys.get("position_scale")) or 1.0)


def joined_summary(master: Run, slave: Run) -> dict[str, Any]:
    """Return tracking and closed books of every pair over all common sessions, as plain data.

    `residual` is what entered at both devices less what both sites stored and dissipated, the
    network's share included [J]; `under_way_least`: the least that was between the sites, not
    below the reserves of both receivers if neither got what the other did not send. That takes both
    clocks together, so it is known to lie between two numbers, those of the offsets that what the
    sites saw of each other allows. `under_way_at_end` needs no clock: all that was sent in a
    session less all that was received, the least of all sessions. `sensing_gap`: what noise and
    steps of both encoders added to `entered` and `dissipated`, None where a site has hardware.
    """
    sessions = list(common_sessions(master, slave))
    pairs = {}
    for pair in master.pairs:
        places = [positions(master, slave, pair, one) for one in sessions]
        errors = [one - two for one, two in places if one.size]
        error = np.concatenate(errors) if errors else np.zeros(0)
        books = [_books(run, side, pair) for run, side in zip((master, slave), SIDES, strict=True)]
        flow = sum(one["gross_flow"] for one in books)
        away = [_under_way(master, slave, pair, one) for one in sessions]
        known = [one for one in away if one is not None]
        least = zip(*((min(one.least), max(one.least)) for one in known if one.least), strict=True)
        span = [min(one) for one in least]
        pairs[pair] = {
            "kind": kind_of(master, pair),
            "position_error": None if not error.size else {
                "rms": float(np.sqrt(np.mean(error**2))), "max": float(np.max(np.abs(error))),
            },
            "entered": sum(one["entered"] for one in books),
            "stored": sum(one["stored"] for one in books),
            "dissipated": sum(one["dissipated"] for one in books),
            "given": _sum(one.worst for one in _motors((master, slave), pair)),
            "claimed": _sum(one.stated_debt for one in _motors((master, slave), pair)),
            "residual": sum(one["residual"] for one in books),
            "gross_flow": flow,
            "sensing_gap": _sum(
                sensing_gap(run, f"{side}.{pair}", _weight(run, side, pair))
                for run, side in zip((master, slave), SIDES, strict=True)
            ),
            "under_way_least": span or None,
            "under_way_at_end": min((one.at_end for one in known), default=None),
        }  # fmt: skip
    return {
        "sessions": [one.session for one in sessions],
        "slots": sum(len(one.rows[0]) for one in sessions),
        "same_rig": len({run.result.link and run.result.link.shared for run in (master, slave)})
        == 1,
        "pairs": pairs,
    }


def positions(master: Run, slave: Run, pair: str, common: Common) -> tuple[Floats, Floats]:
    """Return the positions of both devices in a session, slot by slot [master's rad or m]."""
    one = master.read(f"master.{pair}.position").get(f"master.{pair}.position")
    two = slave.read(f"slave.{pair}.position").get(f"slave.{pair}.position")
    if one is None or two is None:
        return np.zeros(0), np.zeros(0)
    keys = pair_settings(master, pair)
    ratio_of, declared = _ratio(master, pair), keys.get("offset")
    offset = common.offset.get(pair, 0.0)
    if isinstance(declared, int | float) and pair not in common.offset:
        offset = -ratio_of * float(declared)
    return one[common.rows[0]], (two[common.rows[1]] - offset) / ratio_of


def _books(run: Run, side: str, pair: str) -> dict[str, float]:
    """Return the sums of one site's books [J]."""
    names = (f"{side}.{pair}.port_energy", f"{side}.{pair}.gross_flow")
    read = run.read(*names)
    entered = read[names[0]] - read[names[0]][0]
    stored, lost = np.zeros(run.rows), np.zeros(run.rows)
    for element in run.elements(pair):
        books = element_books(run, pair, element)
        if books is not None:
            stored += books[1] - books[1][0]
            lost += books[2] - books[2][0]
    return {
        "entered": float(entered[-1]),
        "stored": float(stored[-1]),
        "dissipated": float(lost[-1]),
        "residual": float(np.max(np.abs(entered - stored - lost))),
        "gross_flow": float(read[names[1]][-1]),
    }


def gap_remark(pair: str, books: dict[str, Any]) -> str:
    """Return a sentence on dissipated energy that is negative by the encoders; empty otherwise."""
    lost, gap = books["dissipated"], books["sensing_gap"]
    if gap is None or lost >= 0.0 or gap > 0.5 * lost:
        return ""
    return (
        f"{pair}: of {quantity(lost, 'J')} dissipated, {quantity(gap, 'J')} are the sensing "
        "gap, noise of the encoders and no energy of the motors; without it "
        f"{quantity(lost - gap, 'J')}."
    )


def _weight(run: Run, side: str, pair: str) -> float:
    """Return the pair's energy per energy of one of its devices."""
    return 1.0 if side == "master" else 1.0 / (run.result_of(pair).power_ratio or 1.0)


def _motors(runs: tuple[Run, Run], pair: str) -> list[Motors]:
    """Return what is known of the motors of both sites."""
    return [run.result_of(pair).motors or Motors() for run in runs]


def _sum(values: Iterable[float | None]) -> float | None:
    """Return the sum, None if one of them is not known."""
    terms = list(values)
    known = [one for one in terms if one is not None]
    return sum(known) if len(known) == len(terms) else None


class Away(NamedTuple):
    """Energy between the sites in a session [J]: the least at each offset tried, and at its end."""

    least: Sequence[float]
    at_end: float


def _under_way(master: Run, slave: Run, pair: str, common: Common) -> Away | None:
    """Return what was between the sites at every offset of both clocks that may be."""
    names = [f"{pair}.{element}.stored" for element in ("network", "credits")]
    halves = [next(iter(run.read(*names).values()), None) for run in (master, slave)]
    if any(half is None or not len(half) for half in halves):
        return None
    tried: Any = ()
    if math.isfinite(common.doubt):
        tried = np.linspace(-common.doubt, common.doubt, 1 + 2 * math.ceil(common.doubt / STEP))
    balances = [_least_away(halves, common, float(later)) for later in tried]
    least = [one for one in balances if one is not None]
    ends = [
        float(half[rows[-1]])
        for half, rows in zip(halves, common.all_rows, strict=True)
        if half is not None and len(rows)
    ]
    return Away(least, sum(ends)) if ends else None


def _least_away(halves: Sequence[Any], common: Common, later: float) -> float | None:
    """Return it with the master's clock later by some slots."""
    begins = common.begins[0] + later, common.begins[1]
    ends = common.ends[0] + later, common.ends[1]
    # Moments at which neither side is in a cycle: each then has what it had after its last one.
    moments = np.concatenate(ends)
    total, known = np.zeros(len(moments)), np.ones(len(moments), bool)
    for half, rows, began, ended in zip(halves, common.all_rows, begins, ends, strict=True):
        at = np.searchsorted(began, moments, "right") - 1
        known &= (at >= 0) & (at < len(began) - 1)
        known[known] &= ended[at[known]] <= moments[known]
        total += half[rows][np.clip(at, 0, None)]
    return float(np.min(total[known])) if known.any() else None


def joined_page(master: Run, slave: Run, joined: dict[str, Any], folder: Path) -> str:
    """Return the page of both sites; its figures are kept in `folder` too."""
    title = f"{master.name}: both sites – tautwave"
    return page(title, _body(master, slave, joined, folder))


def _body(master: Run, slave: Run, joined: dict[str, Any], folder: Path) -> Iterator[Markup]:
    yield Markup("<h1>{}: both sites</h1>").format(master.name)
    names = " and ".join(str(run.directory.resolve().name) for run in (master, slave))
    many = "" if len(joined["sessions"]) == 1 else "s"
    yield (
        Markup(
            '<p class="soft">{}, joined by slot: {} slots of {} common session{} ({'
            "}). Each site's times count from the start of its own run.</p>"
        ).format(
            names, joined["slots"], len(joined["sessions"]), many, ", ".join(joined["sessions"])
        )
    )
    if not joined["same_rig"]:
        yield Markup(
            '<p class="note">Keys that must match on both sites differ in the summaries.</p>'
        )
    rows = []
    remarks = []
    for pair, books in joined["pairs"].items():
        if remark := gap_remark(pair, books):
            remarks.append(remark)
        unit, _ = axis_units(books["kind"])
        error = books["position_error"] or {}
        rows.append(
            (
                pair, quantity(error.get("rms"), unit), quantity(error.get("max"), unit),
                quantity(books["entered"], "J"), quantity(books["stored"], "J"),
                quantity(books["dissipated"], "J"), quantity(books["sensing_gap"], "J"),
                quantity(books["given"], "J"), quantity(books["claimed"], "J"),
                quantity(books["residual"], "J"),
                ratio(books["residual"] / books["gross_flow"]) if books["gross_flow"] else "",
                " to ".join(quantity(one, "J") for one in books["under_way_least"] or ()),
                quantity(books["under_way_at_end"], "J"),
            )
        )  # fmt: skip
    yield table(
        Table(
            "Pairs",
            of_numbers(
                "pair",
                "position error, rms",
                "max",
                "entered",
                "stored",
                "dissipated",
                "sensing gap",
                "supplied",
                "claimed",
                "residual",
                "of gross flow",
                "in transit, least",
                "at the end",
            ),
            tuple(rows),
            "Entered: through both devices, as their encoders see it. Dissipated is negative where "
            "ports supplied more from their reserves than they absorbed, or where noise of the "
            "encoders, met by an effort, looks like energy supplied. That share is the sensing "
            "gap: what the books have beyond what the motors really took in, known where both "
            "sites are simulated; no motor gave it. Supplied: the maximum from both sites' motors, "
            "and the prior claim. The residual is the largest energy that both accounts together "
            "did not explain. In transit: sent by one site and not yet received; its minimum is "
            "known only to within two values, because the clocks are not known better. The value "
            "at the end of a session needs no clock.",
        )
    )
    for remark in remarks:
        yield Markup('<p class="soft">{}</p>').format(remark)
    from tautwave.report.figures.joined import joined_figure

    sessions = list(common_sessions(master, slave))
    for pair, books in joined["pairs"].items():
        lines = [positions(master, slave, pair, one) for one in sessions]
        figure = None
        if master.time is not None:
            times = [master.time[one.rows[0]] for one in sessions]
            figure = joined_figure(pair, axis_units(books["kind"])[0], times, lines)
        if figure is not None:
            yield kept_picture(folder, f"joined-{file_stem(pair)}", figure, f"tracking of {pair}")
    for run, side in zip((master, slave), SIDES, strict=True):
        yield Markup("<h2>{}</h2>").format(side)
        yield from judged_banners(run)
        yield table(session_table(run))


def session_table(run: Run) -> Table:
    """Return what became of the sessions of one site."""
    rows = []
    for at, session in enumerate(_sessions(run), 1):
        counts = "; ".join(
            f"{quantity(one.at_s, 's')}: {one.why}"
            + ("" if one.for_s is None else f", back after {quantity(one.for_s, 's')}")
            for one in session.silences
        )
        engaged = session.engaged_s
        begun = "not engaged" if engaged is None else quantity(engaged, "s")
        rows.append((str(at), session.id, begun, counts))
    link = run.result.link
    notes = [] if link is None else [one for one in (link.ended, link.lost) if one]
    if link is not None and link.clocks is not None:
        notes.append(
            f"clock of the other site: {1e6 * (link.clocks.rate or 0.0):+.1f} ppm, delays of one "
            f"way are uncertain by +-{quantity(link.clocks.unknown_s, 's')} (half the round trips)"
        )
    refused = {} if link is None else {why: n for why, n in link.refused.items() if n}
    if refused:
        notes.append("refused datagrams: " + ", ".join(f"{n} {why}" for why, n in refused.items()))
    return Table(
        "Sessions", ("", "session", "engaged at", "held"), tuple(rows), "; ".join(notes)
    )  # fmt: skip
