"""Wrong answers, counted by their cause, and so distinguished from silence."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple


class Cause(NamedTuple):
    """Why an answer does not fit the request, worded to follow `12 answers, all`; and a remedy."""

    text: str
    remedy: str


def wrong_text(found: Mapping[Cause, int]) -> str:
    """Return wrong answers and their causes as text, the most frequent first; '' without any."""
    if not found:
        return ""
    total = sum(found.values())
    causes = sorted(found, key=lambda cause: -found[cause])
    answers = "1 answer" if total == 1 else f"{total} answers"
    if len(causes) == 1:
        every = {1: "", 2: "both "}.get(total, "all ")
        return f"{answers}, {every}{causes[0].text}; {causes[0].remedy}"
    parts = ", ".join(f"{found[cause]} {cause.text}" for cause in causes)
    return f"{answers}: {parts}; {causes[0].remedy}"
