"""The result of a run on one screen, read from its summary. Missing values are not shown."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from tautwave.cli.terminal.show import BAD, GOOD, NOTE, Cell, Section, printable
from tautwave.report.calm import UNCALM, worst_share
from tautwave.report.claims import blows_of, claims_sentence, exceeds, kept_claims
from tautwave.report.units import axis_units, count, microseconds, number, plural, quantity, ratio
from tautwave.runtime.operate.journal import said_of

FILES = ("report.html", "summary.json", "recording.mcap", "rig.yaml", "output.wav", "scene.gif")


MOST_LEFT_OUT = 20
"""Rows of what was left out that are shown."""

LINK_HEADS = ("", ">lost", ">delay p50", ">p99", ">owed at most", ">energy short", ">held")


def summary_sections(
    name: str, summary: Mapping[str, Any], directory: Path, exit_code: int
) -> list[Section]:
    """Outcome, tracking, books, timing, devices, elements left out, and paths of the files."""
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
    unwatched = list(_unwatched(summary))
    return [
        _headline(name, summary, exit_code),
        *([Section("Operation", ("", ""), list(_operation(summary)))] * ("operation" in summary)),
        *(motion if number(summary.get("cycles")) != 0.0 else ()),
        Section("Devices", ("", ">lost", ">late", "faults"), list(_devices(summary))),
        *([Section("No watchdog", ("", ""), unwatched)] if unwatched else ()),
        Section("Unused elements", ("", ""), list(_left_out(summary))),
        Section(
            "Files",
            ("",),
            [(str(directory / file),) for file in FILES if (directory / file).exists()],
        ),
    ]


def outcome(summary: Mapping[str, Any], exit_code: int) -> tuple[str, str]:
    """How the run ended: a word or two, and a sentence ('' if there is none)."""
    ended = summary.get("outcome")
    kind = _dig(ended, "kind") if isinstance(ended, Mapping) else ended
    word = str(kind or ("finished" if exit_code == 0 else "stopped")).replace("_", " ")
    return word, str(_dig(ended, "sentence") or "")


def last_line(name: str, summary: Mapping[str, Any], exit_code: int) -> str:
    """Why the exit code is not 0: what ended the run, what was not saved, or both."""
    word, sentence = outcome(summary, exit_code)
    incomplete = str(summary.get("incomplete") or "")
    if exit_code == 7:
        return f"{name}: {incomplete or word}"
    if exit_code == 3:
        sentence = "\n".join(_dig(summary, "certificate", "after_run", "sentences") or [sentence])
    elif exit_code in (5, 6):
        sentence = "\n".join([sentence, *_generated(summary)])
    sentence = sentence or f"{name}: {word}"
    return f"{sentence.rstrip('.')}; {incomplete}" if incomplete else sentence


def _generated(summary: Mapping[str, Any]) -> Iterator[str]:
    """Yield a sentence on each coupling that generated energy where none may."""
    if _dig(summary, "certificate", "after_run", "invalidated"):
        for _, found in _items(_dig(summary, "certificate", "after_run"), "generated"):
            if found.get("passed") is False:
                yield str(found["sentence"])


def _headline(name: str, summary: Mapping[str, Any], exit_code: int) -> Section:
    word, sentence = outcome(summary, exit_code)
    parts = [f"{name}: {word}"]
    cycles, missed = number(summary.get("cycles")), number(summary.get("missed_cycles"))
    if cycles is not None:
        rate = f" at {quantity(summary.get('rate_hz'), 'Hz')}" if summary.get("rate_hz") else ""
        parts.append(f"{count(cycles)} cycles{rate}")
    if missed:
        parts.append(f"{count(missed)} missed")
    if number(summary.get("wall_time_s")) is not None:
        parts.append(f"in {quantity(summary['wall_time_s'], 's', 3)}")
    notes: list[str | Cell] = [sentence] if sentence else []
    notes += [Cell(one, BAD) for one in _generated(summary)]
    notes += [Cell(str(one), NOTE) for one in summary.get("warnings") or ()]
    lost, unreported = (str(summary.get(key) or "") for key in ("incomplete", "report_error"))
    if unreported and unreported not in lost:
        notes.append(Cell(f"{unreported}.", BAD))
    if lost:
        notes.append(Cell(f"{lost[0].upper()}{lost[1:]}.", BAD))
    style = f"bold {NOTE if word == 'interrupted' else GOOD}" if exit_code == 0 else BAD
    return Section(", ".join(parts), ("",), [(note,) for note in notes], style)


def _operation(summary: Mapping[str, Any]) -> Iterator[Sequence[str | Cell]]:
    """Yield what people did with the rig: engagements, episodes, faults, refusals."""
    operation = summary.get("operation")
    if not isinstance(operation, Mapping):
        return
    times, during = int(operation["engagements"]), quantity(operation.get("engaged_s"), "s", 3)
    yield "engaged", f"{plural(times, 'time')}, {during} in all" if times else "never"
    for one in operation["episodes"]:
        task = f", {one['task']}" if one["task"] else ""
        span = f"{quantity(one['begin_s'], 's', 3)} to {quantity(one['end_s'], 's', 3)}"
        name = printable(f"{one['name']}{task}", 60)
        yield f"episode {one['number']}", f"{name}: {said_of(one['success'])}, {span}"
    for label, chosen in (
        ("faults", [one for one in operation["journal"] if one["word"] == "fault"]),
        ("refused", [one for one in operation["journal"] if one["refused"]]),
    ):
        if chosen:
            last = chosen[-1]
            at = quantity(last["at_s"], "s", 3)
            text = f"{count(len(chosen))}; the last after {at}: {printable(last['text'], 200)}"
            yield label, Cell(text, NOTE)


def _left_out(summary: Mapping[str, Any]) -> Iterator[Sequence[str]]:
    """Yield what was left out, or how much where it is more than a screen has room for."""
    left_out = summary.get("left_out", ())
    rows = [(str(one["element"]), str(one.get("reason") or "")) for one in left_out]
    if len(rows) <= MOST_LEFT_OUT:
        yield from rows
    else:
        yield f"{count(len(rows))} elements", "the report lists them"


def _tracking(summary: Mapping[str, Any]) -> Iterator[Sequence[str | Cell]]:
    for pair, figures in _items(summary, "pairs"):
        position, effort = axis_units(str(figures.get("kind", "rotary")))
        yield (
            pair,
            *(
                quantity(_dig(figures, "position_error", key), position, 3)
                for key in ("rms", "max")
            ),
            *(quantity(_dig(figures, "effort_error", key), effort, 3) for key in ("rms", "max")),
            _calm(figures),
        )


def _calm(figures: Mapping[str, Any]) -> str | Cell:
    """Return the share of motion power above 8 Hz, marked where it buzzes."""
    found = worst_share(figures.get("fast_share"))
    if found is None:
        return "-"
    text = f"{100.0 * found[1]:.0f} %"
    return Cell(text, BAD) if found[1] > UNCALM else text


def _link(summary: Mapping[str, Any]) -> Iterator[Sequence[str | Cell]]:
    for pair, figures in _items(summary, "pairs"):
        position, _ = axis_units(str(figures.get("kind", "rotary")))
        for side, found in _items(figures, "link"):
            yield (
                f"{side}.{pair}",
                f"{ratio(100.0 * float(found['loss']))} %",
                *(quantity(found.get(f"delay_{key}_s"), "s", 3) for key in ("p50", "p99")),
                quantity(found["backlog"], position, 3),
                f"{ratio(100.0 * float(found['cut']))} %",
                quantity(found["held_s"], "s", 3),
            )


def _books(summary: Mapping[str, Any]) -> Iterator[Sequence[str | Cell]]:
    energy = summary.get("energy_j")
    if not isinstance(energy, Mapping):
        return
    flow = number(energy.get("gross_flow"))
    for key, label in (
        ("gross_flow", "gross flow"),
        ("residual", "residual"),
        ("generated", "generated by elements"),
        ("sensing_gap", "sensing gap"),
    ):
        value = number(energy.get(key))
        if value is None:
            continue
        share = ""
        if key != "gross_flow" and flow:
            share = f"{ratio(abs(value) / flow)} of gross flow"
        yield label, quantity(value, "J", 3), share
    yield from _motors(summary, energy)
    passed, state = (_dig(summary, "certificate", key) for key in ("passed", "state"))
    require = str(_dig(summary, "certificate", "require") or "").replace("_", " ")
    yield "certificate", require, _after_run(summary, verdict(passed, state))
    for sentence in _certificate_notes(summary):
        yield "", "", Cell(sentence, BAD if passed is False else NOTE)


def _motors(
    summary: Mapping[str, Any], energy: Mapping[str, Any]
) -> Iterator[Sequence[str | Cell]]:
    """Energy of the motors, net and at each pair's worst moment, and the claims of the ports."""
    net = number(energy.get("motors_net"))
    if net is None:
        return
    yield "motors gave, net", quantity(net, "J", 3), "they took energy out" if net < 0.0 else ""
    several = len(summary.get("pairs") or ()) > 1
    for pair, figures in _items(summary, "pairs"):
        motors = figures.get("motors")
        if not isinstance(motors, Mapping):
            continue
        label = f"at the worst moment{f', {pair}' if several else ''}"
        note = f"after {quantity(motors.get('worst_at_s'), 's', 3)}"
        debt = motors.get("stated_debt")
        if debt is not None:
            note += f"; the ports claim at most {quantity(debt, 'J', 3)}"
        worst = quantity(motors.get("worst"), "J", 3)
        flow = number(energy.get("gross_flow")) or 0.0
        if exceeds(motors, flow, blows_of(summary, pair)):
            yield label, Cell(worst, BAD), Cell(f"{note}: exceeded", BAD)
        else:
            yield label, worst, note
    ends = list(kept_claims(summary))
    if ends:
        broken = any(end.passed is False for end in ends)
        says = Cell("not kept", BAD) if broken else Cell("kept", GOOD)
        yield "claims of the ports", says, claims_sentence(ends)


