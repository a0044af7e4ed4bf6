"""Where and why a run was stopped, for the figures."""

from __future__ import annotations

from typing import NamedTuple

from tautwave.report.run.rundir import Run

_KINDS = {"safety_stop": "safety stop", "fault": "fault"}
_REASONS = {
    "position_range": "left its position range",
    "velocity_limit": "exceeded its velocity limit",
    "not_finite": "is not finite",
    "runaway": "received far too large an effort from its scene",
    "overdrawn": "drew more energy from its scene than it put in",
    "no_sample": "lost its samples",
    "broken_sample": "measured NaN",
    "device_fault": "reported a fault",
}


class Stop(NamedTuple):
    """A stop: when [s], on which axis (`side` and `pair` are empty if on none), and why.

    `kind` is `safety stop` or `fault`, `reason` what the axis did, empty if no axis was the cause.
    """

    at_s: float
    side: str
    pair: str
    kind: str
    reason: str

    def label(self, *, reason: bool = False) -> str:
        """Return the label of the mark in a figure."""
        why = f": {self.reason}" if reason and self.reason else ""
        return f"{self.kind} at {self.at_s:.3f} s{why}"


def stop_of(run: Run) -> Stop | None:
    """Return where a run was stopped, None if it ended normally or by its user."""
    outcome = run.result.outcome
    kind, at = _KINDS.get(outcome.kind), outcome.at_s
    if kind is None or at is None or run.time is None or not len(run.time):
        return None
    axis = outcome.axis or ""
    phrase = _REASONS.get(outcome.reason or "")
    side, _, pair = axis.partition(".")
    reason = f"{axis} {phrase}" if axis and phrase else ""
    return Stop(min(at, float(run.time[-1])), side, pair, kind, reason)
