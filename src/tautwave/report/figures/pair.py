"""The figures of one pair: tracking, effort, contact, waves."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from tautwave.canvas import (
    BAND,
    CONTACTS,
    EDGE,
    INK,
    LIMIT,
    LINE,
    MASTER,
    SHADE,
    SIDE,
    SLAVE,
    SOFT,
    WALL,
    WALL_SHADE,
    heading,
    legend,
    panels,
)
from tautwave.report.figures.canvas import draw, mark_stop, shade
from tautwave.report.figures.envelope import Trace, peak, spread
from tautwave.report.run.views import PairView
from tautwave.report.units import quantity, scale_for

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CAUSE = {
    "environment": "contact with the environment",
    "wall_slave": "inside the slave's virtual wall",
    "wall_master": "inside the master's virtual wall",
}
_GROUNDS = (
    (("environment",), "contact", SHADE),
    (("wall_slave", "wall_master"), "in virtual wall", WALL_SHADE),
)


def tracking_figure(view: PairView) -> Figure | None:
    """Positions of master and slave in master units, with their difference below."""
    lines = view.lines
    if "master.position" not in lines and "slave.position" not in lines:
        return None
    least = max(view.least.get(f"{side}.position", 0.0) for side in SIDE) if view.least else 0.0
    moved = [lines.get(name) for name in ("master.position", "slave.position", "error")]
    if spread(*moved) <= least:
        view.flat.append("position and position error")
        return None
    figure, (above, below) = panels((2.3, 1.5), f"Tracking of {view.name}")
    unit = view.units["master"][0]
    shown = [lines.get(name) for name in ("master.position", "slave.position", "reference")]
    factor, label = scale_for(peak(*shown), unit)
    _shade(above, view)
    draw(above, shown[2], factor, "hand's reference", color=SOFT, linestyle=":", linewidth=1.6)
    draw(above, shown[0], factor, "master", color=MASTER)
    draw(above, shown[1], factor, "slave", color=SLAVE, linestyle=(0, (5, 1.5)))
    mark_stop(above, view.stop)
    heading(above, "Position, slave in master units")
    above.set_ylabel(f"position [{label}]")
    legend(above)
    error, expected = lines.get("error"), lines.get("expected")
    factor, label = scale_for(peak(error), unit)
    _shade(below, view, False)
    if expected is not None and expected.middle is not None and expected.is_rough():
        # Noise of the effort is irrelevant to the offset.
        assert expected.middle_time is not None
        expected = Trace(expected.middle_time, expected.middle)
    draw(below, expected, factor, "standing offset", color=SOFT, linestyle=":", linewidth=1.6)
    draw(below, error, factor, "master − slave", color=INK, linewidth=1.2)
    mark_stop(below, view.stop, labelled=False)
    heading(below, "Position error")
    below.set_ylabel(f"error [{label}]")
    below.axhline(0.0, color=EDGE, linewidth=0.8)
    below.set_xlabel("time [s]")
    legend(below)
    return figure


def effort_figure(view: PairView) -> Figure | None:
    """The transmitted effort, and all efforts that act on each device."""
    lines = view.lines
    sides = [side for side in SIDE if f"{side}.port_effort" in lines]
    if not sides:
        return None
    drawn: list[Callable[[Axes], None]] = []
    felt, given = lines.get("master.transmitted"), lines.get("slave.transmitted")
    if spread(felt, given) > view.least.get("master.effort", 0.0):
        drawn.append(lambda panel: _transmitted(panel, view))
    else:
        view.flat.append("effort transmitted")
    for side in sides:
        shown = [lines.get(f"{side}.{name}") for name in _ACTING]
        if spread(*shown) > view.least.get(f"{side}.effort", 0.0):
            drawn.append(partial(_acting, view=view, side=side))
        else:
            view.flat.append(f"effort on the {side}")
    if not drawn:
        return None
    figure, axes = panels((1.8,) * len(drawn), f"Effort of {view.name}")
    for panel, into in zip(axes, drawn, strict=True):
        into(panel)
        mark_stop(panel, view.stop, labelled=panel is axes[0])
        legend(panel)
    axes[-1].set_xlabel("time [s]")
    return figure


def _transmitted(panel: Axes, view: PairView) -> None:
    felt, given = view.lines.get("master.transmitted"), view.lines.get("slave.transmitted")
    factor, label = scale_for(peak(felt, given), view.units["master"][1])
    _shade(panel, view)
    draw(panel, felt, factor, "master: pushes back", color=MASTER)
    draw(panel, given, factor, "slave: pushes with", color=SLAVE, linestyle=(0, (5, 1.5)))
    heading(panel, "Transmitted by the coupling, in master units")
    panel.set_ylabel(f"effort [{label}]")


_ACTING = (
    "commanded",
    "port_effort",
    "wall_effort",
    "measured_effort",
    "hand_effort",
    "environment_effort",
)


def _acting(panel: Axes, view: PairView, side: str) -> None:
    lines = view.lines
    names: dict[str, tuple[str, dict[str, Any]]] = {
        "commanded": ("commanded in all", {"color": BAND, "linewidth": 2.6}),
        "port_effort": ("coupling port", {"color": SIDE[side]}),
        "wall_effort": ("virtual wall", {"color": WALL}),
        "measured_effort": ("measured", {"color": LINE, "linewidth": 1.0}),
        "hand_effort": ("hand (true)", {"color": INK, "linestyle": ":"}),
        "environment_effort": ("environment (true)", {"color": INK, "linestyle": ":"}),
    }
    shown = {name: lines.get(f"{side}.{name}") for name in names}
    if shown["measured_effort"] is not None:
        shown["port_effort"] = None  # its mirror image
    if shown["wall_effort"] is None:
        shown["commanded"] = None  # without a wall there is only the port
    for name in ("hand_effort", "environment_effort"):
        if peak(shown[name]) == 0.0:
            shown[name] = None  # no hand on the slave, no environment at the master
    greatest = peak(*shown.values())
    factor, label = scale_for(greatest, view.units[side][1])
    _shade(panel, view, False)
    for name, (text, style) in names.items():
        draw(panel, shown[name], factor, text, **style)
    limit = view.limits.get(side)
    if limit is not None and greatest > 0.6 * limit:
        for at in (-limit, limit):
            panel.axhline(
                factor * at,
                color=LIMIT,
                linewidth=1.0,
                linestyle="-.",
                label="effort limit" if at > 0 else "",
            )
    heading(panel, f"Efforts on the {side} device, positive along its position")
    panel.set_ylabel(f"effort [{label}]")


def wave_figure(view: PairView) -> Figure | None:
    """Leaving and arriving waves; an enlargement of both directions shows the line's delay."""
    lines = view.lines
    if "master.wave_out" not in lines and "slave.wave_out" not in lines:
        return None
    waves = [line for name, line in lines.items() if name.endswith(("wave_in", "wave_out"))]
    if spread(*waves) <= view.least.get("wave", 0.0):
        view.flat.append("waves")
        return None
    figure, axes = panels((1.5, 1.5), f"Waves of {view.name}")
    enlarged = view.zoom.get("master.wave_out")
    if enlarged is not None and view.delay_s > 0.0:
        figure, axes = panels((1.5, 1.5, 1.5), f"Waves of {view.name}", (True, True, False))
        for source, sink in (("master", "slave"), ("slave", "master")):
            _way(axes[2], view.zoom, source, sink)
        heading(axes[2], f"Both ways, enlarged at {enlarged.time[0]:.2f} s")
        axes[2].set_xlabel("time [s]")
        legend(axes[2])
    for panel, source, sink in ((axes[0], "master", "slave"), (axes[1], "slave", "master")):
        _shade(panel, view, panel is axes[0])
        _way(panel, lines, source, sink)
        heading(panel, f"From {source} to {sink}")
        legend(panel, f"one-way delay\n{quantity(view.delay_s, 's')}" if panel is axes[0] else "")
    axes[1].set_xlabel("time [s]")
    return figure


