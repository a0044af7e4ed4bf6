"""Identical parallel links: one of twice the strength, to the bit.

Every law is proportional to its strengths (stiffness, damping, greatest force or power), so that
doubling them doubles tension, slope and energy exactly, short of under- and overflow. A network's
step adds the forces of identical links between the same two nodes before it adds them to the nodes:
in pairs, which is exact, then in pairs of pairs. That sum is the tension of the single link this
module replaces them by; three identical links become a double and a single one.
"""

from __future__ import annotations

from collections.abc import Sequence

from tautwave_scenes.networks.network import Link


def join_links(links: Sequence[Link]) -> list[tuple[Link, str]]:
    """Return every link with its strength after merging, and the link it was merged into.

    A merged link has no strength left; the name is "" for all others. The operation is idempotent.
    """
    result = list(links)
    into: dict[int, int] = {}
    known: dict[Link, int] = {}
    for at in range(len(links)):
        place = at
        while (other := known.pop(_unnamed(result[place]), None)) is not None:
            first, gone = min(place, other), max(place, other)
            result[first] = _scaled(result[place], 2.0)._replace(name=links[first].name)
            result[gone] = _scaled(links[gone], 0.0)
            into[gone] = place = first
        known[_unnamed(result[place])] = place
    return [
        (link, links[_last(into, at)].name if at in into else "") for at, link in enumerate(result)
    ]


def _unnamed(link: Link) -> Link:
    return link._replace(name="")


def _scaled(link: Link, factor: float) -> Link:
    return link._replace(
        stiffness=factor * link.stiffness,
        damping=factor * link.damping,
        limit=factor * link.limit,
    )


def _last(into: dict[int, int], at: int) -> int:
    """Return the link that a link was finally merged into, following chains of merges."""
    while at in into:
        at = into[at]
    return at
