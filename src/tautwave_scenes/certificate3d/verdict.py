"""The certificate of a rig with a 3D scene.

Links that turn are not linear. Proved at any position: before sampling the network creates no
energy. Near the start position: its linear part, sampled as it runs, for all axes together. Beyond
that nothing is claimed: turning links and nonlinear ones are listed as conditions.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from tautwave.certificate.belief import assumed, broken_damping, broken_delay, broken_inertia
from tautwave.certificate.data import (
    Certificate,
    Element,
    LoopCase,
    PairLoop,
    Verdict,
)
from tautwave.config import Rig
from tautwave.rig import axis_allowance
from tautwave.rig.hands import stated_hand
from tautwave.types import CommandDelay
from tautwave_scenes.certificate.closed import (
    SPLIT,
    STABLE,
    ClosedScene,
    close_all,
    closed_element,
    closed_loop,
    listed,
    unproved,
)
from tautwave_scenes.certificate.contacts import Regime
from tautwave_scenes.certificate.joint import (
    JointNeed,
    joint_poles,
    needed_together,
    radius_of,
    seen,
)
from tautwave_scenes.certificate.verdict import active_links, joined
from tautwave_scenes.certificate3d.clipping import limit_conditions, limits_elements
from tautwave_scenes.certificate3d.contacts import regimes3d
from tautwave_scenes.certificate3d.maps import levers, network3d_map
from tautwave_scenes.models.link_kinds import LINK_KINDS, is_linear
from tautwave_scenes.networks.sampled import PortMap
from tautwave_scenes.networks3d.arrays import Arrays3d, compile_network3d
from tautwave_scenes.networks3d.matrices import symplectic_share, tangent
from tautwave_scenes.networks3d.network import Network3d
from tautwave_scenes.rig.network import hold_limit, press_energy
from tautwave_scenes.rig.network3d import axis_scales, pruned_network3d, scene3d_of

LARGE = 60
"""Masses above which the linear part is not turned into matrices."""


class _Scene:
    """A rig's network near its start, and the data all its verdicts share."""

    def __init__(self, rig: Rig, delays: Mapping[str, CommandDelay]) -> None:
        self.rig = rig
        self.network: Network3d = pruned_network3d(rig).network
        self.scheme = scene3d_of(rig).scheme
        compiled = compile_network3d(self.network)
        self.arrays: Arrays3d = compiled.arrays
        self.limit = hold_limit(rig, self.network.axes)
        self.axes = [f"master.{name}" for name in self.network.axes]
        self.delays = [delays[name] for name in self.axes]
        self.has = [axis_allowance(rig, name, delays[name]) for name in self.axes]
        self.large = len(self.network.masses) > LARGE
        self.ways = levers(self.network, axis_scales(rig))
        self.law: PortMap | None = None
        self.least = 0.0
        if not self.large:
            self.near = tangent(self.arrays)
            self.law = network3d_map(
                self.arrays, self.scheme, rig.period_s, self.ways, near=self.near
            )
            n = 3 * len(self.network.masses)
            stiffness = self.near.stiffness[:n, :n]
            if n:
                size = np.sqrt(self.near.mass)
                values = np.linalg.eigvalsh(stiffness / np.outer(size, size))
                self.least = float(values.min()) if values.min() < -1e-9 * values.max() else 0.0

    def closed(self) -> ClosedScene:
        """Return the scene with its contacts closed."""
        rig = self.rig
        order = {name: at for at, name in enumerate(compile_network3d(self.network).links)}

        def close(regime: Regime) -> PortMap:
            links = {order[name]: one for name, one in regime.closed.items()}
            return network3d_map(
                self.arrays, self.scheme, rig.period_s, self.ways, links, self.near
            )

        limits = np.array([one.coupling_effort for one in self.has])
        efforts = {  # at which the first axis that bears a share of the force is at its limit
            name: float(np.min(limits[row != 0.0] / np.abs(row[row != 0.0]), initial=math.inf))
            for name, row in zip(self.network.coordinates, self.ways, strict=True)
        }
        cases = []
        if self.law is not None and active_links(self.network) is None:
            energy = press_energy(rig, self.network.axes)
            cases = regimes3d(self.network, self.near, efforts, energy)
        laws = close_all(cases, close)
        return ClosedScene(rig, self.axes, self.delays, laws, close, self.conditions())

    def conditions(self) -> tuple[str, ...]:
        """Return the conditions that no theorem covers."""
        curved = [
            k.name for k in self.network.links if LINK_KINDS[k.kind].proof in ("curved", "sliding")
        ]
        turning = [
            k.name
            for k in self.network.links
            if is_linear(k.kind) and (k.rest != 0.0 or k.damping > 0.0)
        ]
        conditions = []
        if curved:
            conditions.append(unproved(curved, self.limit))
        if turning:
            conditions.append(
                f"the energy created by {listed(turning)} as they turn away from the start "
                "position stays small: no theorem bounds it; a run measures it (scene.hold) and "
                f"stops beyond {self.limit:.4g} J"
            )
        conditions += [
            f"the energy created by holding the wrench on {tool.name} as it turns stays small: "
            "the bound is for a single pose; a run measures it (scene.hold) and stops beyond "
            f"{self.limit:.4g} J"
            for tool in self.network.tools
            if tool.turns
        ]
        if self.network.elements:
            conditions.append(
                "the energy created by the tissue as it rotates and deforms away from the start "
                "position stays small: no theorem bounds it when sampled; a run measures it "
                f"(scene.hold) and stops beyond {self.limit:.4g} J"
            )
        if self.scheme == "linearly_implicit":
            conditions.append(
                "the energy that one linear solve a step creates (scene.numeric) stays small: a "
                f"run measures it, and stops beyond {self.limit:.4g} J"
            )
        share = symplectic_share(self.arrays, self.rig.period_s)
        if self.scheme == "symplectic" and share >= 1.0:
            rate = _rate_for(self.arrays, self.rig.rate_hz)
            conditions.append(
                "no configuration shows the largest stiffness of all links at once, for which "
                f"symplectic would need {rate:.4g} Hz"
            )
        return tuple(conditions)


