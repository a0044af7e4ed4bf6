"""The certificate as a picture: required damping over frequency, K-B plane, waves of the ports."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tautwave.analysis.exact.bounds import reduce_fraction
from tautwave.analysis.ports.loop_modes import transfer
from tautwave.analysis.walls.limits import greatest_stiffness
from tautwave.analysis.walls.passivity import leak_form
from tautwave.analysis.walls.sampled import wall_transfer
from tautwave.analysis.walls.stability import held_device, stable_stiffness
from tautwave.analysis.walls.verdict import WallVerdict
from tautwave.canvas import (
    DAMPER,
    FILTER,
    INK,
    LINE,
    MASTER,
    PAPER,
    SLAVE,
    SOFT,
    WALL,
    WALL_SHADE,
    heading,
    legend,
    note,
    panels,
    plain,
    save_figure,
    text_panel,
)
from tautwave.certificate.belief import Contact, declared_delays, stated_contact
from tautwave.certificate.couplings import coupling_verdict
from tautwave.certificate.derate import derate_walls
from tautwave.certificate.hooks import certificate_hooks
from tautwave.certificate.loops import believed_end
from tautwave.certificate.panels import decades
from tautwave.certificate.walls import wall_name, wall_verdict
from tautwave.config import Rig, local_wall
from tautwave.rig import at_axis_rate
from tautwave.types import CommandDelay

Floats = NDArray[np.float64]

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WALLS = (
    "K and B are a virtual wall's spring [effort per depth] and damper [effort per velocity]: its "
    "effort is K times the depth plus B times the velocity. At each frequency the sampled wall "
    "needs damping of its device; it is passive for any hand if the device has more. So some K and "
    "B pass."
)
PORTS = (
    "A port is passive where it reflects no more of a wave than arrives, a ratio of 1. Its "
    "tank has to withhold anything above."
)
MOST = 65
"""Most points of a limit over B, denser where it bends, so that drawn corners are real."""


def draw_certificate(rig: Rig, path: Path) -> None:
    """Write the picture of a rig's certificate as a PNG, and beside it as SVG and PDF."""
    save_figure(certificate_figure(rig), path)


def explanation(rig: Rig) -> list[str]:
    """Return the figure's caption, for readers who do not know the paper."""
    if rig.scene is not None:
        return [certificate_hooks().caption()]
    texts = [WALLS] if _walls(rig) else []
    return texts if coupling_verdict(rig).picture else [*texts, PORTS]


def certificate_figure(rig: Rig) -> Figure:
    """Return the picture of a rig's certificate.

    A row per local wall: the device damping that it requires at each frequency and the damping the
    device has, and the plane of K and B with both limits. A row for the ports of a wave line.
    """
    delays = declared_delays(rig)
    if rig.scene is not None:
        return certificate_hooks().figure(rig, delays)
    asked = rig
    rig, _ = derate_walls(rig, delays, {})
    rows: list[tuple[str, WallVerdict]] = []
    for axis_name in _walls(rig):
        wall = local_wall(rig, axis_name)
        assert wall is not None
        own = at_axis_rate(rig, axis_name)
        rows.append((axis_name, wall_verdict(own, axis_name, wall, delays, {})))
    instead = coupling_verdict(rig).picture
    waves = not instead
    count = max(1, len(rows) + waves)
    title = f"{rig.name}: certificate"
    figure, axes = panels([2.1] * count + [0.1], title, False, columns=2)
    text_panel(axes[-2], [(SOFT, text) for text in explanation(rig)])
    axes[-1].set_axis_off()
    for at, (axis_name, judged) in enumerate(rows):
        left, right = axes[2 * at : 2 * at + 2]
        rotary = rig.axes[axis_name].kind == "rotary"
        units = ("N m/rad", "N m s/rad") if rotary else ("N/m", "N s/m")
        name = plain(wall_name(rig, axis_name))
        heading(left, f"{name}: damping needed")
        heading(right, f"{name}: K and B that pass")
        _needed(left, judged, units[1])
        before = local_wall(asked, axis_name)
        _plane(right, judged, units, judged.wall.stiffness if before is None else before.stiffness)
    if waves:
        for side, panel in zip(("master", "slave"), axes[2 * len(rows) :], strict=False):
            _ports(panel, rig, side, delays)
    elif not rows:
        note(axes[0], instead)
        axes[1].set_axis_off()
    return figure


def _walls(rig: Rig) -> list[str]:
    return [
        name
        for name, axis in rig.axes.items()
        if local_wall(rig, name) is not None and axis.causality == "impedance"
    ]


def bend(limit: Callable[[float], float], low: float, high: float) -> tuple[Floats, Floats]:
    """Return a limit over an interval, sampled more densely where it bends.

    Every piece is halved until its middle lies on its chord to a 500th of the whole range, or
    there are `MOST` points. Parameters and results in the limit's own units.
    """
    known = {x: limit(x) for x in np.linspace(low, high, 5).tolist()}
    pieces = list(pairwise(sorted(known)))
    while pieces and len(known) < MOST:
        a, b = pieces.pop(0)
        middle = 0.5 * (a + b)
        known[middle] = limit(middle)
        values = [value for value in known.values() if math.isfinite(value)]
        scale = max(values) - min(values) if values else 0.0
        chord = 0.5 * (known[a] + known[b])
        if not abs(known[middle] - chord) <= 0.002 * scale:
            pieces += [(a, middle), (middle, b)]
    x = np.array(sorted(known))
    return x, np.array([known[one] for one in x.tolist()])


