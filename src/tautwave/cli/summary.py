"""The end of a run on one screen, read from its summary. What is missing there is not shown."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from tautwave.cli.show import BAD, GOOD, NOTE, Cell, Section
from tautwave.report.units import axis_units, count, microseconds, number, quantity, ratio

FILES = ("report.html", "summary.json", "recording.mcap", "rig.yaml", "output.wav", "scene.gif")


def summary_sections(
    name: str, summary: Mapping[str, Any], directory: Path, exit_code: int
) -> list[Section]:
    """Outcome, tracking, books, timing, devices, what was left out, and where the files are."""
    return [
        _headline(name, summary, exit_code),
        Section(
            "Tracking",
            ("", ">position rms", ">max", ">effort rms", ">max"),
            list(_tracking(summary)),
        ),
        Section("Energy books", ("", ">", ""), list(_books(summary))),
        Section("Timing", ("", ">p50", ">p99", ">p99.9", ">max"), list(_timing(summary))),
        Section("Devices", ("", ">lost", ">late", "faults"), list(_devices(summary))),
        Section("Left out", ("", ""), list(left_out_rows(summary.get("left_out", ())))),
        Section(
            "Files",
            ("",),
            [(str(directory / file),) for file in FILES if (directory / file).exists()],
        ),
    ]


def outcome(summary: Mapping[str, Any], exit_code: int) -> tuple[str, str]:
    """How the run ended: a word or two, and a sentence ('' where there is none)."""
    told = summary.get("outcome")
    kind = _dig(told, "kind") if isinstance(told, Mapping) else told
    word = str(kind or ("finished" if exit_code == 0 else "stopped")).replace("_", " ")
    return word, str(_dig(told, "sentence") or "")


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
    dropped, error = (_dig(summary, "recording", key) for key in ("rows_dropped", "error"))
    if summary.get("report_error"):
        notes.append(Cell(f"{summary['report_error']}.", BAD))
    if dropped:
        notes.append(Cell(f"{count(dropped)} rows of the recording were dropped.", NOTE))
    if error:
        notes.append(Cell(f"The recording failed: {error}", BAD))
    style = f"bold {NOTE if word == 'interrupted' else GOOD}" if exit_code == 0 else BAD
    return Section(", ".join(parts), ("",), [(note,) for note in notes], style)


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
        )


def _books(summary: Mapping[str, Any]) -> Iterator[Sequence[str | Cell]]:
    energy = summary.get("energy_j")
    if not isinstance(energy, Mapping):
        return
    flow = number(energy.get("gross_flow"))
    for key, label in (
        ("gross_flow", "gross flow"),
        ("residual", "residual"),
        ("generated", "generated"),
        ("sensing_gap", "sensing gap"),
    ):
        value = number(energy.get(key))
        if value is None:
            continue
        share = ""
        if key != "gross_flow" and flow:
            share = f"{ratio(abs(value) / flow)} of gross flow"
        yield label, quantity(value, "J", 3), share
    passed, state = (_dig(summary, "certificate", key) for key in ("passed", "state"))
    require = str(_dig(summary, "certificate", "require") or "").replace("_", " ")
    yield "certificate", require, verdict(passed, state)
    for sentence in _certificate_notes(summary):
        yield "", "", Cell(sentence, BAD if passed is False else NOTE)


def _certificate_notes(summary: Mapping[str, Any]) -> Iterator[str]:
    """What a run did to its certificate, and what it rendered instead of what was asked."""
    for axis, wall in (_dig(summary, "certificate", "walls") or {}).items():
        asked, rendered = wall.get("asked_stiffness"), wall.get("rendered_stiffness")
        if asked != rendered:
            yield f"wall of {axis}: K = {asked:.6g} asked, {rendered:.6g} rendered"
    if _dig(summary, "certificate", "allowed_uncertified"):
        yield "not certified: run with --allow-uncertified"
    if _dig(summary, "certificate", "after_run", "invalidated"):
        yield "what this run measured breaks its certificate:"
        yield from _dig(summary, "certificate", "after_run", "sentences") or ()


def verdict(passed: Any, state: Any = None) -> Cell:
    """What a certificate says; one that is not evaluated is never called passed."""
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
        text = "; ".join(map(str, faults)) if isinstance(faults, list | tuple) else str(faults)
        if figures.get("lost") or figures.get("late") or faults:
            yield axis, count(figures.get("lost")), count(figures.get("late")), Cell(text, BAD)


def left_out_rows(entries: Any) -> Iterator[tuple[str, str]]:
    """Element and reason, from `left_out` as pairs, mappings or plain words."""
    for entry in entries:
        if isinstance(entry, Mapping):
            yield str(entry.get("element", "")), str(entry.get("reason", ""))
        elif isinstance(entry, str):
            element, _, reason = entry.partition(": ")
            yield element, reason
        else:
            yield str(entry[0]), str(entry[-1])


def _items(summary: Mapping[str, Any], key: str) -> Iterator[tuple[str, Mapping[str, Any]]]:
    block = summary.get(key)
    if isinstance(block, Mapping):
        yield from block.items()


def _dig(block: Any, *keys: str) -> Any:
    for key in keys:
        block = block.get(key) if isinstance(block, Mapping) else None
    return block
