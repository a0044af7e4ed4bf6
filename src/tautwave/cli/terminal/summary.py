"""The result of a run on one screen, from its summary. Missing values are not shown."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from tautwave.cli.terminal.screen import NUMBER, as_one, axes_named, folded, spanned
from tautwave.cli.terminal.show import printable
from tautwave.report.calm import CHATTER_THRESHOLD, worst_share
from tautwave.report.claims import blows_of, claims_sentence, exceeds, kept_claims
from tautwave.report.judged import certificate_words, judged
from tautwave.report.units import axis_units, count, microseconds, plural, quantity, ratio
from tautwave.runtime.operate.journal import said_of
from tautwave.summary import Summary
from tautwave.summary.ending import eventful, events, first_cause, generated, outcome
from tautwave.summary.model import Certificate, Pair, Severity
from tautwave.tables import BAD, FAINT, GOOD, NOTE, Cell, Level, Table

PAGE = "report.html"
FILES = (PAGE, "summary.json", "recording.mcap", "rig.yaml", "output.wav", "scene.gif")


MAX_PAIRS, MAX_DEVICES, MAX_NOTES = 4, 3, 3
"""Rows of pairs and of devices, and warnings, that one screen has room for."""

LINK_HEADS = ("", ">lost", ">delay p50", ">p99", ">owed at most", ">energy short", ">held")
TRACKING_HEADS = ("", ">position rms", ">max", ">effort rms", ">max", ">above 8 Hz")


def summary_sections(
    name: str,
    summary: Summary,
    directory: Path,
    exit_code: int,
    drawing: bool = False,
    *,
    verbose: bool = True,
) -> list[Table]:
    """Return what a terminal says of a run.

    Outcome and what happened, tracking, devices, whether claims, certificate and books hold, and
    the report's path: one screen. `verbose`: books, timing, elements left out and all files too.
    `drawing`: another process is about to draw the report.
    """
    if not verbose:
        return _screen(name, summary, directory, exit_code, drawing)
    motion = [
        Table("Tracking", TRACKING_HEADS, list(_tracking(summary))),
        Table("Link", LINK_HEADS, list(_link(summary))),
        Table("Energy books", ("", ">", ""), list(_books(summary))),
        Table("Timing", ("", ">p50", ">p99", ">p99.9", ">max"), list(_timing(summary))),
    ]
    operated = summary.operation is not None
    unwatched = list(_unwatched(summary))
    return [
        _headline(name, summary, exit_code),
        *([Table("Operation", ("", ""), list(_operation(summary)))] * operated),
        *(motion if summary.cycles != 0 else ()),
        Table("Devices", ("", ">lost", ">late", "faults"), list(_devices(summary))),
        *([Table("No watchdog", ("", ""), unwatched)] if unwatched else ()),
        Table("Unused elements", ("", ""), list(_left_out(summary))),
        Table("Files", ("",), list(_files(summary, directory, drawing))),
    ]


def _screen(
    name: str, summary: Summary, directory: Path, exit_code: int, drawing: bool
) -> list[Table]:
    head = _headline(name, summary, exit_code)
    notes = list(head.rows)
    if len(notes) > MAX_NOTES:
        more = Cell(f"and {len(notes) - MAX_NOTES} more: --verbose", FAINT)
        head = head._replace(rows=[*notes[:MAX_NOTES], (more,)])
    tracking = list(_tracking(summary))
    if len(tracking) > MAX_PAIRS:
        tracking = list(_greatest(summary))
    devices = list(_devices(summary))
    if len(devices) > MAX_DEVICES:
        rest = f"and {len(devices) - MAX_DEVICES} more: --verbose"
        devices = [*devices[:MAX_DEVICES], (rest, "", "", "")]
    began = summary.cycles != 0
    return [
        head,
        Table("", TRACKING_HEADS, tracking if began else []),
        Table("", LINK_HEADS, list(_link(summary))[:MAX_PAIRS] if began else []),
        Table("", ("device", ">lost", ">late", "faults"), devices),
        Table("", ("", ""), [*(_judged(summary) if began else ()), *_silent(summary)]),
        Table("", ("",), list(_page(summary, directory, drawing))),
    ]


def _greatest(summary: Summary) -> Iterator[Sequence[str | Cell]]:
    """Yield a row for all pairs of a kind, with the greatest of each number."""
    for kind in ("rotary", "linear"):
        chosen = {n: one for n, one in summary.pairs.items() if (one.kind or "rotary") == kind}
        if not chosen:
            continue
        position, effort = axis_units(kind)
        row: list[str | Cell] = [spanned(list(chosen))]
        for key, unit in (("position_error", position), ("effort_error", effort)):
            sizes = [one for pair in chosen.values() if (one := getattr(pair, key)) is not None]
            for part in ("rms", "max"):
                values = [value for one in sizes if (value := getattr(one, part)) is not None]
                row.append(f"<= {quantity(max(values), unit, 3)}" if values else "-")
        shares = [worst[1] for one in chosen.values() if (worst := worst_share(one.fast_share))]
        text = f"<= {100.0 * max(shares):.0f} %" if shares else "-"
        yield (*row, Cell(text, BAD) if shares and max(shares) > CHATTER_THRESHOLD else text)


def _judged(summary: Summary) -> Iterator[Sequence[str | Cell]]:
    """Yield whether claims were kept, what became of the certificate, and whether books closed."""
    yield from _did(summary)
    certificate, above = summary.certificate, set(generated(summary))
    notes = [one for one in _certificate_notes(certificate) if one not in above]
    for one in judged(summary):
        if one.topic not in SAID or not one.words:
            continue
        words = one.words
        if one.topic == "certificate":
            words = f"{certificate.require.replace('_', ' ')}: {words}"
        yield one.topic, _coloured(words, one.severity)
        if one.topic == "certificate":
            for sentence in notes[:MAX_NOTES]:
                yield "", Cell(folded("certificate", sentence, ADVICE), BAD)


SAID = ("claims", "motors gave", "certificate", "energy books", "timing")
"""Topics that are rows of the screen; its head and its tables say the others."""


def _coloured(text: str, severity: Severity) -> Cell:
    """Return text in the colour of what it says; what is not known is worth a look."""
    levels: dict[Severity, Level] = {"ok": GOOD, "bad": BAD, "note": NOTE, "open": NOTE, "info": ""}
    return Cell(text, levels[severity])


def _did(summary: Summary) -> Iterator[Sequence[str | Cell]]:
    """Yield episodes, several of them counted, and what was refused."""
    operation = summary.operation
    if operation is None:
        return
    rows = [row for row in _operation(summary) if row[0] not in ("engaged", "faults")]
    if len(operation.episodes) > MAX_EPISODES:
        said = [said_of(one.success) for one in operation.episodes]
        kinds = ", ".join(f"{said.count(one)} {one}" for one in dict.fromkeys(said))
        yield "episodes", f"{len(said)}: {kinds}"
        rows = [row for row in rows if not str(row[0]).startswith("episode")]
    yield from rows


MAX_EPISODES = 2
"""Episodes that are shown one by one."""

ADVICE = len("energy books")


def _silent(summary: Summary) -> Iterator[Sequence[str | Cell]]:
    """Yield devices without a watchdog, by what they do, once for all that do the same."""
    same: dict[str, dict[str, str]] = {}
    for bus in summary.buses.values():
        for name, does in bus.unwatched.items():
            text = _NUMBERED.sub("", does)
            same.setdefault(NUMBER.sub("#", text), {})[name] = text
    for alike in same.values():
        text = f"{axes_named(list(alike))}: {as_one(list(alike.values()))}"
        yield "no watchdog", Cell(folded("no watchdog", text, ADVICE, 5), NOTE)


_NUMBERED = re.compile(r"\([^()]*\d+\) ")
"""Which of the devices it is."""


def _page(summary: Summary, directory: Path, drawing: bool) -> Iterator[Sequence[str | Cell]]:
    """Yield the first file that shows a person the run, and where the others are."""
    files = list(_files(summary, directory, drawing))
    if files:
        yield files[0]
        lost = summary.report_error or summary.incomplete
        has = "what could be written" if lost else "all files"
        yield (Cell(f"{directory} has {has}; --verbose shows all numbers.", FAINT),)


def _files(summary: Summary, directory: Path, drawing: bool) -> Iterator[Sequence[str | Cell]]:
    awaited = drawing and not summary.report_error
    for file in FILES:
        if (directory / file).exists():
            yield (str(directory / file),)
        elif awaited and file == PAGE:
            yield (Cell(f"{directory / file} (being drawn)", FAINT),)


def _headline(name: str, summary: Summary, exit_code: int) -> Table:
    word, sentence = outcome(summary, exit_code)
    parts = [f"{name}: {word}"]
    if summary.cycles is not None:
        rate = f" at {quantity(summary.rate_hz, 'Hz')}" if summary.rate_hz else ""
        parts.append(f"{count(summary.cycles)} cycles{rate}")
    if summary.missed_cycles:
        parts.append(f"{count(summary.missed_cycles)} missed")
    if summary.wall_time_s is not None:
        parts.append(f"in {quantity(summary.wall_time_s, 's', 3)}")
    parts += events(summary)
    notes: list[str | Cell] = [sentence] if sentence else []
    if first := first_cause(summary):
        notes.append(Cell(f"First: {first}", NOTE))
    notes += [Cell(one, BAD) for one in generated(summary)]
    notes += [Cell(one, NOTE) for one in summary.warnings]
    lost, unreported = summary.incomplete or "", summary.report_error or ""
    if unreported and unreported not in lost:
        notes.append(Cell(f"{unreported}.", BAD))
    if lost:
        notes.append(Cell(f"{lost[0].upper()}{lost[1:]}.", BAD))
    good = word != "interrupted" and not eventful(summary)
    level = BAD if exit_code else GOOD if good else NOTE
    return Table(", ".join(parts), ("",), [(note,) for note in notes], level=level)


def _operation(summary: Summary) -> Iterator[Sequence[str | Cell]]:
    """Yield what people did with the rig: engagements, episodes, faults, refusals."""
    operation = summary.operation
    if operation is None:
        return
    times, during = operation.engagements, quantity(operation.engaged_s, "s", 3)
    yield "engaged", f"{plural(times, 'time')}, {during} in all" if times else "never"
    for one in operation.episodes:
        task = f", {one.task}" if one.task else ""
        span = f"{quantity(one.begin_s, 's', 3)} to {quantity(one.end_s, 's', 3)}"
        name = printable(f"{one.name}{task}", 60)
        said = said_of(one.success, one.discarded)
        yield f"episode {one.number}", f"{name}: {said}, {span}"
    for label, chosen in (
        ("faults", [one for one in operation.journal if one.word == "fault"]),
        ("refused", [one for one in operation.journal if one.refused]),
    ):
        if chosen:
            last = chosen[-1]
            at = quantity(last.at_s, "s", 3)
            text = f"{count(len(chosen))}; the last after {at}: {printable(last.text, 200)}"
            yield label, Cell(text, NOTE)


def _left_out(summary: Summary) -> Iterator[Sequence[str]]:
    """Yield what was left out."""
    yield from ((one.element, one.reason) for one in summary.left_out)


def _tracking(summary: Summary) -> Iterator[Sequence[str | Cell]]:
    for name, pair in summary.pairs.items():
        position, effort = axis_units(pair.kind or "rotary")
        errors = ((pair.position_error, position), (pair.effort_error, effort))
        sizes = [(one and one.rms, one and one.max, unit) for one, unit in errors]
        yield (
            name,
            *(quantity(value, unit, 3) for rms, most, unit in sizes for value in (rms, most)),
            _calm(pair),
        )


def _calm(pair: Pair) -> str | Cell:
    """Return the share of motion power above 8 Hz, marked where it buzzes."""
    worst = worst_share(pair.fast_share)
    if worst is None:
        return "-"
    text = f"{100.0 * worst[1]:.0f} %"
    return Cell(text, BAD) if worst[1] > CHATTER_THRESHOLD else text


def _link(summary: Summary) -> Iterator[Sequence[str | Cell]]:
    for name, pair in summary.pairs.items():
        position, _ = axis_units(pair.kind or "rotary")
        for side, figures in pair.link.items():
            yield (
                f"{side}.{name}",
                f"{ratio(100.0 * (figures.loss or 0.0))} %",
                quantity(figures.delay_p50_s, "s", 3),
                quantity(figures.delay_p99_s, "s", 3),
                quantity(figures.backlog, position, 3),
                f"{ratio(100.0 * (figures.cut or 0.0))} %",
                quantity(figures.held_s, "s", 3),
            )


def _books(summary: Summary) -> Iterator[Sequence[str | Cell]]:
    energy = summary.energy_j
    if "energy_j" not in summary.model_fields_set:
        return
    flow = energy.gross_flow
    for label, value in (
        ("gross flow", flow),
        ("residual", energy.residual),
        ("generated by elements", energy.generated),
        ("sensing gap", energy.sensing_gap),
    ):
        if value is not None:
            share = f"{ratio(abs(value) / flow)} of gross flow" if flow else ""
            yield label, quantity(value, "J", 3), "" if label == "gross flow" else share
    yield from _motors(summary)
    certificate = summary.certificate
    require = certificate.require.replace("_", " ")
    yield "certificate", require, _after_run(certificate)
    for sentence in _certificate_notes(certificate):
        yield "", "", Cell(sentence, BAD if certificate.passed is False else NOTE)


def _motors(summary: Summary) -> Iterator[Sequence[str | Cell]]:
    """Energy of the motors, net and at each pair's worst moment, and the claims of the ports."""
    net = summary.energy_j.motors_net
    if net is None:
        return
    yield "motors gave, net", quantity(net, "J", 3), "they took energy out" if net < 0.0 else ""
    several = len(summary.pairs) > 1
    for name, pair in summary.pairs.items():
        motors = pair.motors
        if motors is None:
            continue
        label = f"at the worst moment{f', {name}' if several else ''}"
        note = f"after {quantity(motors.worst_at_s, 's', 3)}"
        if motors.stated_debt is not None:
            note += f"; the ports claim at most {quantity(motors.stated_debt, 'J', 3)}"
        worst = quantity(motors.worst, "J", 3)
        flow = summary.energy_j.gross_flow or 0.0
        if exceeds(motors, flow, blows_of(summary, name)):
            yield label, Cell(worst, BAD), Cell(f"{note}: exceeded", BAD)
        else:
            yield label, worst, note
    ends = list(kept_claims(summary))
    if ends:
        broken = any(end.passed is False for end in ends)
        says = Cell("not kept", BAD) if broken else Cell("kept", GOOD)
        yield "claims of the ports", says, claims_sentence(ends)


