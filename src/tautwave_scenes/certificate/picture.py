"""The picture of a scene's certificate: damping required by its ports, and their stiffness."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from tautwave.canvas import (
    INK,
    MASTER,
    SLAVE,
    SOFT,
    WALL,
    WALL_SHADE,
    heading,
    legend,
    note,
    panels,
    plain,
    text_panel,
)
from tautwave.certificate.panels import decades
from tautwave.config import Rig
from tautwave.rig import axis_allowance
from tautwave.types import CommandDelay
from tautwave_scenes.certificate.caption import SCENE
from tautwave_scenes.certificate.maps import law_over, leak_over, needed
from tautwave_scenes.certificate.verdict import LARGE
from tautwave_scenes.networks.sampled import linear_scene
from tautwave_scenes.rig.network import pruned_network, scene_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def scene_certificate(rig: Rig, delays: Mapping[str, CommandDelay]) -> Figure:
    """Return a row per port: required device damping over frequency, and the sampled stiffness.

    Only the linear part is drawn: contacts are open, strings and other nonlinear links absent.
    """
    network = pruned_network(rig).network
    title = f"{rig.name}: certificate, contacts open"
    figure, axes = panels([2.1] * len(network.ports) + [0.1], title, False, columns=2)
    text_panel(axes[-2], [(SOFT, SCENE)])
    axes[-1].set_axis_off()
    for at, name in enumerate(network.ports):
        left, right = axes[2 * at : 2 * at + 2]
        heading(left, f"port {plain(name)}: damping needed")
        heading(right, f"port {plain(name)}: stiffness rendered")
        if len(network.masses) > LARGE:
            note(left, f"more than {LARGE} masses: not evaluated")
            right.set_axis_off()
            continue
        _port(left, right, rig, name, delays[f"master.{name}"])
    return figure


def _port(left: Axes, right: Axes, rig: Rig, name: str, delay: CommandDelay) -> None:
    axis, scene = rig.axes[f"master.{name}"], scene_of(rig)
    rotary = axis.kind == "rotary"
    scale = scene.ports[name].position_scale
    law = linear_scene(pruned_network(rig).network, scene.scheme, rig.period_s, name, scale)
    late = delay.periods + delay.remainder_s / rig.period_s
    need = needed(law, late)
    near = 2.0 * math.pi * need.frequency * rig.period_s
    theta = [np.geomspace(1e-4, 0.1, 300), np.linspace(0.1, math.pi - 1e-6, 1500)]
    if near > 0.0:
        theta.append(near * (1.0 + np.linspace(-0.05, 0.05, 801)))
    angles = np.unique(np.clip(np.concatenate(theta), 1e-4, math.pi))
    hertz = angles / (2.0 * math.pi * rig.period_s)
    leak = leak_over(law, angles, late)
    present = axis_allowance(rig, f"master.{name}", delay).coupling_damping
    high = 1.3 * max(need.damping if math.isfinite(need.damping) else 0.0, present, 1e-9)
    low = max(-high, 1.2 * float(np.min(leak))) if np.min(leak) < 0.0 else -0.1 * high
    left.axhspan(low, present, color=WALL_SHADE, alpha=0.45, label="passive")
    left.axhline(present, color=WALL, linewidth=1.4, label="guaranteed device damping")
    colour = MASTER if need.damping <= present else SLAVE
    left.semilogx(hertz, np.clip(leak, low, high), color=colour, label="the scene needs")
    if 0.0 < need.damping < math.inf:
        at = max(need.frequency, hertz[0])
        left.plot(at, need.damping, "o", color=INK, ms=4, label="greatest need")
    unit = "N m s/rad" if rotary else "N s/m"
    left.set(xlabel="frequency [Hz]", ylabel=f"damping [{unit}]", ylim=(low, high))
    decades(left)
    legend(left)
    size = np.abs(law_over(law, angles))
    if size.max() > 0.0:
        right.loglog(hertz, np.maximum(size, 1e-9 * size.max()), color=MASTER)
        unit = "N m/rad" if rotary else "N/m"
        right.set(xlabel="frequency [Hz]", ylabel=f"effort over position [{unit}]")
        decades(right)
    else:
        note(right, "no linear link at this port")
