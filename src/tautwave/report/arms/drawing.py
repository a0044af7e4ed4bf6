"""Arms as a picture, leader and follower side by side, more in rows, and as an animation (GIF).

Links are drawn from joint to joint; walls in space behind them; the way of the tip as a thin line;
arrows at the tip are what coupling and walls exert, the longest force of the run a fifth of the
picture. Horizontal arms are seen from above, others obliquely. Pillow, as for scenes.
"""

from __future__ import annotations

import io
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image, ImageDraw

from tautwave.canvas import EDGE, GRID, INK, MASTER, PAPER, SHADE, SLAVE, SOFT, WALL, WALL_SHADE
from tautwave.report.arms.view import ArmsView, ArmView
from tautwave.report.figures.envelope import Floats
from tautwave.report.figures.frames import FRAMES, OVER, Colours, ground, save_frames

PANEL, HEIGHT = 360, 360
MARGIN, TOP = 0.1, 30
ARROW = 0.2
FONT = 13

ROUNDS = 6
"""Arrows are as long in pixels whatever the scale, which they have a part in: it settles."""


COLUMNS = 2
"""Arms in a row: of two sides with several each, a side has its own."""


class _Panel(NamedTuple):
    """Where an arm is drawn: left and upper edge [pixel], corner seen [m], pixels per metre."""

    left: int
    top: int
    corner: Floats
    scale: float

    def pixels(self, seen: Floats) -> list[tuple[float, float]]:
        x = MARGIN * PANEL * OVER + (seen[..., 0] - self.corner[0]) * self.scale
        y = (1.0 - MARGIN) * HEIGHT * OVER - (seen[..., 1] - self.corner[1]) * self.scale
        return [(float(a), float(b)) for a, b in zip(x.ravel(), y.ravel(), strict=True)]


def arms_still(view: ArmsView, dark: bool) -> bytes:
    """Return the arms where most force was, as PNG."""
    buffer = io.BytesIO()
    _draw(view, _panels(view), view.liveliest, ground(dark)).save(buffer, "PNG")
    return buffer.getvalue()


def write_arms_animation(view: ArmsView, path: Path) -> None:
    """Write the whole run as a GIF."""
    panels = _panels(view)
    rows = np.unique(np.linspace(0, len(view.time) - 1, FRAMES).astype(int))
    save_frames([_draw(view, panels, row, ground(False)) for row in rows], path)


def _panels(view: ArmsView) -> list[_Panel]:
    panels = []
    strongest = _strongest(view)
    room = np.array([(1.0 - 2.0 * MARGIN) * PANEL, (1.0 - MARGIN) * HEIGHT - TOP]) * OVER
    for number, arm in enumerate(view.arms):
        places = [arm.seen(arm.joints).reshape(-1, 3)]
        if not arm.flat:
            places.append(arm.seen(_floor(arm.joints)).reshape(-1, 3))
        places += [
            arm.seen(part)
            for wall in arm.walls.values()
            for part in wall.lines  # a plane's patch may be cut
        ]
        low, high = _corners(places)
        scale = _scale(low, high, room)
        for _ in range(ROUNDS if strongest > 0.0 else 0):
            longest = ARROW * PANEL * OVER / scale / strongest  # m/N
            heads = [
                arm.seen(arm.joints[:, -1] + np.nan_to_num(force) * longest)
                for force in arm.forces.values()
            ]
            low, high = _corners([*places, *heads])
            scale = _scale(low, high, room)
        corner = 0.5 * (low + high) - 0.5 * room / scale
        down, across = divmod(number, COLUMNS)
        panels.append(_Panel(across * PANEL * OVER, down * HEIGHT * OVER, corner, scale))
    return panels


def _strongest(view: ArmsView) -> float:
    """Return the greatest force of the run [N]."""
    forces = [f for arm in view.arms for f in arm.forces.values()]
    return max((float(np.nanmax(np.linalg.norm(f, axis=1))) for f in forces), default=0.0)


def _corners(places: list[Floats]) -> tuple[Floats, Floats]:
    seen = np.concatenate(places)[:, :2]
    return seen.min(axis=0), seen.max(axis=0)


def _scale(low: Floats, high: Floats, room: Floats) -> float:
    """Return the pixels per metre at which all has room."""
    return float((room / np.maximum(high - low, 1e-6)).min())


def _floor(places: Floats) -> Floats:
    """Return joints on the floor of their base."""
    floor = places.copy()
    floor[..., 2] = min(0.0, float(places[..., 2].min()))
    return floor


