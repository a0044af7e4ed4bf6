"""Remove masses that no port can feel and no recorder sees, and merge identical links.

A mass is kept if a path of links leads from it to a port or to a recorded mass; grounds are not
part of a path, since they do not move. The removed masses move independently and change no bit of
the rest. Identical parallel links become one of twice the strength if no number changes by a bit:
see `parallel_links`.
"""

from __future__ import annotations

from typing import NamedTuple

from tautwave_scenes.networks.network import Network
from tautwave_scenes.networks.parallel_links import join_links


class Pruned(NamedTuple):
    """The remaining network, and a sentence for each element left out or merged."""

    network: Network
    left_out: tuple[str, ...]


def prune(network: Network, *, merge: bool = True) -> Pruned:
    """Return the smallest network that is equivalent at all ports and recorded masses.

    All remaining numbers are identical to the bit, with `merge` and without.
    """
    left_out: list[str] = []
    links = network.links
    near: dict[str, list[str]] = {}
    for link in links:
        near.setdefault(link.a, []).append(link.b)
        near.setdefault(link.b, []).append(link.a)
    fixed = {name for name, _ in network.grounds}
    reached = set(network.ports) | set(network.recorded)
    waiting = list(reached)
    while waiting:
        for other in near.get(waiting.pop(), ()):
            # A port's motion is prescribed: it transmits nothing, but feels everything linked to
            # it.
            if other not in reached and other not in fixed:
                reached.add(other)
                waiting.append(other)
    masses = tuple(mass for mass in network.masses if mass.name in reached)
    strings = tuple(string for string in network.strings if string.name in reached)
    names = [mass.name for mass in network.masses] + [string.name for string in network.strings]
    gone = [name for name in names if name not in reached]
    left_out += [
        f"{name}: no path of links leads from it to a port or a recorder" for name in _grouped(gone)
    ]
    kept = [link for link in links if link.a in reached or link.b in reached]
    gone = [link.name for link in links if link.a not in reached and link.b not in reached]
    left_out += [f"link {name}: both its ends are left out or fixed" for name in _grouped(gone)]
    merged, merges = tuple(kept), []
    if merge:
        joined = join_links(kept)
        merged = tuple(link for link, into in joined if not into)
        merges = [f"link {link.name}: merged with {into}, exactly" for link, into in joined if into]
    used = {end for link in merged for end in (link.a, link.b)}
    grounds = tuple(ground for ground in network.grounds if ground[0] in used)
    left_out += [
        f"ground {name}: nothing is linked to it"
        for name, _ in network.grounds
        if name not in used and name != "ground"
    ]
    small = network._replace(
        masses=masses,
        strings=strings,
        links=merged,
        grounds=grounds,
        forced=tuple(name for name in network.forced if name in reached),
    )
    return Pruned(small, tuple(left_out + merges))


def _grouped(names: list[str]) -> list[str]:
    """Return names, with long lists cut to their first and last."""
    if len(names) > 20:
        return [f"{names[0]} ... {names[-1]} ({len(names)} in all)"]
    return names
