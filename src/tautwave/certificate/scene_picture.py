"""The picture of a scene's certificate: what its ports need, and what they are."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from tautwave.certificate.scene_maps import law_over, leak_over, linear_scene, needed
from tautwave.certificate.scenes import LARGE
from tautwave.config import Rig
from tautwave.rig.scene import pruned_network, scene_of
from tautwave.types import CommandDelay

INK, GOOD, BAD, SOFT = "#222222", "#009E73", "#D55E00", "#0072B2"
ROW, WIDTH = 3.1, 9.8


def draw_scene_certificate(rig: Rig, path: Path, delays: Mapping[str, CommandDelay]) -> None:
    """Write a row per port: device damping needed over frequency, and the sampled stiffness.

    Only the linear part is drawn: contacts are open, strings and other nonlinear links absent.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    network = pruned_network(rig).network
    scene = scene_of(rig)
    figure = Figure(figsize=(WIDTH, ROW * len(network.ports) + 0.5), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(f"{rig.name}: what is certified".replace("$", r"\$"), fontsize=12)
    panels = figure.subplots(len(network.ports), 2, squeeze=False)
    for name, (left, right) in zip(network.ports, panels, strict=True):
        axis = rig.axes[f"master.{name}"]
        rotary = axis.kind == "rotary"
        left.set_title(f"port {name}", loc="left", fontsize=10)
        right.set_title("linear part, contacts open", loc="left", fontsize=10)
        if len(network.masses) > LARGE:
            left.text(0.5, 0.5, f"more than {LARGE} masses: not evaluated", ha="center")
            left.set_axis_off()
            right.set_axis_off()
            continue
        law = linear_scene(
            network, scene.scheme, rig.period_s, name, scene.ports[name].position_scale
        )
        delay = delays[f"master.{name}"]
        late = delay.periods + delay.remainder_s / rig.period_s
        need = needed(law, late)
        near = 2.0 * math.pi * need.frequency * rig.period_s
        theta = [np.geomspace(1e-4, 0.1, 300), np.linspace(0.1, math.pi - 1e-6, 1500)]
        if near > 0.0:
            theta.append(near * (1.0 + np.linspace(-0.05, 0.05, 801)))
        angles = np.unique(np.clip(np.concatenate(theta), 1e-4, math.pi))
        hertz = angles / (2.0 * math.pi * rig.period_s)
        leak = leak_over(law, angles, late)
        present = axis.damping.lower
        high = 1.3 * max(need.damping if math.isfinite(need.damping) else 0.0, present, 1e-9)
        left.axhspan(-high, present, color=GOOD, alpha=0.12, label="passive")
        left.axhline(present, color=GOOD, linewidth=1.2, label="device damping, certain")
        colour = SOFT if need.damping <= present else BAD
        left.semilogx(hertz, np.clip(leak, -high, high), color=colour, label="needed by the scene")
        if 0.0 < need.damping < math.inf:
            left.plot(max(need.frequency, hertz[0]), need.damping, "o", color=INK, ms=4)
        unit = "N m s/rad" if rotary else "N s/m"
        left.set(xlabel="frequency [Hz]", ylabel=f"damping [{unit}]", ylim=(-high, high))
        left.legend(fontsize=8, frameon=False, loc="lower left")
        size = np.abs(law_over(law, angles))
        if size.max() > 0.0:
            right.loglog(hertz, np.maximum(size, 1e-9 * size.max()), color=SOFT)
            unit = "N m/rad" if rotary else "N/m"
            right.set(xlabel="frequency [Hz]", ylabel=f"effort over position [{unit}]")
        else:
            right.text(0.5, 0.5, "no linear link at this port", ha="center")
            right.set_axis_off()
    figure.savefig(path, format="png", dpi=110)
