"""The sampled virtual wall: the damping it needs, and its greatest stable stiffness.

Sources: Colgate & Schenkel 1997; Diolaiti et al. 2006, eq. 19; Colgate & Brown 1995; Gil et al.
2009 (its linear rule, against the exact loop).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from tautwave import canvas
from tautwave.analysis.exact.bounds import reduce_fraction
from tautwave.analysis.ports.sampled_loop import Device
from tautwave.analysis.walls.passivity import leak_form, wall_leak
from tautwave.analysis.walls.sampled import SampledWall, wall_transfer
from tautwave.analysis.walls.stability import stable_stiffness, wall_mode
from tautwave.canvas import heading, legend
from tests.analysis.reference.wall_rules import bounce_gain, linear_rule
from tests.lab.papers import Chapter, Row, relative

if TYPE_CHECKING:
    from matplotlib.figure import Figure

T, MASS, DAMPING = 1e-3, 0.1, 0.1
COLGATE, AGAIN = "Colgate & Schenkel", "recomputed"
WALLS = (
    (SampledWall(1000.0, 0.2, T), 0.7, COLGATE),
    (SampledWall(1000.0, -0.2, T), 0.7, COLGATE),
    (SampledWall(5000.0, 1.0, T), 3.5, COLGATE),
    (SampledWall(1000.0, 0.0, T), 0.5, COLGATE),
    (SampledWall(1000.0, 0.0, T, 1.0), 1.5, "Diolaiti et al., eq. 19"),
    (SampledWall(1000.0, 0.0, T, 2.0), 2.5, "Diolaiti et al., eq. 19"),
    (SampledWall(1000.0, 0.0, T, 3.0), 3.5, "Diolaiti et al., eq. 19"),
    (SampledWall(1000.0, 0.5, T, 0.0, T), 0.6666667, "Colgate & Brown"),
    (SampledWall(1000.0, -0.5, T, 0.0, T), 1.0, "Colgate & Brown"),
    (SampledWall(1000.0, 0.5, T, 0.0, 5e-3), 0.5454545, "Colgate & Brown"),
)
LIMITS = (
    (0.0, 0.0, 200.0333), (0.0, 1.0, 66.68518), (1.0, 0.0, 2178.4834), (1.0, 1.0, 725.38746),
    (5.0, 1.0, 3211.4264), (50.0, 1.0, 14017.358),
)  # fmt: skip


def rows() -> list[Row]:
    """Return required dampings, stable stiffnesses, and the energy gained in a bounce."""
    listed = [
        Row(f"damping needed by {_name(wall)}", "N s/m", wall_leak(wall).damping, needed, 1e-6, who)
        for wall, needed, who in WALLS
    ]
    for damping, delay, limit in LIMITS:
        wall = SampledWall(0.0, damping, T, delay)
        found = stable_stiffness(wall, Device(MASS, DAMPING)).limit
        name = f"greatest stable K, B = {damping:g} N s/m, {delay:g} samples late"
        listed.append(relative(name, "N/m", found, limit, 1e-5, AGAIN))
    held = SampledWall(1000.0, 0.0, T)
    radius = wall_mode(held, Device(MASS)).radius
    listed.append(Row("pole radius, K = 1 N/mm, undamped", "1", radius, 1.0024968828, 1e-9, AGAIN))
    gain = bounce_gain(held, MASS)
    listed.append(Row("energy of a bounce, after over before", "1", gain, 1.17009, 5e-6, AGAIN))
    return listed


def damping_figure() -> Figure:
    """Return the damping that sampled walls need at each frequency."""
    figure, (plain, late) = canvas.panels(
        [2.4], "The damping that a sampled wall needs, K = 1 N/mm, T = 1 ms", False, columns=2
    )
    theta = np.linspace(1e-3, math.pi, 800)
    hertz = theta / (2.0 * math.pi * T)
    colours = (canvas.MASTER, canvas.SLAVE, canvas.WALL, canvas.LINE)
    for axes, walls in (
        (plain, (WALLS[3][0], WALLS[0][0], WALLS[1][0], WALLS[7][0])),
        (late, (WALLS[3][0], WALLS[4][0], WALLS[5][0], WALLS[6][0])),
    ):
        for wall, colour in zip(walls, colours, strict=True):
            top, bottom = reduce_fraction(*wall_transfer(wall))
            needed = 0.5 * T * leak_form(top, bottom, wall.delay).values(theta)
            leak = wall_leak(wall)
            axes.plot(hertz, needed, color=colour, label=_name(wall))
            axes.plot([leak.theta / (2.0 * math.pi * T)], [leak.damping], "o", color=colour)
        axes.set_xlabel("frequency [Hz]")
        axes.set_ylabel("needed damping [N s/m]")
        legend(axes)
    plain.set_ylim(0.0, 0.75)
    late.set_ylim(-0.6, 3.7)
    heading(plain, "Virtual damping B, filtered or not: b > K T/2 + |B|")
    heading(late, "Delay of d samples: b > K T (1/2 + d)")
    return figure


def stability_figure() -> Figure:
    """Return the greatest stable stiffness over B, exactly and by the linear rule."""
    figure, (axes,) = canvas.panels(
        [2.6], "Stable is not passive: the stiffest wall for a mass of 0.1 kg", False
    )
    dampings = np.geomspace(0.01, 190.0, 90)
    for delay, colour in ((0.0, canvas.MASTER), (1.0, canvas.SLAVE)):
        walls = [SampledWall(0.0, b, T, delay) for b in dampings.tolist()]
        exact = [stable_stiffness(wall, Device(MASS, DAMPING)).limit for wall in walls]
        rule = [linear_rule(wall, DAMPING) for wall in walls]
        name = "at once" if delay == 0.0 else "a sample late"
        shown = np.where(np.array(exact) > 0.0, exact, np.nan)
        axes.loglog(dampings, shown, color=colour, label=f"exact loop, {name}")
        label = f"linear rule (Gil et al.), {name}"
        axes.loglog(dampings, rule, "--", color=colour, linewidth=1.0, label=label)
    b = np.linspace(0.01, 0.0999, 60)
    passive = 2.0 * (DAMPING - b) / T
    axes.loglog(b, passive, color=canvas.WALL, label="passive for any hand")
    axes.set_ylim(10.0, 3e5)
    axes.set_xlabel("virtual damping B [N s/m]")
    axes.set_ylabel("stiffness K [N/m]")
    for way in (axes.xaxis, axes.yaxis):
        way.set_major_formatter(lambda value, _: f"{value:g}")
    legend(axes)
    return figure


def _name(wall: SampledWall) -> str:
    parts = [f"K = {wall.stiffness:g}"]
    parts += [f"B = {wall.damping:g}"] if wall.damping else []
    parts += [f"{wall.delay:g} late"] if wall.delay else []
    parts += [f"filter {1e3 * wall.filter_s:g} ms"] if wall.filter_s else []
    return ", ".join(parts)


CHAPTER = Chapter(rows, {"wall-damping": damping_figure, "wall-stability": stability_figure})
