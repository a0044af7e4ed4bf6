"""The certificate of a rig with a scene: its linear part by matrices, the rest by its ledger.

In continuous time, masses, springs and dampers make a positive real impedance; shown from the
network's own matrices, and exactly (`analysis.positive_real`) where it is small. When sampled,
Colgate and Schenkel's condition is evaluated on the steps that run. Nonlinear links are conditions:
no theorem covers them under a hold, but their energy is accounted for and recorded. Elements that
feed energy are not certified at all.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np

from tautwave.analysis.exact.positive_real import positive_real
from tautwave.certificate.belief import assumed, broken_damping, broken_delay, broken_inertia
from tautwave.certificate.data import (
    Certificate,
    Element,
    LoopCase,
    PairLoop,
    Verdict,
    join_verdicts,
)
from tautwave.config import Rig
from tautwave.rig import axis_allowance
from tautwave.rig.hands import stated_hand
from tautwave.types import CommandDelay
from tautwave_scenes.certificate import impedance as networks
from tautwave_scenes.certificate.clipping import clip_condition, clipping_elements
from tautwave_scenes.certificate.closed import (
    SPLIT,
    STABLE,
    ClosedScene,
    close_all,
    closed_element,
    closed_loop,
    unproved,
)
from tautwave_scenes.certificate.contacts import (
    Press,
    Regime,
    curved_links,
    is_wall,
    regimes,
)
from tautwave_scenes.certificate.maps import closed_part, needed, own_radius
from tautwave_scenes.models.link_kinds import LINK_KINDS, is_active
from tautwave_scenes.networks.compiling import compile_network
from tautwave_scenes.networks.network import Link, Network
from tautwave_scenes.networks.pruning import prune
from tautwave_scenes.networks.sampled import (
    LinearScene,
    PortMap,
    linear_part,
    linear_scene,
    loop_poles,
    scene_map,
)
from tautwave_scenes.networks.schemes.exact import linear_matrices
from tautwave_scenes.rig.network import (
    hold_limit,
    press_energy,
    pruned_network,
    scene_of,
    whole_network,
)
from tautwave_scenes.rig.with_device import tuned_scene

if TYPE_CHECKING:
    from tautwave_scenes.networks.with_device import Tuned
    from tautwave_scenes.networks3d.network import Network3d

STABLE_PORTS = "every port is stable with the stated hand, its contacts open and closed."
SMALL = 6
"""Masses up to which the impedance at a port is computed in fractions."""

LARGE = 60
"""Masses above which the linear part is not turned into matrices."""

MODES_AGREE = 1e-9
"""Smallest relative error of a mode that is stated; below it the digits are the C library's."""


def scene_elements(rig: Rig, delays: Mapping[str, CommandDelay]) -> Iterator[Element]:
    """Yield the network, then each of its ports with every contact open."""
    network = pruned_network(rig).network
    curved = _curved(network, hold_limit(rig, network.ports))
    yield _network(network, curved, tuned_scene(rig, prune(whole_network(rig)).network))
    for name in network.ports:
        asked = (*curved, *clip_condition(bool(network.masses), f"master.{name}"))
        yield _port(rig, network, name, delays[f"master.{name}"], asked)
    yield from clipping_elements(rig, network, delays)


def scene_loops(rig: Rig, delays: Mapping[str, CommandDelay]) -> Iterator[PairLoop]:
    """Yield the coupled stability of each port with the stated hand, every contact open."""
    network = pruned_network(rig).network
    curved = _curved(network, hold_limit(rig, network.ports))
    for name in network.ports:
        yield _loop(rig, network, name, delays[f"master.{name}"], curved)


