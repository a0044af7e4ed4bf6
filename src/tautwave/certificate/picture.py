"""The certificate as a picture: needed damping over frequency, K-B plane, waves of the ports."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tautwave.analysis.exact_bound import reduce_fraction
from tautwave.analysis.loop_modes import transfer
from tautwave.analysis.sampled_wall import wall_transfer
from tautwave.analysis.wall_limits import greatest_stiffness
from tautwave.analysis.wall_passivity import leak_form
from tautwave.analysis.wall_stability import held_device, stable_stiffness
from tautwave.analysis.wall_verdict import WallVerdict
from tautwave.certificate.belief import Contact, declared_delays, stated_contact
from tautwave.certificate.derate import derate_walls
from tautwave.certificate.loops import believed_end
from tautwave.certificate.walls import wall_name, wall_verdict
from tautwave.config import Rig, local_wall
from tautwave.rig import at_axis_rate
from tautwave.types import CommandDelay

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INK, GOOD, BAD, SOFT = "#222222", "#009E73", "#D55E00", "#0072B2"
ROW, WIDTH = 3.1, 9.8
DAMPINGS = 21


def draw_certificate(rig: Rig, path: Path) -> None:
    """Write the picture of a rig's certificate as a PNG.

    A row per local wall: the device damping that it needs at each frequency beside what the
    device has, and the plane of K and B with both limits. A row for the ports of a wave line.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    delays = declared_delays(rig)
    if rig.scene is not None and rig.scene.dimension == 3:
        from tautwave.certificate.space_picture import draw_space_certificate

        draw_space_certificate(rig, path, delays)
        return
    if rig.scene is not None:
        from tautwave.certificate.scene_picture import draw_scene_certificate

        draw_scene_certificate(rig, path, delays)
        return
    asked = rig
    rig, _ = derate_walls(rig, delays, {})
    rows: list[tuple[str, WallVerdict]] = []
    for axis_name, axis in rig.axes.items():
        wall = local_wall(rig, axis_name)
        if wall is not None and axis.causality == "impedance":
            own = at_axis_rate(rig, axis_name)
            rows.append((axis_name, wall_verdict(own, axis_name, wall, delays, {})))
    waves = rig.coupling.law == "wave"
    count = max(1, len(rows) + waves)
    figure = Figure(figsize=(WIDTH, ROW * count + 0.5), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(f"{rig.name}: what is certified".replace("$", r"\$"), fontsize=12)
    panels = figure.subplots(count, 2, squeeze=False)
    for (axis_name, found), (left, right) in zip(rows, panels, strict=False):
        rotary = rig.axes[axis_name].kind == "rotary"
        units = ("N m/rad", "N m s/rad") if rotary else ("N/m", "N s/m")
        left.set_title(wall_name(rig, axis_name), loc="left", fontsize=10)
        _needed(left, found, units[1])
        before = local_wall(asked, axis_name)
        _plane(right, found, units, found.wall.stiffness if before is None else before.stiffness)
    if waves:
        for side, panel in zip(("master", "slave"), panels[len(rows)], strict=True):
            _ports(panel, rig, side, delays)
    elif not rows:
        for panel in panels[0]:
            panel.text(0.5, 0.5, "a position coupling: never certified as passive", ha="center")
            panel.set_axis_off()
    figure.savefig(path, format="png", dpi=110)


def _needed(panel: Axes, found: WallVerdict, unit: str) -> None:
    wall = found.wall
    theta = np.concatenate([np.geomspace(1e-4, 0.1, 200), np.linspace(0.1, math.pi, 400)])
    top, bottom = reduce_fraction(*wall_transfer(wall))
    needed = 0.5 * wall.period * leak_form(top, bottom, wall.delay).values(theta)
    hertz = theta / (2.0 * math.pi * wall.period)
    present = found.device.damping
    low, high = min(0.0, float(needed.min())), 1.2 * max(float(needed.max()), present, 1e-12)
    panel.axhspan(low, present, color=GOOD, alpha=0.12, label="passive")
    panel.axhline(present, color=GOOD, linewidth=1.2, label="device damping, certain")
    panel.semilogx(hertz, needed, color=SOFT if found.passive else BAD, label="needed by the wall")
    if math.isfinite(found.leak.damping):
        panel.plot(max(found.leak.frequency, hertz[0]), found.leak.supremum, "o", color=INK, ms=4)
    panel.set(xlabel="frequency [Hz]", ylabel=f"damping [{unit}]", ylim=(low, high))
    panel.legend(fontsize=8, frameon=False)


def _plane(panel: Axes, found: WallVerdict, units: tuple[str, str], asked: float) -> None:
    wall, device = found.wall, found.device
    held = held_device(device.mass, device.damping, found.hand)
    widest = 1.3 * max(wall.damping, device.damping, 1e-9)
    dampings = np.linspace(0.0, widest, DAMPINGS)
    passive, stable = [], []
    for damping in dampings.tolist():
        here = wall._replace(damping=damping)
        passive.append(greatest_stiffness(here, device.damping))
        stable.append(stable_stiffness(here, held).limit)
    finite = [value for value in (*passive, *stable) if 0.0 < value < math.inf]
    floor = 0.3 * min([wall.stiffness, *finite])
    panel.fill_between(dampings, floor, np.maximum(passive, floor), color=GOOD, alpha=0.15)
    panel.plot(dampings, np.maximum(passive, floor), color=GOOD, label="passive for any hand")
    who = "with the stated hand" if found.hand is not None else "without a hand"
    if any(math.isfinite(value) for value in stable):
        panel.plot(dampings, stable, color=SOFT, linestyle="--", label=f"stable {who}")
    colour = GOOD if found.passive else BAD
    panel.plot(wall.damping, wall.stiffness, "o", color=colour, label="this wall", clip_on=False)
    if asked > wall.stiffness:
        panel.plot(wall.damping, asked, "x", color=BAD, label="asked", clip_on=False)
    panel.set_yscale("log")
    panel.set(xlabel=f"B [{units[1]}]", ylabel=f"K [{units[0]}]", xlim=(0.0, widest))
    panel.set_ylim(bottom=floor)
    panel.legend(fontsize=8, frameon=False)


def _ports(panel: Axes, rig: Rig, side: str, delays: Mapping[str, CommandDelay]) -> None:
    theta = np.concatenate([np.geomspace(1e-4, 0.1, 150), np.linspace(0.1, math.pi, 250)])
    panel.axhspan(0.0, 1.0, color=GOOD, alpha=0.12)
    panel.axhline(1.0, color=GOOD, linewidth=1.2)
    highest = 1.0
    for name in rig.coupling.pairs:
        axis_name = f"{side}.{name}"
        cases: list[tuple[str, Contact | None, str]] = [("free", None, "-")]
        contact = stated_contact(rig, axis_name)
        if contact is not None:
            cases.append(("held as stated", contact, "--"))
        for label, held, style in cases:
            own = at_axis_rate(rig, axis_name)
            end = believed_end(own, axis_name, delays, "lower", held)
            hertz = theta / (2.0 * math.pi * own.period_s)
            share = np.abs(transfer(end, np.exp(1j * theta))[0])
            highest = max(highest, float(share.max()))
            panel.semilogx(hertz, share, style, label=f"{name}, {label}", linewidth=1.2)
    panel.set_title(f"{side} ports", loc="left", fontsize=10)
    panel.set(xlabel="frequency [Hz]", ylabel="returned share of a wave", ylim=(0.0, 1.1 * highest))
    panel.legend(fontsize=8, frameon=False)
