"""Why a run ended with its exit code, in words."""

from __future__ import annotations

from collections.abc import Iterator

from tautwave.runtime.operate.states import FAULT, STOP
from tautwave.runtime.unwatched import may_be_enabled
from tautwave.summary.model import DeviceFault, Summary


def outcome(summary: Summary, exit_code: int) -> tuple[str, str]:
    """Return how the run ended: a word or two, and a sentence ('' if there is none)."""
    word: str = summary.outcome.kind
    if word == "unknown":
        word = "finished" if exit_code == 0 else "stopped"
    return word.replace("_", " "), summary.outcome.sentence


def last_line(name: str, summary: Summary, exit_code: int) -> str:
    """Return why the exit code is not 0: what ended the run, what was not saved, or both.

    What may still be enabled is a line of its own, the last one.
    """
    word, sentence = outcome(summary, exit_code)
    incomplete = summary.incomplete or ""
    enabled = may_be_enabled(summary.buses.values())
    if enabled:
        cause = sentence.removesuffix(enabled).removesuffix("; ")
        lines = [*filter(None, (cause, incomplete)), *generated(summary), enabled]
        return "\n".join(lines)
    if exit_code == 7:
        return f"{name}: {incomplete or word}"
    if exit_code == 3:
        sentence = "\n".join(summary.certificate.after_run.sentences or [sentence])
    elif exit_code in (5, 6):
        sentence = "\n".join([sentence, *generated(summary)])
    sentence = sentence or f"{name}: {word}"
    return f"{sentence.rstrip('.')}; {incomplete}" if incomplete else sentence


def events(summary: Summary) -> list[str]:
    """Return what happened in a run, in words: engaged time, faults, stops, times cut off."""
    happened = []
    operation, faults = summary.operation, len(_faults(summary))
    if operation is not None:
        engaged, whole = operation.engaged_s or 0.0, summary.duration_s
        span = f" of {_seconds(whole)}" if whole else ""
        happened.append(f"engaged {_seconds(engaged)}{span}" if engaged else "never engaged")
        faults = max(faults, sum(one.word == FAULT for one in operation.journal))
        stops = sum(one.word == STOP and not one.refused for one in operation.journal)
        happened += [_times(stops, "stop")] if stops else []
    happened += [_times(faults, "fault")] if faults else []
    cut = _cut_off(summary)
    happened += [f"cut off {_times(cut, 'time')}"] if cut else []
    return happened


def eventful(summary: Summary) -> bool:
    """Return whether a run that ended well was not one without events."""
    operation = summary.operation
    if operation is not None:
        engaged, whole = operation.engaged_s or 0.0, summary.duration_s or 0.0
        if engaged < 0.5 * whole or any(one.word == FAULT for one in operation.journal):
            return True
    return bool(_faults(summary)) or _cut_off(summary) > 0


def first_cause(summary: Summary) -> str:
    """Return the first fault of a run, as a sentence; "" if there was none."""
    entries = () if summary.operation is None else summary.operation.journal
    for one in entries:
        if one.word == FAULT and one.text:
            return f"{one.text.rstrip('.')}, after {_seconds(one.at_s)}."
    return next((f"{one.text.rstrip('.')}." for one in _faults(summary)), "")


def _faults(summary: Summary) -> list[DeviceFault]:
    """Return what devices reported that was more than a note."""
    return [one for one in summary.faults if one.severity == "bad"]


def _cut_off(summary: Summary) -> int:
    """Return how often the other site was not heard for too long."""
    sessions = () if summary.link is None else summary.link.sessions
    return sum(len(one.silences) for one in sessions)


def _times(number: int, noun: str) -> str:
    return f"{number} {noun}{'s'[: number != 1]}"


def _seconds(value: float) -> str:
    return f"{value:.3g} s"


def generated(summary: Summary) -> Iterator[str]:
    """Yield a sentence on each coupling that generated energy where none may."""
    after = summary.certificate.after_run
    if after.invalidated:
        yield from (one.sentence for one in after.generated.values() if one.passed is False)
