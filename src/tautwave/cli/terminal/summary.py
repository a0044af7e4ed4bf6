"""The result of a run on one screen, from its summary. Missing values are not shown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from tautwave.cli.terminal.show import BAD, FAINT, GOOD, NOTE, Cell, Section, printable, verdict
from tautwave.report.calm import UNCALM, worst_share
from tautwave.report.claims import blows_of, claims_sentence, exceeds, kept_claims
from tautwave.report.units import axis_units, count, microseconds, plural, quantity, ratio
from tautwave.runtime.operate.journal import said_of
from tautwave.summary import Summary
from tautwave.summary.ending import generated, outcome
from tautwave.summary.model import Certificate, Pair

PAGE = "report.html"
FILES = (PAGE, "summary.json", "recording.mcap", "rig.yaml", "output.wav", "scene.gif")


MAX_LEFT_OUT = 20
"""Rows of what was left out that are shown."""

LINK_HEADS = ("", ">lost", ">delay p50", ">p99", ">owed at most", ">energy short", ">held")


def summary_sections(
    name: str, summary: Summary, directory: Path, exit_code: int, drawing: bool = False
) -> list[Section]:
    """Outcome, tracking, books, timing, devices, elements left out, and paths of the files.

    `drawing`: another process is about to draw the report.
    """
    motion = [
        Section(
            "Tracking",
            ("", ">position rms", ">max", ">effort rms", ">max", ">above 8 Hz"),
            list(_tracking(summary)),
        ),
        Section("Link", LINK_HEADS, list(_link(summary))),
        Section("Energy books", ("", ">", ""), list(_books(summary))),
        Section("Timing", ("", ">p50", ">p99", ">p99.9", ">max"), list(_timing(summary))),
    ]
    operated = summary.operation is not None
    unwatched = list(_unwatched(summary))
    return [
        _headline(name, summary, exit_code),
        *([Section("Operation", ("", ""), list(_operation(summary)))] * operated),
        *(motion if summary.cycles != 0 else ()),
        Section("Devices", ("", ">lost", ">late", "faults"), list(_devices(summary))),
        *([Section("No watchdog", ("", ""), unwatched)] if unwatched else ()),
        Section("Unused elements", ("", ""), list(_left_out(summary))),
        Section("Files", ("",), list(_files(summary, directory, drawing))),
    ]


def _files(summary: Summary, directory: Path, drawing: bool) -> Iterator[Sequence[str | Cell]]:
    awaited = drawing and not summary.report_error
    for file in FILES:
        if (directory / file).exists():
            yield (str(directory / file),)
        elif awaited and file == PAGE:
            yield (Cell(f"{directory / file} (being drawn)", FAINT),)


def _headline(name: str, summary: Summary, exit_code: int) -> Section:
    word, sentence = outcome(summary, exit_code)
    parts = [f"{name}: {word}"]
    if summary.cycles is not None:
        rate = f" at {quantity(summary.rate_hz, 'Hz')}" if summary.rate_hz else ""
        parts.append(f"{count(summary.cycles)} cycles{rate}")
    if summary.missed_cycles:
        parts.append(f"{count(summary.missed_cycles)} missed")
    if summary.wall_time_s is not None:
        parts.append(f"in {quantity(summary.wall_time_s, 's', 3)}")
    notes: list[str | Cell] = [sentence] if sentence else []
    notes += [Cell(one, BAD) for one in generated(summary)]
    notes += [Cell(one, NOTE) for one in summary.warnings]
    lost, unreported = summary.incomplete or "", summary.report_error or ""
    if unreported and unreported not in lost:
        notes.append(Cell(f"{unreported}.", BAD))
    if lost:
        notes.append(Cell(f"{lost[0].upper()}{lost[1:]}.", BAD))
    style = f"bold {NOTE if word == 'interrupted' else GOOD}" if exit_code == 0 else BAD
    return Section(", ".join(parts), ("",), [(note,) for note in notes], style)


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
    """Yield what was left out, or how much where it is more than a screen has room for."""
    if len(summary.left_out) <= MAX_LEFT_OUT:
        yield from ((one.element, one.reason) for one in summary.left_out)
    else:
        yield f"{count(len(summary.left_out))} elements", "the report lists them"


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
    found = worst_share(pair.fast_share)
    if found is None:
        return "-"
    text = f"{100.0 * found[1]:.0f} %"
    return Cell(text, BAD) if found[1] > UNCALM else text


def _link(summary: Summary) -> Iterator[Sequence[str | Cell]]:
    for name, pair in summary.pairs.items():
        position, _ = axis_units(pair.kind or "rotary")
        for side, found in pair.link.items():
            yield (
                f"{side}.{name}",
                f"{ratio(100.0 * (found.loss or 0.0))} %",
                quantity(found.delay_p50_s, "s", 3),
                quantity(found.delay_p99_s, "s", 3),
                quantity(found.backlog, position, 3),
                f"{ratio(100.0 * (found.cut or 0.0))} %",
                quantity(found.held_s, "s", 3),
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
    before = verdict(certificate.passed, certificate.state)
    if certificate.after_run.invalidated:
        return Cell(f"{before.text}, before the run; invalidated by it", BAD)
    if certificate.after_run.broken_conditions:
        return Cell(f"{before.text}, on conditions that this run did not meet", NOTE)
    return before


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
            found = (times.p50, times.p99, times.p999, times.max)
            yield label, *(microseconds(one, 3) for one in found)


def _devices(summary: Summary) -> Iterator[Sequence[str | Cell]]:
    for name, axis in summary.axes.items():
        if axis.lost or axis.late or axis.faults:
            text = "; ".join(one.text for one in axis.faults)
            yield name, count(axis.lost), count(axis.late), Cell(text, BAD)


def _unwatched(summary: Summary) -> Iterator[Sequence[str | Cell]]:
    """Yield what devices without a watchdog do when the host stops."""
    for bus in summary.buses.values():
        yield from ((name, Cell(does, NOTE)) for name, does in bus.unwatched.items())
