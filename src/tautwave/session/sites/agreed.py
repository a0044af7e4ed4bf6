"""What a site holds itself to, records of its link, and takes from the other one's words."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

LINK_COLUMNS = (
    "link.session",
    "link.slot",
    "link.silence_s",
    "link.holding",
    "link.delay_s",
    "link.aligning",
)
ALIGNED = {"master": "hold_master", "slave": "align_slave"}
"""Elements of the books: a side's motor while no coupling holds it."""


class SiteLimits(NamedTuple):
    """When a site holds and stops.

    Silence until it holds, and until it stops [ns]; how long the other site may take until it is
    ready [ns]; the motion [rad or m, master] that may be missed; whether its slots follow the
    other's.
    """

    silence_ns: int
    lost_ns: int
    ready_ns: int
    backlog: float
    follows: bool


def positions(said: Any, names: Sequence[str]) -> Mapping[str, float] | None:
    """Return where the other site's axes stand [rad or m], None if that is not what it said."""
    if not isinstance(said, Mapping) or set(said) != set(names):
        return None
    good = all(isinstance(one, float | int) and math.isfinite(one) for one in said.values())
    return {name: float(one) for name, one in said.items()} if good else None


def claim_sessions(summary: dict[str, Any]) -> None:
    """Count what ports claim once for each session: each begins with its own reserve."""
    link = summary["link"]
    count = sum("engaged_s" in session for session in link["sessions"])
    for name, pair in summary["pairs"].items():
        claims = pair.get("claim_j", {})
        granted = link["granted_j"][name]  # what brought it into place, and held it
        pair["claim_j"] = {s: max(1, count) * claim + granted for s, claim in claims.items()}
        for stated in pair.get("claims", {}).values():
            for key in ("claim_j", "prompt_j"):
                stated[key] = max(1, count) * stated[key] + granted


def lost_words(peer: str, since_s: float, why: str) -> str:
    """Say since when [s] and why the other site is lost."""
    return (
        f"{peer} has been lost since {since_s:.3f} s: {why or 'nothing received from it'}; not back"
    )


def unready_words(peer: str, hindrance: str) -> str:
    """Say what was not ready for a session."""
    return f"{hindrance}; not ready" if hindrance else f"{peer} was not ready"
