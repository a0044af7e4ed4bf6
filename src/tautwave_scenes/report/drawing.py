"""The scene as a picture of masses, springs and bars, and as an animation (GIF).

Each mass has a column; height is position. Ports and grounds are bars across the columns they are
linked to, springs are zigzags, contacts thin dashed lines. Drawn with Pillow, which comes with
matplotlib: a hundred frames take a second.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageChops, ImageDraw

from tautwave.canvas import BAND, EDGE, INK, MASTER, PAPER, SLAVE, SOFT
from tautwave.report.figures.frames import (
    FRAME_MS,
    FRAMES,
    LIGHT,
    OVER,
    Colours,
    ground,
    save_frames,
)
from tautwave_scenes.models.link_kinds import LINK_KINDS
from tautwave_scenes.report.view import SceneView

if TYPE_CHECKING:
    from tautwave_scenes.report3d.view import View3d

Ints = npt.NDArray[np.int64]
WIDTH, HEIGHT = 480, 320
BAR, GROUND_LINE = 5, 2  # thickness [pixel of the animation]
_LEFT, _RIGHT, _TOP, _BOTTOM = 0.08, 0.97, 0.08, 0.9
_LAST = 0.88  # end of the columns; names of grounds are drawn beside them


class _Frame(NamedTuple):
    """Where nodes are drawn: column and radius [pixel] of the masses, and the scale of heights.

    `aside` moves a bar or a ground away from the masses that touch it, by a ball's radius, so that
    a ball at the surface lies against it and not inside.
    """

    columns: dict[str, float]
    low: float
    high: float
    size: float
    aside: dict[str, float]

    def y(self, place: float) -> float:
        share = min(max((place - self.low) / (self.high - self.low), 0.0), 1.0)
        return HEIGHT * OVER * (_BOTTOM - share * (_BOTTOM - _TOP))


def _layout(view: SceneView, rows: slice) -> _Frame:
    """Return the columns, and heights that hold everything in these rows."""
    moving = [name for name in view.at if name not in view.network.ports]
    fixed = {name for name, _ in view.network.grounds}
    moving = [name for name in moving if name not in fixed]
    # A bow moves past: only nodes held by a spring or a contact have a relevant height.
    held = {end for link in view.network.links if link.stiffness for end in (link.a, link.b)}
    held |= set(moving)
    shown = [view.at[name][rows] for name in view.at if name in held]
    low = min(float(values.min()) for values in shown)
    high = max(float(values.max()) for values in shown)
    gap = 0.12 * (high - low) or 1e-3
    step = (_LAST - _LEFT) / max(len(moving), 1)
    columns = {name: WIDTH * OVER * (_LEFT + step * (at + 0.5)) for at, name in enumerate(moving)}
    for string in view.network.strings:
        share = string.near / (string.near + string.far)
        columns[string.name] = WIDTH * OVER * (_LEFT + share * (_RIGHT - _LEFT))
    size = max(3.0, min(11.0, 120.0 / max(len(columns), 1))) * OVER
    aside = _aside(view, rows, set(moving), size)
    return _Frame(columns, low - gap, high + gap, size, aside)


def _aside(view: SceneView, rows: slice, moving: set[str], size: float) -> dict[str, float]:
    """Return the offset of each bar and ground from what touches it [pixel, down]."""
    sides: dict[str, list[float]] = {}
    for link in view.network.links:
        if not LINK_KINDS[link.kind].one_way or link.a not in view.at or link.b not in view.at:
            continue
        for bar, ball in ((link.a, link.b), (link.b, link.a)):
            if ball in moving and bar not in moving:
                gap = np.median(view.at[ball][rows] - view.at[bar][rows])
                sides.setdefault(bar, []).append(float(np.sign(gap)))
    fixed = {name for name, _ in view.network.grounds}
    return {
        name: float(np.sign(sum(signs)))
        * (size + 0.5 * OVER * (GROUND_LINE if name in fixed else BAR))
        for name, signs in sides.items()
    }


def draw_frame(view: SceneView, row: int, title: str = "", *, dark: bool = False) -> Image.Image:
    """Return the scene at one row of the recording, `OVER` times as large as in the animation."""
    near = max(round(0.25 * view.rig.rate_hz), 1)
    rows = slice(max(0, row - near), row + near)
    return _draw(view, _layout(view, rows), row, title, ground(dark))


def _draw(
    view: SceneView, frame: _Frame, row: int, title: str, hue: Colours = LIGHT
) -> Image.Image:
    image = Image.new("RGB", (WIDTH * OVER, HEIGHT * OVER), hue[PAPER])
    pen = ImageDraw.Draw(image)
    size = frame.size
    fixed = {name for name, _ in view.network.grounds}
    for link in view.network.links:
        _link(pen, view, frame, row, (link.a, link.b), link.kind, hue)
    used = {end for link in view.network.links for end in (link.a, link.b)}
    # Two bars may meet: names of ports are at the left, those of grounds at the right.
    for names, colour in ((view.network.ports, hue[MASTER]), (sorted(fixed), hue[EDGE])):
        taken = 0.0
        for name in names:
            if name not in view.at or name not in used:
                continue
            y = frame.y(float(view.at[name][row])) + frame.aside.get(name, 0.0)
            taken += _bar(pen, name, y, colour, taken, fixed=name in fixed)
    for string in view.network.strings:
        point = (frame.columns[string.name], frame.y(float(view.at[string.name][row])))
        rest = frame.y(0.0)
        ends = (_LEFT * WIDTH * OVER, rest), (_RIGHT * WIDTH * OVER, rest)
        pen.line((ends[0], point, ends[1]), fill=hue[SLAVE], width=2 * OVER)
    for name, x in frame.columns.items():
        top, bottom = _squeezed(view, frame, name, row)
        box = (x - size, top, x + size, bottom)
        pen.ellipse(box, fill=hue[SLAVE], outline=hue[INK], width=OVER)
    caption = f"{title}{view.time[row]:.4f} s"
    pen.text(
        (0.01 * WIDTH * OVER, 0.93 * HEIGHT * OVER), caption, fill=hue[SOFT], font_size=13 * OVER
    )
    return image


def _squeezed(view: SceneView, frame: _Frame, name: str, row: int) -> tuple[float, float]:
    """Return top and bottom of a ball; pressed against a surface it is flattened, not inside."""
    y = frame.y(float(view.at[name][row]))
    top, bottom = y - frame.size, y + frame.size
    for link in view.network.links:
        if not LINK_KINDS[link.kind].one_way or name not in (link.a, link.b):
            continue
        bar = link.b if link.a == name else link.a
        aside = frame.aside.get(bar, 0.0)
        surface = frame.y(float(view.at[bar][row])) + math.copysign(frame.size, aside)
        if aside < 0.0:  # the bar lies above
            top = max(top, surface)
        elif aside > 0.0:
            bottom = min(bottom, surface)
    least = 0.5 * frame.size
    if bottom - top < least:  # far inside: draw a full ball against the surface
        bottom = top + least if top > y - frame.size else bottom
        top = bottom - least
    return top, bottom


def _bar(
    pen: ImageDraw.ImageDraw, name: str, y: float, colour: str, taken: float, *, fixed: bool
) -> float:
    """Draw a bar and its name beside `taken` pixels of others; return how wide that name is."""
    left, right = 0.03 * WIDTH * OVER, _RIGHT * WIDTH * OVER
    pen.line((left, y, right, y), fill=colour, width=(GROUND_LINE if fixed else BAR) * OVER)
    if fixed:
        step = 12 * OVER
        for at in range(int(left), int(right), step):
            pen.line((at, y + 6 * OVER, at + 6 * OVER, y), fill=colour, width=OVER)
    wide = pen.textlength(name, font_size=11 * OVER)
    place = right - wide - taken if fixed else left + taken
    pen.text((place, y - 16 * OVER), name, fill=colour, font_size=11 * OVER)
    return wide + 12.0 * OVER


def _link(
    pen: ImageDraw.ImageDraw,
    view: SceneView,
    frame: _Frame,
    row: int,
    ends: tuple[str, str],
    kind: str,
    hue: Colours,
) -> None:
    """Draw a link between two nodes; it meets a bar above or below the other end's column."""
    if any(end not in view.at for end in ends):
        return
    column = next((frame.columns[end] for end in ends if end in frame.columns), None)
    if column is None:
        column = 0.5 * WIDTH * OVER
    (x1, y1), (x2, y2) = (
        (frame.columns.get(end, column), frame.y(float(view.at[end][row]))) for end in ends
    )
    if LINK_KINDS[kind].symbol != "spring":
        _dashes(pen, x1, y1, x2, y2, hue[BAND])
        return
    turns, wide = 9, 0.6 * frame.size
    along = math.hypot(x2 - x1, y2 - y1) or 1.0
    nx, ny = -(y2 - y1) / along, (x2 - x1) / along
    points = [(x1, y1)]
    for at in range(1, 2 * turns):
        share = at / (2 * turns)
        side = wide * (1 if at % 2 else -1) * (1.0 if 2 < at < 2 * turns - 2 else 0.0)
        points.append((x1 + share * (x2 - x1) + side * nx, y1 + share * (y2 - y1) + side * ny))
    points.append((x2, y2))
    pen.line(points, fill=hue[SOFT], width=OVER)


