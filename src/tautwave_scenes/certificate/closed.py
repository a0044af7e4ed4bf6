"""What is said of a scene with its contacts closed: for any hand, and with the stated one."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from tautwave.certificate.data import Element, LoopCase, PairLoop, Verdict
from tautwave.config import Rig
from tautwave.rig import axis_allowance
from tautwave.rig.hands import stated_hand
from tautwave.types import CommandDelay
from tautwave_scenes.certificate.contacts import (
    Maps,
    Regime,
    Worst,
    borne,
    closed_poles,
    steepness,
    worst_need,
)
from tautwave_scenes.certificate.joint import Matrix
from tautwave_scenes.networks.sampled import PortMap
from tautwave_scenes.rig.network import hold_limit

STABLE = 1e-9
"""Distance of a pole beyond the unit circle that is still rounding."""

SPLIT = 1e-6
"""The same for the double pole of a free mass."""


def unproved(names: Sequence[str], limit: float) -> str:
    """Return the condition for links that no theorem covers; `limit` [J] is that of the account."""
    return (
        f"the energy created by the effort hold at {listed(names)} stays small: no theorem bounds "
        f"it; a run measures it (scene.hold) and stops beyond {limit:.4g} J"
    )


def listed(names: Sequence[str]) -> str:
    """Return names in words, long lists cut."""
    return ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")


class ClosedScene(NamedTuple):
    """A rig's scene with contacts closed: axes (full names), their delays, and its map in a regime.

    `conditions` is what remains unproved of contacts that open and close. Without contacts, and for
    a scene that is refused or not evaluated as it is, there are no regimes.
    """

    rig: Rig
    axes: Sequence[str]
    delays: Sequence[CommandDelay]
    regimes: Sequence[tuple[Regime, PortMap]]
    maps: Maps
    conditions: tuple[str, ...]

    @property
    def dampings(self) -> list[float]:
        """[N m s/rad or N s/m] What each device is sure to have for the scene."""
        both = zip(self.axes, self.delays, strict=True)
        return [axis_allowance(self.rig, name, delay).coupling_damping for name, delay in both]


def close_all(found: Sequence[Regime], maps: Maps) -> list[tuple[Regime, PortMap]]:
    """Return regimes with their maps."""
    return [(regime, maps(regime)) for regime in found]


def closed_element(scene: ClosedScene) -> Iterator[Element]:
    """Yield the element for the ports with contacts closed, if there are any."""
    title, rig = "contacts", scene.rig
    damping = np.array(scene.dampings)
    late = np.array([d.periods + d.remainder_s / rig.period_s for d in scene.delays])
    worst = worst_need(scene.regimes, damping, late)
    if worst is None:
        return
    numbers = {"share": worst.need.share, "frequency": worst.need.frequency}
    need, margin = f"{title}: {_need(scene, worst)}.", 1.0 - worst.need.share
    if margin >= 0.0:
        verdict = Verdict(True, need, scene.conditions, margin)
    else:
        most = max(one.stiffness for one in worst.regime.closed.values())
        bears = most * borne(worst, scene.maps, damping, late)
        numbers["greatest_stiffness"] = bears
        remedy = f"Lower the stiffness there to {bears:.4g} {_units(scene)[0]}, or raise"
        remedy = remedy if bears > 0.0 else "Raise"
        verdict = Verdict(
            False, f"{need} {remedy} the rate or the device's damping.", margin=margin
        )
    sentences = (verdict.reason, *(f"{title}: if {c}." for c in verdict.conditions))
    yield Element(title, "scene contacts", "scene", verdict, verdict, numbers, sentences)


def _units(scene: ClosedScene) -> tuple[str, str]:
    rotary = scene.rig.axes[scene.axes[0]].kind == "rotary"
    return ("N m/rad", "N m s/rad") if rotary else ("N/m", "N s/m")


def _need(scene: ClosedScene, worst: Worst) -> str:
    """Say what the worst regime needs of the devices."""
    stiff, damp = _units(scene)
    need = worst.need
    what = f"{worst.regime.text} ({steepness(worst.regime, stiff)})"
    have = f"(Colgate and Schenkel; at {need.frequency:.4g} Hz), of which"
    if len(scene.axes) == 1:
        present = scene.dampings[0]
        return (
            f"{what} the scene, sampled at {scene.rig.rate_hz:g} Hz, needs {need.alone[0]:.4g} "
            f"{damp} of the device {have} {present:.4g} is assumed"
        )
    return (
        f"{what} the scene, sampled at {scene.rig.rate_hz:g} Hz, needs {need.share:.4g} times the "
        "damping assumed for all devices together (Colgate and Schenkel, searched on a grid; at "
        f"{need.frequency:.4g} Hz)"
    )


def _switching(scene: ClosedScene, damping: Matrix) -> tuple[str, ...]:
    """Return the condition for walls at ports, unless devices and hands dissipate all they leak.

    `damping` is of both. Then any sequence of opening and closing is covered.
    """
    late = np.array([d.periods + d.remainder_s / scene.rig.period_s for d in scene.delays])
    worst = worst_need(scene.regimes, damping, late)
    if worst is None or worst.need.share <= 1.0:
        return ()
    names = [axis.partition(".")[2] for axis in scene.axes]
    return (unproved(list(worst.regime.closed), hold_limit(scene.rig, names)),)


def closed_loop(scene: ClosedScene, ports: str) -> Iterator[PairLoop]:
    """Yield the loop of devices, stated hands and scene with contacts closed, if there are any."""
    if not scene.regimes:
        return
    rig, title = scene.rig, f"port {ports}"
    hands = [stated_hand(rig, name.partition(".")[2]) for name in scene.axes]
    text = "; ".join(dict.fromkeys(hand.text for hand in hands))
    name = f"{ports}, contacts closed"
    both = list(zip([rig.axes[name] for name in scene.axes], scene.dampings, hands, strict=True))
    ends = {
        bound: (
            np.array([getattr(axis.inertia, bound) + one.hand.mass for axis, _, one in both]),
            np.array([damping + one.hand.damping for _, damping, one in both]),
            np.array([one.hand.stiffness for *_, one in both]),
        )
        for bound in ("lower", "value")
    }
    late = [d.periods + (1 if d.remainder_s > 0.0 else 0) for d in scene.delays]
    cases: list[LoopCase] = []
    steep = {}
    for poles in closed_poles(scene.regimes, ends, late, SPLIT):
        radius = float(abs(poles.pole))
        if poles.alone:
            reason = (
                f"{title}: the scene is unstable by itself {poles.regime.text} (|z| = "
                f"{radius:.6g}) at {rig.rate_hz:g} Hz. Raise the rate, or use discrete_gradient."
            )
            yield PairLoop(name, Verdict(False, reason), text, tuple(cases))
            return
        growth = math.log(radius) / rig.period_s if radius > 0.0 else -math.inf
        hertz = float(abs(np.angle(poles.pole))) / (2.0 * math.pi * rig.period_s)
        case = LoopCase(
            poles.regime.text, poles.mass, radius <= 1.0 + STABLE, radius, growth, hertz
        )
        cases.append(case)
        steep[case] = steepness(poles.regime, _units(scene)[0])
    worst = max(cases, key=lambda one: one.radius)
    mode = (
        f"{worst.contact} ({steep[worst]}) its least damped mode is at {worst.frequency:.4g} Hz "
        f"(|z| = {worst.radius:.8f})"
    )
    if worst.stable:
        conditions = scene.conditions or _switching(scene, ends["lower"][1])
        verdict = Verdict(
            True, f"{title}: stable with {text}: {mode}.", conditions, 1.0 - worst.radius
        )
    else:
        verdict = Verdict(
            False,
            f"{title}: unstable with {text}: {mode} and grows by {worst.growth:.3g} per second. "
            "Raise the rate, or lower the contact's stiffness.",
            margin=1.0 - worst.radius,
        )
    yield PairLoop(name, verdict, text, tuple(cases))