def _after_run(summary: Mapping[str, Any], before: Cell) -> Cell:
    """Return the verdict on a certificate as a run has left it."""
    after = _dig(summary, "certificate", "after_run")
    if _dig(after, "invalidated"):
        return Cell(f"{before.text}, before the run; not kept in it", BAD)
    if _dig(after, "broken_conditions"):
        return Cell(f"{before.text}, on conditions that this run did not keep", NOTE)
    return before


def _certificate_notes(summary: Mapping[str, Any]) -> Iterator[str]:
    """The certificate after the run, and walls rendered with reduced stiffness."""
    for axis, wall in (_dig(summary, "certificate", "walls") or {}).items():
        asked, rendered = wall.get("asked_stiffness"), wall.get("rendered_stiffness")
        if asked != rendered:
            yield f"wall of {axis}: K = {asked:.6g} requested, {rendered:.6g} rendered"
    if _dig(summary, "certificate", "allowed_uncertified"):
        yield "not certified; run anyway with --allow-uncertified"
    if _dig(summary, "certificate", "after_run", "invalidated"):
        yield "what this run measured invalidates its certificate:"
        yield from _dig(summary, "certificate", "after_run", "sentences") or ()
    yield from _dig(summary, "certificate", "after_run", "broken_conditions") or ()
    yield from _dig(summary, "certificate", "after_run", "notes") or ()