def _dashes(
    pen: ImageDraw.ImageDraw, x1: float, y1: float, x2: float, y2: float, colour: str
) -> None:
    along = math.hypot(x2 - x1, y2 - y1)
    count = int(along / (6 * OVER))
    for at in range(0, count, 2):
        a, b = at / count, (at + 1) / count
        pen.line(
            (x1 + a * (x2 - x1), y1 + a * (y2 - y1), x1 + b * (x2 - x1), y1 + b * (y2 - y1)),
            fill=colour,
            width=OVER,
        )


def liveliest(view: SceneView | View3d, rows: int) -> int:
    """Return the first of `rows` rows around the largest force on the device."""
    total = sum(np.abs(values) for values in view.efforts.values())
    power = np.concatenate([[0.0], np.cumsum(np.asarray(total, np.float64) ** 2)])
    last = len(power) - 1 - rows
    if last <= 0:
        return 0
    spent = power[rows : rows + last + 1] - power[: last + 1]
    return int(np.argmax(spent))


def write_animation(view: SceneView, path: Path) -> None:
    """Write scene.gif: the whole run, or the liveliest half second of a long one, slowed down."""
    picked, title = pick_rows(view)
    frame = _layout(view, slice(int(picked[0]), int(picked[-1]) + 1))
    save_frames([_draw(view, frame, int(row), title) for row in picked], path)