def _rate_for(s: Arrays3d, rate: float) -> float:
    """Return the lowest tried rate [Hz] at which the symplectic scheme is stable in any posture."""
    low, high = rate, 2.0 * rate
    while symplectic_share(s, 1.0 / high) >= 1.0:
        low, high = high, 2.0 * high
    for _ in range(20):
        middle = 0.5 * (low + high)
        if symplectic_share(s, 1.0 / middle) >= 1.0:
            low = middle
        else:
            high = middle
    return high


def scene3d_certificate(
    rig: Rig, delays: Mapping[str, CommandDelay], passes: Mapping[str, str]
) -> Certificate:
    """Return the certificate of a rig with a 3D scene; `passes` as for other scenes."""
    scene = _Scene(rig, delays)
    closed = scene.closed()
    ports = ", ".join(name for name, _ in scene.network.grips)
    elements = (_network(scene), *_ports(scene), *_limits(scene), *closed_element(closed))
    loops = (_loop(scene), *closed_loop(closed, ports))
    return joined(rig, elements, loops, passes)


def _network(scene: _Scene) -> Element:
    """Return the element for the network without sampling, valid at any position."""
    network = scene.network
    numbers = {
        "masses": float(len(network.masses)),
        "links": float(len(network.links)),
        "tetrahedra": float(len(network.elements)),
        "least_stiffness_per_mass": scene.least,
        "symplectic_share": symplectic_share(scene.arrays, scene.rig.period_s),
    }
    verdict = active_links(scene.network)
    if verdict is None:
        verdict = Verdict(
            True,
            "network: every link has a potential or only dissipates, along its line, "
            + ("every tetrahedron has a potential and dissipates, " if network.elements else "")
            + "so the network is passive in continuous time at any position"
            + ("." if network.gravity == (0.0, 0.0, 0.0) else ", except for the work of gravity."),
        )
    return Element("network", "network", "scene", verdict, verdict, numbers, (verdict.reason,))