def _way(panel: Axes, lines: dict[str, Trace], source: str, sink: str) -> None:
    out, arrived = lines.get(f"{source}.wave_out"), lines.get(f"{sink}.wave_in")
    draw(panel, out, 1.0, f"leaves {source}", color=SIDE[source])
    style = (0, (5, 1.5))
    draw(panel, arrived, 1.0, f"arrives at {sink}", color=SIDE[sink], linestyle=style)
    panel.set_ylabel("wave [√W]")


def contact_figure(view: PairView) -> Figure | None:
    """Force over depth of the hardest contacts, and the hardest one over time."""
    cause = view.cause
    if not cause:
        return None
    figure, (loop, time) = panels((2.5, 1.9), f"Contact of {view.name}: {CAUSE[cause]}", False)
    side = "master" if cause == "wall_master" else "slave"
    position, effort = view.units[side]
    loops = view.phase.get(cause, [])
    greatest = max((float(abs(force).max()) for _, force in loops), default=0.0)
    deepest = max((float(abs(depth).max()) for depth, _ in loops), default=0.0)
    down, down_unit = scale_for(deepest, position)
    up, up_unit = scale_for(greatest, effort)
    hardest = _strongest(view, cause)
    last = max(len(hardest) - 1, 1)
    shades = [CONTACTS[5 - round(5 * (len(hardest) - 1 - at) / last)] for at in range(len(hardest))]
    for colour, contact, (depth, force) in zip(shades, hardest, loops, strict=False):
        loop.plot(down * depth, up * force, color=colour, linewidth=1.2, label=f"{contact:.2f} s")
    known = any(c.peak_depth == c.peak_depth for c in view.contacts[cause])
    heading(loop, "Force against depth, hardest contacts (loop area: energy lost)")
    loop.margins(x=0.02)
    loop.set_xlabel(f"{'depth in the surface' if known else f'{side} position'} [{down_unit}]")
    loop.set_ylabel(f"force on the wall [{up_unit}]")
    legend(loop, "contact from")
    _pressing(time, view, cause)
    return figure