def pick_rows(view: SceneView | View3d) -> tuple[Ints, str]:
    """Return the rows of an animation's frames, and its slow-motion factor as text."""
    rows = min(len(view.time), max(round(0.5 * view.rig.rate_hz), FRAMES))
    first = liveliest(view, rows)
    picked = np.unique(np.linspace(first, first + rows - 1, FRAMES).astype(int))
    slow = FRAMES * FRAME_MS * 1e-3 * view.rig.rate_hz / rows
    return picked, f"{slow:.3g} times slower,  " if slow > 1.05 else ""


def still_png(view: SceneView | View3d, draw: Callable[[int], Image.Image]) -> bytes:
    """Return the scene at its liveliest row as PNG, without the empty rows above and below."""
    window = max(round(0.002 * view.rig.rate_hz), 1)
    row = min(liveliest(view, window) + window // 2, len(view.time) - 1)
    image = draw(row)
    plain = Image.new("RGB", image.size, image.getpixel((0, 0)))
    inked = ImageChops.difference(image, plain).getbbox() or (0, 0, *image.size)
    room = 10 * OVER
    top, bottom = max(0, inked[1] - room), min(image.height, inked[3] + room)
    buffer = io.BytesIO()
    image.crop((0, top, image.width, bottom)).save(buffer, "PNG")
    return buffer.getvalue()


def still(view: SceneView, dark: bool) -> bytes:
    """Return the scene at its liveliest row as PNG: a frame of the animation."""
    return still_png(view, partial(draw_frame, view, dark=dark))