def _ports(scene: _Scene) -> Iterator[Element]:
    """Yield the elements of the sampled axes: each with the others held, then all together."""
    rig = scene.rig
    need: JointNeed | None = None
    damping = np.array([one.coupling_damping for one in scene.has])
    late = [d.periods + d.remainder_s / rig.period_s for d in scene.delays]
    felt = 0 if scene.law is None else len(seen(scene.law).a)
    why = ""
    if scene.large:
        why = f"more than {LARGE} masses are not evaluated"
    elif scene.law is not None:
        need = needed_together(scene.law, damping, np.array(late))
    for at, name in enumerate(scene.axes):
        yield _axis(scene, at, name, need, why)
    if need is not None and len(scene.axes) > 1 and felt:
        reason = (
            f"all axes together: near the start position the linear part needs {need.share:.1%} "
            "of the assumed damping (Colgate and Schenkel for all axes together, searched on a "
            f"grid; at {need.frequency:.4g} Hz)"
        )
        verdict = active_links(scene.network) or Verdict(
            need.share <= 1.0,
            reason + ("." if need.share <= 1.0 else "; raise the rate or the devices' damping."),
            scene.conditions() if need.share <= 1.0 else (),
            1.0 - need.share,
        )
        numbers = {"share": need.share, "frequency": need.frequency}
        yield Element(
            "all axes", "scene ports", "scene", verdict, verdict, numbers, (verdict.reason,)
        )


def _limits(scene: _Scene) -> Iterator[Element]:
    """Yield the elements of ports that the network joins."""
    scales = axis_scales(scene.rig)
    limits = {
        name: has.coupling_effort / abs(scale) if scale else math.inf
        for name, has, scale in zip(scene.network.axes, scene.has, scales, strict=True)
    }
    return limits_elements(scene.network, limits)


def _axis(scene: _Scene, at: int, name: str, need: JointNeed | None, why: str) -> Element:
    rig, axis = scene.rig, scene.rig.axes[name]
    unit = "N m s/rad" if axis.kind == "rotary" else "N s/m"
    title = f"port axis {name.partition('.')[2]}"
    numbers: dict[str, float] = {}
    checks = (
        broken_inertia(rig, name),
        broken_damping(rig, name),
        broken_delay(rig, name, scene.delays[at]),
    )
    broken = [sentence for sentence in checks if sentence]
    bad = active_links(scene.network)
    if bad is not None:
        passive = Verdict(False, f"{title}: {bad.reason}")
    elif broken:
        passive = Verdict(False, f"{title}: {broken[0]}.")
    elif need is None:
        passive = Verdict(False, f"{title}: {why}")
    else:
        alone, present = need.alone[at], scene.has[at].coupling_damping
        numbers = {
            "needed_damping": alone,
            "damping": present,
            "damping_margin": present - alone,
        }
        tail = (
            f"near the start position its linear part, sampled at {rig.rate_hz:g} Hz, needs "
            f"{alone:.4g} {unit} of the device (Colgate and Schenkel, searched on a grid, the "
            f"other axes held), of which {present:.4g} is assumed."
        )
        if need.share == 0.0 and not numbers["needed_damping"]:
            tail = (
                f"no spring or damper acts on it at the start, at {rig.rate_hz:g} Hz or any rate."
            )
        if alone <= present:
            conditions = (
                *scene.conditions(),
                *limit_conditions(scene.network, scene.network.axes[at]),
                *assumed(axis, name, inertia=True, damping=True),
            )
            passive = Verdict(True, f"{title}: {tail}", conditions, present - alone)
        else:
            tail += " Raise the rate or the device's damping, or lower the coupling spring."
            passive = Verdict(False, f"{title}: {tail}", margin=present - alone)
    quantised = passive
    if axis.encoder_quantum > 0.0 and passive.passed:
        quantised = Verdict(False, f"{title}: encoder steps are not covered with a scene")
    shared = scene.conditions() if at else ()
    lines = [f"{title}: if {c}." for c in passive.conditions if c not in shared]
    if shared and passive.conditions:
        lines.append(f"{title}: under the same scene conditions as {scene.network.axes[0]}.")
    sentences = (passive.reason, *lines)
    return Element(title, "scene port", name, passive, quantised, numbers, sentences)