def _pressing(panel: Axes, view: PairView, cause: str) -> None:
    """The hardest contact over time, drawn pushing upward whichever side the wall is on."""
    zoom = view.zoom
    wall = zoom.get("environment" if cause == "environment" else f"{cause[5:]}.wall_effort")
    if wall is None:
        return
    side = "master" if cause == "wall_master" else "slave"
    away = -1.0 if float(np.nansum(wall.value)) > 0.0 else 1.0
    shown: dict[str, tuple[Trace, dict[str, Any]]] = {
        "force on the wall": (wall.times(-away), {"color": INK, "linestyle": ":"})
    }
    port = zoom.get(f"{side}.port_effort")
    if port is not None:
        shown[f"{side} port"] = (port.times(away), {"color": SIDE[side]})
    felt = zoom.get("master.port_effort")
    if felt is not None and side == "slave":
        # Its resisting effort, in the slave's units.
        shown["felt at master"] = (felt.times(-away * view.to_slave), {"color": MASTER})
    up, unit = scale_for(peak(*(line for line, _ in shown.values())), view.units[side][1])
    for label, (line, style) in shown.items():
        draw(panel, line, up, label, **style)
    later = f"; the hand feels it {quantity(view.delay_s, 's')} later"
    heading(
        panel,
        "The hardest contact in time" + (later if view.delay_s > 0.0 and side == "slave" else ""),
    )
    panel.set_ylabel(f"effort [{unit}]")
    panel.set_xlabel("time [s]")
    legend(panel)


def _strongest(view: PairView, cause: str) -> list[float]:
    hardest = sorted(view.contacts[cause], key=lambda c: -c.peak_effort)[:6]
    return [contact.start_s for contact in sorted(hardest)]


def _shade(panel: Axes, view: PairView, labelled: bool = True) -> None:
    for causes, text, colour in _GROUNDS:
        contacts = [contact for cause in causes for contact in view.contacts.get(cause, [])]
        shade(panel, contacts, text if labelled else "_", colour)