def _after_run(certificate: Certificate) -> Cell:
    """Return the verdict on a certificate as a run has left it."""
    return _coloured(certificate_words(certificate), certificate.severity)


def _certificate_notes(certificate: Certificate) -> Iterator[str]:
    """The certificate after the run, and walls rendered with reduced stiffness."""
    for axis, wall in certificate.walls.items():
        if wall.derated:
            asked, rendered = wall.asked_stiffness, wall.rendered_stiffness
            yield f"wall of {axis}: K = {asked:.6g} requested, {rendered:.6g} rendered"
    if certificate.allowed_uncertified:
        yield "not certified; run anyway with --allow-uncertified"
    after = certificate.after_run
    if after.invalidated:
        yield "what this run measured invalidates its certificate:"
        yield from after.sentences
    yield from after.broken_conditions
    yield from after.notes


def _timing(summary: Summary) -> Iterator[Sequence[str | Cell]]:
    for label, times in (
        ("period", summary.period_us),
        ("lateness", summary.lateness_us),
        ("compute", summary.compute_us),
    ):
        if times.p50 is not None:
            percentiles = (times.p50, times.p99, times.p999, times.max)
            yield label, *(microseconds(one, 3) for one in percentiles)


def _devices(summary: Summary) -> Iterator[Sequence[str | Cell]]:
    for name, axis in summary.axes.items():
        if axis.lost or axis.late or axis.faults:
            text = "; ".join(one.text for one in axis.faults)
            yield name, count(axis.lost), count(axis.late), Cell(text, BAD)


def _unwatched(summary: Summary) -> Iterator[Sequence[str | Cell]]:
    """Yield what devices without a watchdog do when the host stops."""
    for bus in summary.buses.values():
        yield from ((name, Cell(does, NOTE)) for name, does in bus.unwatched.items())
