"""Ports that a network joins, and what each motor's limit makes of the network's passivity.

Of one port, slowly moved, the force is one function of its place (with hysteresis that dissipates),
and so is the force clipped at a limit: what comes back at a place is no more than went in there.
Two ports that only each other hold have, slowly moved, forces f and -f of their distance s. Clipped
at one limit L they stay sat(f) and -sat(f), again of s alone: no closed path gives energy.

Any other clip gives, without end. Hold s where f > L_c, the lesser limit, and move both ports by D:
one motor gives D min(f, L_a), the other takes D L_c; go back with f = 0: each round has given
D (min(f, L_a) - L_c). With a ground, weight or a third port the forces are not equal and opposite:
where port i is clipped and port j is not, moving i changes the force of j, but moving j not that
of i; so the forces are no gradient, and a round at that edge gives energy one way or the other.

Masses have a port that is clipped give, too: what they gain while the motor cannot resist, they
give back where it can, no more than they can store, but each time. So a scene with masses is
passive on the condition that no motor is at its limit while they move, and the account of the run
(`runtime.scene.hold`), which counts the efforts that acted, ends it otherwise.
Source: derived here.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping

from tautwave.certificate.data import Element, Verdict
from tautwave.config import Rig
from tautwave.rig import axis_allowance
from tautwave.types import CommandDelay
from tautwave_scenes.networks.network import Link, Network
from tautwave_scenes.rig.network import scene_of

ALIKE = 1e-9
"""Relative difference of two limits that are one."""


def clipping_elements(
    rig: Rig, network: Network, delays: Mapping[str, CommandDelay]
) -> Iterator[Element]:
    """Yield the verdict on the limits of each group of ports that the network joins."""
    grounds = {name for name, _ in network.grounds} | {one.name for one in network.strings}
    for nodes in groups(network, grounds):
        ports = [name for name in network.ports if name in nodes]
        if len(ports) < 2:
            continue
        limits = {name: _limit(rig, name, delays[f"master.{name}"]) for name in ports}
        heavy = network.gravity != 0.0 and any(mass.name in nodes for mass in network.masses)
        grounded = is_grounded(network.links, nodes, grounds)
        why = joined(len(ports), grounded=grounded, heavy=heavy)
        yield limits_element(ports, limits, why)


def clip_condition(masses: bool, axis_name: str) -> tuple[str, ...]:
    """Return the condition on a port's motor where masses move behind it."""
    if not masses:
        return ()
    return (
        f"the motor of {axis_name} is not at its effort_limit while the scene's masses move; the "
        "run's account stops it otherwise",
    )


def groups(network: Network, grounds: set[str]) -> list[set[str]]:
    """Return the nodes that links join other than by a ground."""
    sets = [{name} for name in network.nodes() if name not in grounds]
    for link in network.links:
        ends = [nodes for nodes in sets if link.a in nodes or link.b in nodes]
        if len(ends) == 2 and link.a not in grounds and link.b not in grounds:
            ends[0] |= ends[1]
            sets.remove(ends[1])
    return sets


def _limit(rig: Rig, port: str, delay: CommandDelay) -> float:
    """Return the scene's force at which a port's motor is at its limit [N]."""
    scale = abs(scene_of(rig).ports[port].position_scale)
    return axis_allowance(rig, f"master.{port}", delay).coupling_effort / scale


def limits_element(ports: list[str], limits: Mapping[str, float], why: str) -> Element:
    """Return the verdict on the limits of joined ports; `why` they cannot be alike, or ""."""
    title = f"limits of {', '.join(ports)}"
    least, greatest = min(limits.values()), max(limits.values())
    numbers = {f"limit_{name}": limit for name, limit in limits.items()}
    remedy = "join no more than two ports, by themselves, or require coupled_stable"
    if not why and greatest - least > ALIKE * greatest:
        listed = ", ".join(f"{limit:.4g} N at {name}" for name, limit in limits.items())
        why = f"their limits differ in the scene's force: {listed}"
        remedy = f"give them one effort_limit per position_scale ({least:.4g} N)"
    if why:
        verdict = Verdict(
            False,
            f"{title}: {why}, so where one motor is at its limit and another is not, moving the "
            f"ports around a closed path generates energy each time, without bound; {remedy}.",
        )
    else:
        verdict = Verdict(
            True, f"{title}: clipped at {least:.4g} N both, slow motion gives no energy."
        )
    return Element(title, "limits", "scene", verdict, verdict, numbers, (verdict.reason,))


def joined(ports: int, *, grounded: bool, heavy: bool) -> str:
    """Return what makes the forces at so many joined ports unequal, as a clause; "" of a pair."""
    if ports > 2:
        return "the scene joins more than two ports"
    if grounded:
        return "the scene joins them with a ground"
    return "masses between them have weight" if heavy else ""


def is_grounded(links: Iterable[Link], nodes: Collection[str], grounds: Collection[str]) -> bool:
    """Return whether a link other than a damper holds some nodes to a ground."""
    return any(
        (link.a in nodes and link.b in grounds) or (link.b in nodes and link.a in grounds)
        for link in links
        if link.kind != "damper"
    )
