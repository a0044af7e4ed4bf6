"""The scene as a picture of masses, springs and bars, and as an animation (GIF).

One column a mass, side by side; height is position. Ports and grounds are bars over the columns
they are linked to, springs zigzags, contacts thin dashed lines. Drawn with Pillow, which comes with
matplotlib: a hundred frames take a second.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageChops, ImageDraw

from tautwave.report.scene_view import SceneView

if TYPE_CHECKING:
    from tautwave.report.space_view import SpaceView

Ints = npt.NDArray[np.int64]
WIDTH, HEIGHT = 480, 320
OVER = 2  # drawn twice as large, then scaled down: smooth edges
FRAMES = 90
FRAME_MS = 50
_INK, _BAR, _GROUND, _MASS, _LINK, _TEXT = (
    "#222222",
    "#0072B2",
    "#767676",
    "#D55E00",
    "#56697A",
    "#555555",
)
ZIGZAG = ("spring", "nonlinear", "plastic")
_LEFT, _RIGHT, _TOP, _BOTTOM = 0.08, 0.97, 0.08, 0.9


class _Frame(NamedTuple):
    """Where nodes are drawn: column of each mass, and the scale of heights."""

    columns: dict[str, float]
    low: float
    high: float

    def y(self, place: float) -> float:
        share = min(max((place - self.low) / (self.high - self.low), 0.0), 1.0)
        return HEIGHT * OVER * (_BOTTOM - share * (_BOTTOM - _TOP))


def _layout(view: SceneView, rows: slice) -> _Frame:
    """Return the columns, and heights that hold everything in these rows."""
    moving = [name for name in view.at if name not in view.network.ports]
    fixed = {name for name, _ in view.network.grounds}
    moving = [name for name in moving if name not in fixed]
    # A bow passes by: only what is held by a spring or a contact has a height that matters.
    held = {end for link in view.network.links if link.stiffness for end in (link.a, link.b)}
    held |= set(moving)
    shown = [view.at[name][rows] for name in view.at if name in held]
    low = min(float(values.min()) for values in shown)
    high = max(float(values.max()) for values in shown)
    gap = 0.12 * (high - low) or 1e-3
    step = (_RIGHT - _LEFT) / max(len(moving), 1)
    columns = {name: WIDTH * OVER * (_LEFT + step * (at + 0.5)) for at, name in enumerate(moving)}
    for string in view.network.strings:
        share = string.near / (string.near + string.far)
        columns[string.name] = WIDTH * OVER * (_LEFT + share * (_RIGHT - _LEFT))
    return _Frame(columns, low - gap, high + gap)


def draw_frame(view: SceneView, row: int, title: str = "") -> Image.Image:
    """Return the scene at one row of the recording, `OVER` times as large as in the animation."""
    near = max(round(0.25 * view.rig.rate_hz), 1)
    rows = slice(max(0, row - near), row + near)
    return _draw(view, _layout(view, rows), row, title)


def _draw(view: SceneView, frame: _Frame, row: int, title: str) -> Image.Image:
    image = Image.new("RGB", (WIDTH * OVER, HEIGHT * OVER), "white")
    pen = ImageDraw.Draw(image)
    size = max(3.0, min(11.0, 120.0 / max(len(frame.columns), 1))) * OVER
    fixed = {name for name, _ in view.network.grounds}
    for link in view.network.links:
        _link(pen, view, frame, row, (link.a, link.b), link.kind, size)
    used = {end for link in view.network.links for end in (link.a, link.b)}
    for name in (*view.network.ports, *fixed):
        if name not in view.at or name not in used:
            continue
        y = frame.y(float(view.at[name][row]))
        _bar(pen, name, y, ground=name in fixed)
    for string in view.network.strings:
        point = (frame.columns[string.name], frame.y(float(view.at[string.name][row])))
        rest = frame.y(0.0)
        ends = (_LEFT * WIDTH * OVER, rest), (_RIGHT * WIDTH * OVER, rest)
        pen.line((ends[0], point, ends[1]), fill=_MASS, width=2 * OVER)
    for name, x in frame.columns.items():
        y = frame.y(float(view.at[name][row]))
        pen.ellipse((x - size, y - size, x + size, y + size), fill=_MASS, outline=_INK, width=OVER)
    words = f"{title}{view.time[row]:.4f} s"
    pen.text((0.01 * WIDTH * OVER, 0.93 * HEIGHT * OVER), words, fill=_TEXT, font_size=13 * OVER)
    return image


def _bar(pen: ImageDraw.ImageDraw, name: str, y: float, *, ground: bool) -> None:
    left, right = 0.03 * WIDTH * OVER, _RIGHT * WIDTH * OVER
    colour = _GROUND if ground else _BAR
    pen.line((left, y, right, y), fill=colour, width=(2 if ground else 5) * OVER)
    if ground:
        step = 12 * OVER
        for at in range(int(left), int(right), step):
            pen.line((at, y + 6 * OVER, at + 6 * OVER, y), fill=colour, width=OVER)
    pen.text((left, y - 16 * OVER), name, fill=colour, font_size=11 * OVER)


def _link(
    pen: ImageDraw.ImageDraw,
    view: SceneView,
    frame: _Frame,
    row: int,
    ends: tuple[str, str],
    kind: str,
    size: float,
) -> None:
    """Draw a link between two nodes; a bar is met above or below the other end's column."""
    if any(end not in view.at for end in ends):
        return
    column = next((frame.columns[end] for end in ends if end in frame.columns), None)
    if column is None:
        column = 0.5 * WIDTH * OVER
    (x1, y1), (x2, y2) = (
        (frame.columns.get(end, column), frame.y(float(view.at[end][row]))) for end in ends
    )
    if kind not in ZIGZAG:
        _dashes(pen, x1, y1, x2, y2)
        return
    turns, wide = 9, 0.6 * size
    along = math.hypot(x2 - x1, y2 - y1) or 1.0
    nx, ny = -(y2 - y1) / along, (x2 - x1) / along
    points = [(x1, y1)]
    for at in range(1, 2 * turns):
        share = at / (2 * turns)
        side = wide * (1 if at % 2 else -1) * (1.0 if 2 < at < 2 * turns - 2 else 0.0)
        points.append((x1 + share * (x2 - x1) + side * nx, y1 + share * (y2 - y1) + side * ny))
    points.append((x2, y2))
    pen.line(points, fill=_LINK, width=OVER)