def _needed(panel: Axes, judged: WallVerdict, unit: str) -> None:
    wall = judged.wall
    theta = np.concatenate([np.geomspace(1e-4, 0.1, 200), np.linspace(0.1, math.pi, 400)])
    top, bottom = reduce_fraction(*wall_transfer(wall))
    needed = 0.5 * wall.period * leak_form(top, bottom, wall.delay).values(theta)
    hertz = theta / (2.0 * math.pi * wall.period)
    present = judged.device.damping
    greatest = max(float(needed.max()), present, 1e-12)
    low, high = min(0.0, float(needed.min())), 1.2 * greatest
    if low < -2.0 * high:  # a wall's surplus of damping is not of interest
        low = -0.5 * high
    factor, shown = _scaled(greatest, unit)
    panel.axhspan(factor * low, factor * present, color=WALL_SHADE, alpha=0.45, label="passive")
    panel.axhline(factor * present, color=WALL, linewidth=1.4, label="guaranteed device damping")
    colour = MASTER if judged.passive else SLAVE
    label = "the wall needs"
    panel.semilogx(hertz, factor * needed, color=colour, label=label)
    if math.isfinite(judged.leak.damping):
        at = max(judged.leak.frequency, hertz[0])
        panel.plot(at, factor * judged.leak.supremum, "o", color=INK, ms=4, label="greatest need")
    panel.set(xlabel="frequency [Hz]", ylabel=f"damping [{shown}]")
    panel.set_ylim(factor * low, factor * high)
    decades(panel)
    legend(panel)


def _scaled(greatest: float, unit: str) -> tuple[float, str]:
    """Return factor and unit of an axis; products of units get a power of ten, not a prefix."""
    if not 0.0 < greatest < 0.01:
        return 1.0, unit
    power = 3 * math.floor(math.log10(greatest) / 3.0)
    return 10.0**-power, f"10{str(power).translate(_RAISED)} {unit}"


_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def _plane(panel: Axes, judged: WallVerdict, units: tuple[str, str], asked: float) -> None:
    wall, device = judged.wall, judged.device
    held = held_device(device.mass, device.damping, judged.hand)
    widest = 1.3 * max(wall.damping, device.damping, 1e-9)

    def passive(damping: float) -> float:
        return greatest_stiffness(wall._replace(damping=damping), device.damping)

    def stable(damping: float) -> float:
        return stable_stiffness(wall._replace(damping=damping), held).limit

    dampings, limits = bend(passive, 0.0, widest)
    finite = limits[np.isfinite(limits)]
    high = 1.25 * max(asked, wall.stiffness, float(finite.max()) if len(finite) else 0.0)
    across, shown = _scaled(widest, units[1])
    limits = np.minimum(limits, 10.0 * high)
    panel.fill_between(
        across * dampings, 0.0, limits, color=WALL_SHADE, alpha=0.45, linewidth=0, label="passive"
    )  # fmt: skip
    panel.plot(across * dampings, limits, color=WALL, label="largest K for any hand")
    who = "with the stated hand" if judged.hand is not None else "without a hand"
    here = stable(wall.damping)
    if min(stable(0.0), here, stable(widest)) > high:
        # Far above the frame: print the number of `check` instead of drawing a line.
        far = f"{who}: stable to K = {here:.3g}"
        panel.plot([], [], " ", label=far if math.isfinite(here) else f"{who}: always stable")
    else:
        x, y = bend(stable, 0.0, widest)
        panel.plot(across * x, y, color=MASTER, linestyle="--", label=f"stable {who}")
    colour = MASTER if judged.passive else SLAVE
    style: Any = {"markersize": 8, "markeredgecolor": PAPER, "zorder": 4, "clip_on": False}
    panel.plot(
        across * wall.damping, wall.stiffness, "o", color=colour, label="this wall", **style
    )  # fmt: skip
    if asked > wall.stiffness:
        panel.plot(across * wall.damping, asked, "X", color=SLAVE, label="asked", **style)
    panel.set(xlabel=f"damping B [{shown}]", ylabel=f"stiffness K [{units[0]}]")
    panel.set_xlim(0.0, across * widest)
    panel.set_ylim(0.0, high)
    legend(panel)


def _ports(panel: Axes, rig: Rig, side: str, delays: Mapping[str, CommandDelay]) -> None:
    theta = np.concatenate([np.geomspace(1e-4, 0.1, 150), np.linspace(0.1, math.pi, 250)])
    panel.axhspan(0.0, 1.0, color=WALL_SHADE, alpha=0.45)
    panel.axhline(1.0, color=WALL, linewidth=1.4)
    highest = 1.0
    colours = (MASTER, SLAVE, LINE, DAMPER, FILTER, INK)
    for at, name in enumerate(rig.coupling.pairs):
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
            text, colour = f"{plain(name)}, {label}", colours[at % len(colours)]
            panel.semilogx(hertz, share, style, color=colour, label=text, linewidth=1.3)
    heading(panel, f"{side} ports: reflected share of a wave")
    panel.set(xlabel="frequency [Hz]", ylabel="returned share", ylim=(0.0, 1.1 * highest))
    decades(panel)
    legend(panel)