def _closed(rig: Rig, delays: Mapping[str, CommandDelay]) -> ClosedScene:
    """Return the scene with its contacts closed."""
    network = pruned_network(rig).network
    curved = _curved(network, hold_limit(rig, network.ports))
    axes = [f"master.{name}" for name in network.ports]
    scheme = scene_of(rig).scheme
    scales = [scene_of(rig).ports[name].position_scale for name in network.ports]
    press = Press(
        {
            name: axis_allowance(rig, axis, delays[axis]).coupling_effort / abs(scale)
            if scale
            else 0.0
            for name, axis, scale in zip(network.ports, axes, scales, strict=True)
        },
        press_energy(rig, network.ports),
    )
    masses = {mass.name: mass._replace(name="", position=0.0) for mass in network.masses}

    def kind(link: Link) -> object:
        ends = (masses.get(link.a, link.a), masses.get(link.b, link.b))
        return link._replace(name="", a="", b="", rest=0.0), ends

    def close(regime: Regime) -> PortMap:
        return scene_map(closed_part(network, regime), scheme, rig.period_s, scales)

    refusal = active_links(network) is not None or len(network.masses) > LARGE
    closed = [] if refusal else regimes(curved_links(network.links), press, kind)
    delayed = [delays[axis] for axis in axes]
    return ClosedScene(rig, axes, delayed, close_all(closed, close), close, curved)


def _curved(network: Network, limit: float) -> tuple[str, ...]:
    """Return the condition for nonlinear links and strings, if there are any but walls at ports."""
    fixed = [name for name, _ in network.grounds]
    names = [
        link.name
        for link in network.links
        if LINK_KINDS[link.kind].proof in ("curved", "sliding")
        and not is_wall(link, network.ports, fixed)
    ]
    names += [string.name for string in network.strings]
    return (unproved(names, limit),) if names else ()


def active_links(network: Network | Network3d) -> Verdict | None:
    """Return the refusal of elements that feed energy."""
    names = [link.name for link in network.links if is_active(link.kind)]
    if not names:
        return None
    return Verdict(
        False,
        f"{', '.join(names)}: a negative damper or an energy source supplies energy, so nothing "
        f"is certified; remove it, or run with --allow-uncertified",
    )


def _network(network: Network, curved: tuple[str, ...], tuned: Tuned | None = None) -> Element:
    """Return the element for the network without sampling."""
    bad = active_links(network)
    masses = len(network.masses)
    numbers: dict[str, float] = {"masses": masses, "links": len(network.links)}
    if bad is None:
        linear = "masses, springs and dampers"
        if 0 < masses <= LARGE:
            arrays = compile_network(linear_part(network)).arrays
            _, damping, stiffness = linear_matrices(arrays, range(masses))
            for key, matrix in (("damping", damping), ("stiffness", stiffness)):
                numbers[f"least_{key}"] = float(np.linalg.eigvalsh(matrix).min())
            linear = (
                f"mass, damping and stiffness matrix of its {masses} masses are symmetric and "
                f"positive semidefinite up to rounding"
            )
        exact = _exact(network)
        if exact is not None:
            linear += f"; its impedance is {exact}"
        why = f"network: {linear}, so its linear part is passive in continuous time."
        verdict = Verdict(True, why, curved)
        if tuned is not None and _gives(network):
            verdict = Verdict(
                False,
                "network: discretised with the device it has dampers below zero, which supply "
                "what sampling dissipates: by itself it is not passive in continuous time; see "
                "the port for the passivity of the sampled system.",
            )
    else:
        verdict = bad
    sentences = [verdict.reason, *(f"network: if {c}." for c in verdict.conditions)]
    if tuned is not None:
        numbers["mode_error"] = tuned.error
        sentences += _modes(tuned)
    return Element("network", "network", "scene", verdict, verdict, numbers, tuple(sentences))


def _gives(network: Network) -> bool:
    """Return whether a damper is below zero."""
    masses = [mass.damping for mass in network.masses]
    return min((*masses, *(link.damping for link in network.links)), default=0.0) < 0.0


