"""What a site holds itself to, records of its link, and takes from the other one's words."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from tautwave.summary.model import Pair, Site


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


def with_sessions(pairs: Mapping[str, Pair], site: Site) -> dict[str, Pair]:
    """Return pairs whose ports claim once for each session: each begins with its own reserve."""
    count = sum(session.engaged_s is not None for session in site.sessions)
    claiming = {}
    for name, pair in pairs.items():
        granted = site.granted_j[name] or 0.0  # what brought it into place, and held it

        def of_all(joules: float | None, granted: float = granted) -> float | None:
            return None if joules is None else max(1, count) * joules + granted

        claims = {side: of_all(claim) for side, claim in pair.claim_j.items()}
        stated = {
            side: one.model_copy(
                update={"claim_j": of_all(one.claim_j), "prompt_j": of_all(one.prompt_j)}
            )
            for side, one in pair.claims.items()
        }
        update = {"claim_j": claims} | ({"claims": stated} if stated else {})
        claiming[name] = pair.model_copy(update=update)
    return claiming


def lost_words(peer: str, since_s: float, why: str) -> str:
    """Say since when [s] and why the other site is lost."""
    return (
        f"{peer} has been lost since {since_s:.3f} s: {why or 'nothing received from it'}; not back"
    )


def unready_words(peer: str, hindrance: str) -> str:
    """Say what was not ready for a session."""
    return f"{hindrance}; not ready" if hindrance else f"{peer} was not ready"