def _draw(view: ArmsView, panels: list[_Panel], row: int, hue: Colours) -> Image.Image:
    across, down = min(len(view.arms), COLUMNS), -(-len(view.arms) // COLUMNS)
    image = Image.new("RGB", (PANEL * OVER * across, HEIGHT * OVER * down), hue[PAPER])
    strongest = _strongest(view)
    for arm, panel in zip(view.arms, panels, strict=True):
        part = Image.new("RGB", (PANEL * OVER, HEIGHT * OVER), hue[PAPER])
        _arm(ImageDraw.Draw(part), arm, panel, row, hue, strongest)
        image.paste(part, (panel.left, panel.top))
    pen = ImageDraw.Draw(image)
    pen.text(
        (6 * OVER, (HEIGHT * down - 20) * OVER),
        f"{view.time[row]:.2f} s",
        fill=hue[SOFT],
        font_size=FONT * OVER,
    )
    return image


def _arm(
    pen: ImageDraw.ImageDraw,
    arm: ArmView,
    panel: _Panel,
    row: int,
    hue: Colours,
    strongest: float,
) -> None:
    colour = hue[MASTER if arm.side == "master" else SLAVE]
    for wall in arm.walls.values():
        for patch in wall.patches:
            corners = panel.pixels(arm.seen(patch))
            # One that is seen edge-on is a line.
            pen.polygon(corners, fill=hue[WALL_SHADE])
            pen.line([*corners, corners[0]], fill=hue[WALL], width=OVER)
        for line in wall.lines:
            pen.line(panel.pixels(arm.seen(line)), fill=hue[WALL], width=2 * OVER)
    way = panel.pixels(arm.seen(arm.joints[:, -1]))
    pen.line(way, fill=hue[SHADE], width=OVER)
    places = arm.joints[row]
    if not arm.flat:
        # The shadow: how far it reaches is seen by it.
        shadow = panel.pixels(arm.seen(_floor(places)))
        pen.line(shadow, fill=hue[GRID], width=5 * OVER, joint="curve")
    spots = panel.pixels(arm.seen(places))
    pen.line(spots, fill=hue[EDGE], width=6 * OVER, joint="curve")
    x, y = spots[0]
    half = 7 * OVER
    pen.rectangle((x - half, y - half, x + half, y + half), fill=hue[EDGE])
    for x, y in spots[1:-1]:
        _disc(pen, x, y, 4.5 * OVER, hue[PAPER], hue[EDGE], 2 * OVER)
    x, y = spots[-1]
    if strongest > 0.0:
        longest = ARROW * PANEL * OVER / strongest
        for name, force in arm.forces.items():
            head = arm.seen(force[row]) * longest
            tint = hue[INK if name == "coupling" else WALL]
            _arrow(pen, (x, y), (x + float(head[0]), y - float(head[1])), tint)
    _disc(pen, x, y, 5.5 * OVER, colour, hue[INK], OVER)
    pen.text((8 * OVER, 6 * OVER), _caption(arm, row), fill=hue[INK], font_size=FONT * OVER)


def _caption(arm: ArmView, row: int) -> str:
    own = arm.name.partition(".")[0] == arm.side
    parts = [arm.name if own else f"{arm.side} ({arm.name})"]
    for name, force in arm.forces.items():
        size = float(np.linalg.norm(force[row]))
        if size >= 0.05:
            parts.append(f"{name} {size:.1f} N")
    return ",  ".join(parts)


def _disc(
    pen: ImageDraw.ImageDraw, x: float, y: float, radius: float, fill: str, edge: str, wide: int
) -> None:
    pen.ellipse((x - radius, y - radius, x + radius, y + radius), fill, edge, wide)


def _arrow(
    pen: ImageDraw.ImageDraw, start: tuple[float, float], end: tuple[float, float], colour: str
) -> None:
    dx, dy = end[0] - start[0], end[1] - start[1]
    size = math.hypot(dx, dy)
    if size < 4 * OVER:
        return
    ux, uy = dx / size, dy / size
    head = min(9.0 * OVER, 0.6 * size)
    neck = (end[0] - head * ux, end[1] - head * uy)
    pen.line((*start, *neck), fill=colour, width=3 * OVER)
    wide = 0.45 * head
    pen.polygon(
        [
            end,
            (neck[0] - wide * uy, neck[1] + wide * ux),
            (neck[0] + wide * uy, neck[1] - wide * ux),
        ],
        fill=colour,
    )