def _modes(tuned: Tuned) -> Iterator[str]:
    """Yield the modes that a scene discretised with its device has, and its numbers."""

    def listed(modes: tuple[complex, ...]) -> str:
        return ", ".join(f"{s.imag / (2 * math.pi):.6g} Hz ({-s.real:.4g} 1/s)" for s in modes)

    yield (
        "network: discretised with device and hand; sampled, its modes are "
        f"{listed(tuned.found)}, within {max(tuned.error, MODES_AGREE):.0e} of the ideal; with "
        f"the file's parameters {listed(tuned.plain)}."
    )
    springs = [
        f"{link.name} {link.stiffness:.6g} N/m"
        + (f" and {link.damping:.4g} N s/m" if link.damping else "")
        for link in tuned.network.links
        if link.stiffness
    ]
    masses = [f"{mass.name} {mass.damping:.4g} N s/m" for mass in tuned.network.masses]
    yield f"network: it runs with {', '.join((*springs, *masses))}."


def _exact(network: Network) -> str | None:
    """Return the exact-arithmetic result for the impedance at the first port, if it is small."""
    linear = linear_part(network)
    port = linear.ports[0]
    if (
        _gives(linear)
        or len(linear.masses) > SMALL
        or not any(port in (link.a, link.b) for link in linear.links)
    ):
        return None
    moving = {mass.name for mass in linear.masses} | {port}

    def name(node: str) -> str:
        return node if node in moving else networks.GROUND

    parts: list[networks.Part] = []
    for mass in linear.masses:
        parts.append(networks.Mass(mass.name, mass.mass))
        if mass.damping:
            parts.append(networks.Damper(mass.name, networks.GROUND, mass.damping))
    for link in linear.links:
        one, two = name(link.a), name(link.b)
        if one == two:
            continue
        if link.stiffness:
            parts.append(networks.Spring(one, two, link.stiffness))
        if link.damping:
            parts.append(networks.Damper(one, two, link.damping))
    decision = positive_real(networks.impedance(parts, port))
    return f"positive real in exact arithmetic at {port}" if decision.positive_real else None


def _linear(rig: Rig, network: Network, name: str) -> LinearScene:
    scene = scene_of(rig)
    scale = scene.ports[name].position_scale
    return linear_scene(network, scene.scheme, rig.period_s, name, scale)


def _port(
    rig: Rig, network: Network, name: str, delay: CommandDelay, curved: tuple[str, ...]
) -> Element:
    """Return the element for the sampled port: Colgate and Schenkel's condition on what runs."""
    axis_name = f"master.{name}"
    axis = rig.axes[axis_name]
    unit = "N m s/rad" if axis.kind == "rotary" else "N s/m"
    bad = active_links(network)
    numbers: dict[str, float] = {}
    broken = [
        sentence
        for sentence in (
            broken_inertia(rig, axis_name),
            broken_damping(rig, axis_name),
            broken_delay(rig, axis_name, delay),
        )
        if sentence
    ]
    title = f"port {name}"
    if bad is not None:
        passive = Verdict(False, f"{title}: {bad.reason}")
    elif len(network.masses) > LARGE:
        passive = Verdict(False, f"{title}: more than {LARGE} masses are not evaluated")
    else:
        late = delay.periods + delay.remainder_s / rig.period_s
        need = needed(_linear(rig, network, name), late)
        present = axis_allowance(rig, axis_name, delay).coupling_damping
        numbers = {
            "needed_damping": need.damping,
            "damping": present,
            "damping_margin": present - need.damping,
            "frequency": need.frequency,
        }
        proof = "proved" if need.proved else "searched on a grid"
        tail = (
            f"its linear part, sampled at {rig.rate_hz:g} Hz, needs {need.damping:.4g} {unit} of "
            f"the device (Colgate and Schenkel, {proof}; at {need.frequency:.4g} Hz), of which "
            f"{present:.4g} is assumed."
        )
        conditions = (*curved, *assumed(axis, axis_name, inertia=True, damping=True))
        if broken:
            passive = Verdict(False, f"{title}: {broken[0]}.")
        elif need.damping <= present:
            passive = Verdict(True, f"{title}: {tail}", conditions, present - need.damping)
        else:
            remedy = "Raise the rate or the device's damping, or lower the coupling spring."
            failure = f"{title}: {tail} {remedy}"
            passive = Verdict(False, failure, margin=present - need.damping)
    quantised = passive
    if axis.encoder_quantum > 0.0 and passive.passed:
        quantised = Verdict(False, f"{title}: encoder steps are not covered with a scene")
    sentences = (passive.reason, *(f"{title}: if {c}." for c in passive.conditions))
    return Element(title, "scene port", axis_name, passive, quantised, numbers, sentences)


