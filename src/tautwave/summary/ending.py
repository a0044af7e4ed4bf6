"""Why a run ended with its exit code, in words."""

from __future__ import annotations

from collections.abc import Iterator

from tautwave.runtime.unwatched import may_be_enabled
from tautwave.summary.model import Summary


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


def generated(summary: Summary) -> Iterator[str]:
    """Yield a sentence on each coupling that generated energy where none may."""
    after = summary.certificate.after_run
    if after.invalidated:
        yield from (one.sentence for one in after.generated.values() if one.passed is False)