def verdict(passed: Any, state: Any = None) -> Cell:
    """The verdicts of a certificate; one that was not evaluated is never called passed."""
    if passed is None:
        return Cell("not yet evaluated", NOTE)
    if passed and state == "conditional":
        return Cell("conditional", NOTE)
    return Cell("passed", GOOD) if passed else Cell("not passed", BAD)


def _timing(summary: Mapping[str, Any]) -> Iterator[Sequence[str | Cell]]:
    for key, label in (
        ("period_us", "period"),
        ("lateness_us", "lateness"),
        ("compute_us", "compute"),
    ):
        figures = summary.get(key)
        if isinstance(figures, Mapping) and number(figures.get("p50")) is not None:
            yield label, *(microseconds(figures.get(k), 3) for k in ("p50", "p99", "p999", "max"))


def _devices(summary: Mapping[str, Any]) -> Iterator[Sequence[str | Cell]]:
    for axis, figures in _items(summary, "axes"):
        faults = figures.get("faults") or ()
        text = "; ".join(str(one["text"]) for one in faults)
        if figures.get("lost") or figures.get("late") or faults:
            yield axis, count(figures.get("lost")), count(figures.get("late")), Cell(text, BAD)


def _unwatched(summary: Mapping[str, Any]) -> Iterator[Sequence[str | Cell]]:
    """Yield what devices without a watchdog do when the host stops."""
    for _, bus in _items(summary, "buses"):
        for name, does in _items(bus, "unwatched"):
            yield name, Cell(str(does), NOTE)


def _items(summary: Mapping[str, Any], key: str) -> Iterator[tuple[str, Mapping[str, Any]]]:
    block = summary.get(key)
    if isinstance(block, Mapping):
        yield from block.items()


def _dig(block: Any, *keys: str) -> Any:
    for key in keys:
        block = block.get(key) if isinstance(block, Mapping) else None
    return block