def _loop(scene: _Scene) -> PairLoop:
    """Return the verdict on the loop of all hands, devices and the linear part, near the start."""
    rig = scene.rig
    names = list(scene.network.axes)
    ports = ", ".join(name for name, _ in scene.network.grips)
    hands = [stated_hand(rig, name) for name in names]
    text = "; ".join(dict.fromkeys(hand.text for hand in hands))
    bad = active_links(scene.network)
    if bad is not None:
        return PairLoop(ports, Verdict(False, f"port {ports}: {bad.reason}"), text, ())
    if scene.law is None:
        unevaluated = Verdict(False, f"port {ports}: more than {LARGE} masses are not evaluated")
        return PairLoop(ports, unevaluated, text, ())
    refused = _refusal(scene)
    if refused is not None:
        return PairLoop(ports, Verdict(False, f"port {ports}: {refused}"), text, ())
    late = [d.periods + (1 if d.remainder_s > 0.0 else 0) for d in scene.delays]
    own = [rig.axes[name] for name in scene.axes]
    cases = []
    for bound in ("lower", "value"):
        poles = joint_poles(
            scene.law,
            np.array(
                [
                    getattr(axis.inertia, bound) + hand.hand.mass
                    for axis, hand in zip(own, hands, strict=True)
                ]
            ),
            np.array(
                [
                    one.coupling_damping + hand.hand.damping
                    for one, hand in zip(scene.has, hands, strict=True)
                ]
            ),
            np.array([hand.hand.stiffness for hand in hands]),
            late,
        )
        worst = poles[np.argmax(np.abs(poles))]
        radius = float(abs(worst))
        growth = math.log(radius) / rig.period_s if radius > 0.0 else -math.inf
        hertz = float(abs(np.angle(worst))) / (2.0 * math.pi * rig.period_s)
        stable = radius <= 1.0 + STABLE
        cases.append(LoopCase("with every contact open", bound, stable, radius, growth, hertz))
    case = max(cases, key=lambda one: one.radius)
    least = f"its least damped mode is at {case.frequency:.4g} Hz (|z| = {case.radius:.8f})"
    if case.stable:
        beliefs = [
            condition
            for axis, name in zip(own, scene.axes, strict=True)
            for condition in assumed(axis, name, inertia=True, damping=True)
        ]
        verdict = Verdict(
            True,
            f"port {ports}: near the start position stable with {text}: {least}.",
            (*scene.conditions(), *beliefs),
            1.0 - case.radius,
        )
    else:
        verdict = Verdict(
            False,
            f"port {ports}: unstable with {text}: {least} and grows by {case.growth:.3g} per "
            "second. Raise the rate, or lower the coupling spring.",
            margin=1.0 - case.radius,
        )
    return PairLoop(ports, verdict, text, tuple(cases))


def _refusal(scene: _Scene) -> str | None:
    """Return why the network by itself is not stable at its start."""
    assert scene.law is not None
    if scene.least < 0.0:
        rate = math.sqrt(-scene.least)
        return (
            f"at the start, links are compressed so that the network buckles (it departs at "
            f"{rate:.3g} per second): start it at a stable equilibrium"
        )
    own = radius_of(scene.law)
    if own <= 1.0 + SPLIT:
        return None
    rate = _rate_for(scene.arrays, scene.rig.rate_hz)
    return (
        f"{scene.scheme} cannot run the scene at {scene.rig.rate_hz:g} Hz: it is unstable by "
        f"itself (|z| = {own:.6g}). Raise the rate to {rate:.4g} Hz, or use discrete_gradient."
    )