def _dashes(pen: ImageDraw.ImageDraw, x1: float, y1: float, x2: float, y2: float) -> None:
    along = math.hypot(x2 - x1, y2 - y1)
    count = int(along / (6 * OVER))
    for at in range(0, count, 2):
        a, b = at / count, (at + 1) / count
        pen.line(
            (x1 + a * (x2 - x1), y1 + a * (y2 - y1), x1 + b * (x2 - x1), y1 + b * (y2 - y1)),
            fill="#A9B4BC",
            width=OVER,
        )


def liveliest(view: SceneView | SpaceView, rows: int) -> int:
    """Return the first of the `rows` rows in which the device felt most."""
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


def pick_rows(view: SceneView | SpaceView) -> tuple[Ints, str]:
    """Return the rows of an animation's frames, and how much it is slowed down in words."""
    rows = min(len(view.time), max(round(0.5 * view.rig.rate_hz), FRAMES))
    first = liveliest(view, rows)
    picked = np.unique(np.linspace(first, first + rows - 1, FRAMES).astype(int))
    slow = FRAMES * FRAME_MS * 1e-3 * view.rig.rate_hz / rows
    return picked, f"{slow:.3g} times slower,  " if slow > 1.05 else ""


def still_png(view: SceneView | SpaceView, draw: Callable[[int], Image.Image]) -> bytes:
    """Return the scene at its liveliest row as PNG, without the empty rows above and below."""
    window = max(round(0.002 * view.rig.rate_hz), 1)
    row = min(liveliest(view, window) + window // 2, len(view.time) - 1)
    image = draw(row)
    inked = ImageChops.invert(image.convert("L")).getbbox() or (0, 0, *image.size)
    room = 10 * OVER
    top, bottom = max(0, inked[1] - room), min(image.height, inked[3] + room)
    buffer = io.BytesIO()
    image.crop((0, top, image.width, bottom)).save(buffer, "PNG")
    return buffer.getvalue()


def save_frames(drawn: Sequence[Image.Image], path: Path) -> None:
    """Write frames as a GIF with one palette."""
    small = [image.reduce(OVER) for image in drawn]
    palette, plain = _palette(small), Image.Dither.NONE
    images = [image.quantize(palette=palette, dither=plain) for image in small]
    images[0].save(path, save_all=True, append_images=images[1:], duration=FRAME_MS, loop=0)


def _palette(drawn: Sequence[Image.Image]) -> Image.Image:
    """Return the colours of a few frames: in every one are the same things."""
    some = drawn[:: max(1, len(drawn) // 4)]
    strip = Image.new("RGB", (WIDTH, HEIGHT * len(some)))
    for at, image in enumerate(some):
        strip.paste(image, (0, HEIGHT * at))
    found = np.array(strip.quantize(32, dither=Image.Dither.NONE).getpalette()).reshape(-1, 3)
    found[found.min(axis=1) > 244] = 255  # the mean of white and next to white
    palette = Image.new("P", (1, 1))
    palette.putpalette(found.ravel().tolist())
    return palette