def _loop(
    rig: Rig, network: Network, name: str, delay: CommandDelay, curved: tuple[str, ...]
) -> PairLoop:
    """Return the verdict on the exact loop of hand, device and linear part."""
    axis_name = f"master.{name}"
    axis = rig.axes[axis_name]
    hand = stated_hand(rig, name)
    bad = active_links(network)
    if bad is not None:
        return PairLoop(name, Verdict(False, f"port {name}: {bad.reason}"), hand.text, ())
    if len(network.masses) > LARGE:
        unevaluated = Verdict(False, f"port {name}: more than {LARGE} masses are not evaluated")
        return PairLoop(name, unevaluated, hand.text, ())
    assert axis.inertia is not None
    scene = _linear(rig, network, name)
    own = own_radius(scene)
    if own > 1.0 + SPLIT:
        unevaluated = Verdict(
            False,
            f"port {name}: {scene_of(rig).scheme} cannot run the scene at {rig.rate_hz:g} Hz: "
            f"it is unstable by itself (|z| = {own:.6g}). Raise the rate, or use "
            f"discrete_gradient.",
        )
        return PairLoop(name, unevaluated, hand.text, ())
    late = delay.periods + (1 if delay.remainder_s > 0.0 else 0)
    cases = []
    for bound in ("lower", "value"):
        mass = getattr(axis.inertia, bound) + hand.hand.mass
        damping = axis_allowance(rig, axis_name, delay).coupling_damping + hand.hand.damping
        poles = loop_poles(scene, mass, damping, hand.hand.stiffness, late)
        worst = poles[np.argmax(np.abs(poles))]
        radius = float(abs(worst))
        growth = math.log(radius) / rig.period_s if radius > 0.0 else -math.inf
        hz = float(abs(np.angle(worst))) / (2.0 * math.pi * rig.period_s)
        stable = radius <= 1.0 + STABLE
        cases.append(LoopCase("with every contact open", bound, stable, radius, growth, hz))
    conditions = (*curved, *assumed(axis, axis_name, inertia=True, damping=True))
    worst_case = max(cases, key=lambda case: case.radius)
    text = (
        f"its least damped mode is at {worst_case.frequency:.4g} Hz (|z| = {worst_case.radius:.8f})"
    )
    if worst_case.stable:
        verdict = Verdict(
            True,
            f"port {name}: stable with {hand.text}: {text}.",
            conditions,
            1.0 - worst_case.radius,
        )
    else:
        verdict = Verdict(
            False,
            f"port {name}: unstable with {hand.text}: {text} and grows by "
            f"{worst_case.growth:.3g} per second. Raise the rate, or lower the coupling spring.",
            margin=1.0 - worst_case.radius,
        )
    return PairLoop(name, verdict, hand.text, tuple(cases))


def scene_certificate(
    rig: Rig, delays: Mapping[str, CommandDelay], passes: Mapping[str, str]
) -> Certificate:
    """Return the certificate of a rig with a scene; `passes` are the reasons of plain passes."""
    closed = _closed(rig, delays)
    ports = ", ".join(pruned_network(rig).network.ports)
    elements = (*scene_elements(rig, delays), *closed_element(closed))
    loops = (*scene_loops(rig, delays), *closed_loop(closed, ports))
    return joined(rig, elements, loops, passes)


def joined(
    rig: Rig, elements: tuple[Element, ...], loops: tuple[PairLoop, ...], passes: Mapping[str, str]
) -> Certificate:
    """Return the certificate of a scene's elements and loops."""
    verdicts = {
        "passive": join_verdicts([e.passive for e in elements], passes["passive"]),
        "passive_quantised": join_verdicts(
            [e.passive_quantised for e in elements], passes["passive_quantised"]
        ),
        "coupled_stable": join_verdicts([p.verdict for p in loops], STABLE_PORTS),
    }
    return Certificate(rig.name, rig.require, verdicts, elements, loops, {})
