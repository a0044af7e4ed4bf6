"""The picture of a certificate of points in space: what each axis needs, and all together."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from tautwave.certificate.scene_picture import BAD, GOOD, ROW, SOFT, WIDTH
from tautwave.certificate.space_maps import leak_together, needed_together, seen, space_map
from tautwave.certificate.spaces import FELT, LARGE
from tautwave.config import Rig
from tautwave.rig.space import axis_scales, pruned_space, space_of
from tautwave.scene.space.arrays import compile_space
from tautwave.types import CommandDelay


def draw_space_certificate(rig: Rig, path: Path, delays: Mapping[str, CommandDelay]) -> None:
    """Write the damping that each axis needs over frequency, and the share that all need.

    Only the linear part near the start position is drawn: contacts are open.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    network = pruned_space(rig).network
    names = [f"master.{name}" for name in network.axes]
    figure = Figure(figsize=(WIDTH, ROW + 0.5), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(f"{rig.name}: what is certified".replace("$", r"\$"), fontsize=12)
    left, right = figure.subplots(1, 2)
    left.set_title("each axis, the others held", loc="left", fontsize=10)
    right.set_title("all axes together", loc="left", fontsize=10)
    law = None
    if len(network.masses) <= LARGE:
        scales = np.array(axis_scales(rig))
        law = space_map(compile_space(network).arrays, space_of(rig).scheme, rig.period_s, scales)
        law = seen(law)
    if law is None or len(law.a) > 6 * FELT + len(names):
        told = f"more than {LARGE if law is None else FELT} masses: not evaluated"
    elif not np.any(law.d) and not len(law.a):
        told = "no linear link at any axis, contacts open"
    else:
        told = ""
    if told or law is None:
        for axes in (left, right):
            axes.text(0.5, 0.5, told, ha="center", transform=axes.transAxes)
            axes.set_axis_off()
        figure.savefig(path, format="png", dpi=110)
        return
    damping = np.array([rig.axes[name].damping.lower for name in names])
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
        left.semilogx(hertz, curve, style, color=SOFT if good else BAD, label=name)
        left.axhline(damping[at], linestyle=style, color=GOOD, linewidth=1.0)
    left.plot([], [], color=GOOD, label="device damping, certain")
    high = 1.3 * max(float(damping.max()), *(n for n in need.alone if math.isfinite(n)), 1e-9)
    left.set(xlabel="frequency [Hz]", ylabel="damping [N s/m]", ylim=(-high, high))
    left.legend(fontsize=8, frameon=False, loc="lower left")
    root = np.sqrt(np.maximum(damping, 1e-300))
    shares = np.linalg.eigvalsh(leak / np.outer(root, root))[:, -1]
    right.axhspan(-1.0, 1.0, color=GOOD, alpha=0.12, label="passive")
    colour = SOFT if need.share <= 1.0 else BAD
    right.semilogx(hertz, shares, color=colour, label="needed share of the damping")
    top = 1.3 * max(1.0, need.share if math.isfinite(need.share) else 1.0)
    right.set(xlabel="frequency [Hz]", ylabel="share", ylim=(-0.3 * top, top))
    right.legend(fontsize=8, frameon=False, loc="lower left")
    figure.savefig(path, format="png", dpi=110)
