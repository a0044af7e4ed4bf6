"""The picture of a 3D scene's certificate: damping required by each axis, and by all together."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from tautwave.canvas import (
    MASTER,
    SLAVE,
    SOFT,
    WALL,
    WALL_SHADE,
    heading,
    legend,
    note,
    panels,
    text_panel,
)
from tautwave.certificate.panels import decades
from tautwave.config import Rig
from tautwave.rig import axis_allowance
from tautwave.types import CommandDelay
from tautwave_scenes.certificate.caption import SCENE
from tautwave_scenes.certificate.joint import leak_together, needed_together, seen
from tautwave_scenes.certificate3d.maps import levers, network3d_map
from tautwave_scenes.certificate3d.verdict import LARGE
from tautwave_scenes.networks3d.arrays import compile_network3d
from tautwave_scenes.rig.network3d import axis_scales, pruned_network3d, scene3d_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def scene3d_certificate(rig: Rig, delays: Mapping[str, CommandDelay]) -> Figure:
    """Return the damping each axis requires over frequency, and the share required by all.

    Only the linear part near the start position is drawn: contacts are open.
    """
    network = pruned_network3d(rig).network
    names = [f"master.{name}" for name in network.axes]
    title = f"{rig.name}: certificate, contacts open"
    figure, (left, right, below, rest) = panels([2.3, 0.1], title, False, columns=2)
    text_panel(below, [(SOFT, SCENE)])
    rest.set_axis_off()
    heading(left, "required damping, each axis alone")
    heading(right, "all axes together")
    law = None
    if len(network.masses) <= LARGE:
        ways = levers(network, axis_scales(rig))
        law = network3d_map(
            compile_network3d(network).arrays, scene3d_of(rig).scheme, rig.period_s, ways
        )
        law = seen(law)
    if law is None:
        missing = f"more than {LARGE} masses: not evaluated"
    elif not np.any(law.d) and not len(law.a):
        missing = "no linear link at any axis, contacts open"
    else:
        missing = ""
    if missing or law is None:
        note(left, missing)
        right.set_axis_off()
        return figure
    has = [axis_allowance(rig, name, delays[name]) for name in names]
    damping = np.array([one.coupling_damping for one in has])
    late = np.array([delays[n].periods + delays[n].remainder_s / rig.period_s for n in names])
    need = needed_together(law, damping, late)
    theta = np.concatenate([np.geomspace(1e-4, 0.1, 300), np.linspace(0.1, math.pi - 1e-6, 900)])
    near = 2.0 * math.pi * need.frequency * rig.period_s
    if near > 0.0:
        theta = np.concatenate([theta, near * (1.0 + np.linspace(-0.05, 0.05, 401))])
    theta = np.unique(np.clip(theta, 1e-4, math.pi))
    hertz = theta / (2.0 * math.pi * rig.period_s)
    leak = leak_together(law, theta, late)
    for at, name in enumerate(network.axes):
        good = need.alone[at] <= damping[at]
        curve = leak[:, at, at].real
        style = ("-", "--", ":")[at % 3]
        left.semilogx(hertz, curve, style, color=MASTER if good else SLAVE, label=name)
        left.axhline(damping[at], linestyle=style, color=WALL, linewidth=1.0)
    left.plot([], [], color=WALL, label="guaranteed device damping")
    high = 1.3 * max(float(damping.max()), *(n for n in need.alone if math.isfinite(n)), 1e-9)
    left.set(xlabel="frequency [Hz]", ylabel="damping [N s/m]", ylim=(-high, high))
    root = np.sqrt(np.maximum(damping, 1e-300))
    shares = np.linalg.eigvalsh(leak / np.outer(root, root))[:, -1]
    right.axhspan(-1.0, 1.0, color=WALL_SHADE, alpha=0.45, label="passive")
    colour = MASTER if need.share <= 1.0 else SLAVE
    right.semilogx(hertz, shares, color=colour, label="required share of the damping")
    top = 1.3 * max(1.0, need.share if math.isfinite(need.share) else 1.0)
    right.set(xlabel="frequency [Hz]", ylabel="share", ylim=(-0.3 * top, top))
    for axes in (left, right):
        decades(axes)
        legend(axes)
    return figure
