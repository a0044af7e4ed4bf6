"""The verdicts on a run, one list of them, from its summary alone; without NumPy.

A terminal prints their words, a page adds numbers and reasons (`report.run.verdicts`); how serious
a thing is, is decided here.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, NamedTuple

from tautwave.report.books import books_closed
from tautwave.report.calm import high_frequency_share
from tautwave.report.claims import blows_of, claims_sentence, exceeds, kept_claims
from tautwave.report.units import microseconds, quantity
from tautwave.summary import Summary
from tautwave.summary.ending import eventful, events
from tautwave.summary.model import Certificate, Severity

Topic = Literal[
    "tracking",
    "what happened",
    "link",
    "claims",
    "motors gave",
    "certificate",
    "energy books",
    "timing",
]

FEW = 0.01
"""Share of cycles that may be missed with a warning."""

_WORDS: dict[Severity, str] = {
    "ok": "passed",
    "note": "conditional",
    "bad": "not passed",
    "open": "not yet evaluated",
}
_GRAVITY: tuple[Severity, ...] = ("bad", "note", "open", "info", "ok")


class Judged(NamedTuple):
    """A verdict on one topic: how serious it is, and what it is in a few words.

    Topics may come more than once; `words` are empty where the severity says all.
    """

    topic: Topic
    severity: Severity
    words: str = ""


def judged(summary: Summary) -> list[Judged]:
    """Return the verdicts on a run, in the order in which they matter."""
    return [
        _tracking(summary),
        *_events(summary),
        *_link(summary),
        *_claims(summary),
        *_motors(summary),
        Judged("certificate", summary.certificate.severity, certificate_words(summary.certificate)),
        *_books(summary),
        _timing(summary),
    ]


def severity_of(judgements: list[Judged], *topics: Topic) -> Severity:
    """Return how serious the worst verdict on some topics is; `open` without any."""
    there = {one.severity for one in judgements if one.topic in topics}
    return next((one for one in _GRAVITY if one in there), "open")


def _tracking(summary: Summary) -> Judged:
    sentences = [
        high_frequency_share(pair.fast_share, name) for name, pair in summary.pairs.items()
    ]
    return Judged("tracking", "bad" if any(sentences) else "info")


def _events(summary: Summary) -> Iterator[Judged]:
    happened = events(summary)
    if happened:
        yield Judged("what happened", "note" if eventful(summary) else "info", ", ".join(happened))


def _link(summary: Summary) -> Iterator[Judged]:
    ends = [end for pair in summary.pairs.values() for end in pair.link.values()]
    if ends:
        yield Judged("link", "note" if any(end.holds for end in ends) else "ok")


def _claims(summary: Summary) -> Iterator[Judged]:
    ends = list(kept_claims(summary))
    if ends:
        broken = any(end.passed is False for end in ends)
        text = f"not kept: {claims_sentence(ends)}" if broken else "kept"
        yield Judged("claims", "bad" if broken else "ok", text)


def _motors(summary: Summary) -> Iterator[Judged]:
    """Yield each pair whose motors gave more than its ports claim."""
    flow = summary.energy_j.gross_flow or 0.0
    for name, pair in summary.pairs.items():
        motors = pair.motors
        if motors is not None and exceeds(motors, flow, blows_of(summary, name)):
            text = f"{name}: {quantity(motors.worst, 'J', 3)}, more than its ports claim"
            yield Judged("motors gave", "bad", text)


def certificate_words(certificate: Certificate) -> str:
    """Return what became of a certificate."""
    before = _WORDS[certificate.before]
    if certificate.after_run.invalidated:
        return f"{before}, before the run; invalidated by it"
    if certificate.after_run.broken_conditions:
        return f"{before}, on conditions that this run did not meet"
    return before


def _books(summary: Summary) -> Iterator[Judged]:
    closed = books_closed(summary)
    if closed is not None:
        missing = f"not closed: {quantity(summary.energy_j.residual, 'J', 3)} are missing"
        yield Judged("energy books", "ok" if closed else "bad", "closed" if closed else missing)


def _timing(summary: Summary) -> Judged:
    cycles, missed = summary.cycles, summary.missed_cycles
    severity: Severity = "open"
    if cycles and missed is not None:
        severity = "ok" if missed == 0 else "note" if missed <= FEW * cycles else "bad"
    recording, late = summary.recording, summary.lateness_us
    if recording.rows_dropped and severity != "bad":
        severity = "note"
    if recording.error:
        severity = "bad"
    if summary.clock == "fake" or not late.max or late.p99 is None:
        return Judged("timing", severity)
    text = f"99 % of the cycles at most {microseconds(late.p99, 3)} late"
    return Judged("timing", severity, f"{text}, the latest {microseconds(late.max, 3)}")
