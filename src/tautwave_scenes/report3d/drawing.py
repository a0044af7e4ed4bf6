"""A 3D scene as a picture, seen obliquely from above, and as an animation (GIF).

Threads and the skin of tissues turn from grey to orange as they stretch; a contact is drawn as its
ball or plane, on the port or mass that has it. Nearer objects are drawn later. Pillow, as for
scenes of one dimension.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image, ImageColor, ImageDraw

from tautwave.canvas import EDGE, GRID, INK, MASTER, PAPER, SHADE, SLAVE, SOFT
from tautwave.report.figures.envelope import Floats
from tautwave.report.figures.frames import LIGHT, OVER, Colours, ground, save_frames
from tautwave_scenes.models.link_kinds import LINK_KINDS
from tautwave_scenes.networks3d.network import Network3d
from tautwave_scenes.report.drawing import HEIGHT, WIDTH, pick_rows, still_png
from tautwave_scenes.report3d.view import View3d, project

DRAWN = ("spring", "damper")
"""Symbols of links that are threads."""

_MARGIN = 0.07
TALLEST = 2 * WIDTH  # what is taller still is drawn smaller


class _Frame(NamedTuple):
    """Scale from metres to pixels, range of stretch, balls by node, corners of planes.

    `height` is the picture's [pixel of the animation]: a tall scene gets a tall picture.
    `skin` are the triangles of tissues, `rest` their edges [m], `worst` their greatest strain.
    """

    left: float
    low: float
    scale: float
    height: int
    slack: float
    tight: float
    balls: dict[str, float]
    planes: list[Floats]
    skin: list[Triangle]
    rest: dict[frozenset[str], float]
    worst: float

    def pixels(self, seen: Floats) -> tuple[float, float]:
        x = _MARGIN * WIDTH * OVER + (float(seen[0]) - self.left) * self.scale
        y = (self.height - _MARGIN * HEIGHT) * OVER - (float(seen[1]) - self.low) * self.scale
        return x, y


def draw_frame3d(view: View3d, row: int, title: str = "", *, dark: bool = False) -> Image.Image:
    """Return the scene at one row of the recording, `OVER` times as large as in the animation."""
    near = max(round(0.25 * view.rig.rate_hz), 1)
    return _draw(
        view, _layout(view, slice(max(0, row - near), row + near)), row, title, ground(dark)
    )


def write_animation3d(view: View3d, path: Path) -> None:
    """Write scene.gif: the whole run, or the liveliest half second of a long one, slowed down."""
    picked, title = pick_rows(view)
    frame = _layout(view, slice(int(picked[0]), int(picked[-1]) + 1))
    save_frames([_draw(view, frame, int(row), title) for row in picked], path)


def still3d(view: View3d, dark: bool) -> bytes:
    """Return the scene at its liveliest row as PNG."""
    return still_png(view, partial(draw_frame3d, view, dark=dark))


def _used(view: View3d) -> list[str]:
    used = {end for link in view.network.links for end in (link.a, link.b)}
    used |= {node for element in view.network.elements for node in element.corners}
    return [name for name in view.at if name in used]


def _layout(view: View3d, rows: slice) -> _Frame:
    balls = _balls(view)
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for name in _used(view):
        seen = project(view.at[name][rows])[:, :2]
        seen = seen[np.isfinite(seen).all(axis=1)]
        if len(seen):
            ball = balls.get(name, 0.0)
            low = np.minimum(low, seen.min(axis=0) - ball)
            high = np.maximum(high, seen.max(axis=0) + ball)
    if not np.isfinite(low).all():
        low, high = np.zeros(2), np.ones(2)
    planes = [corners for corners in _planes(view, rows) if np.isfinite(corners).all()]
    for corners in planes:
        seen = project(corners)[:, :2]
        low, high = np.minimum(low, seen.min(axis=0)), np.maximum(high, seen.max(axis=0))
    size = np.maximum(high - low, 1e-6)
    height = round(min(max(float(size[1] / size[0]) * WIDTH, HEIGHT), TALLEST))
    margins = 2.0 * _MARGIN * np.array([WIDTH, HEIGHT])
    room = (np.array([WIDTH, height]) - margins) * OVER
    scale = float((room / size).min())
    middle = 0.5 * (low + high) - 0.5 * room / scale
    drawn = [
        _lengths(view, link.a, link.b, rows) - link.rest
        for link in view.network.links
        if LINK_KINDS[link.kind].symbol in DRAWN and link.a in view.at and link.b in view.at
    ]
    stretches = np.concatenate(drawn) if drawn else np.zeros(1)
    stretches = stretches[np.isfinite(stretches)]
    slack, tight = (float(stretches.min()), float(stretches.max())) if len(stretches) else (0, 0)
    skin = [corners for corners in surface_of(view.network) if view.at.keys() >= set(corners)]
    rest = edges_at_rest(view.network)
    cut = {name: view.at[name][rows] for corners in skin for name in corners}
    strains = [float(np.nanmax(strain_of(corners, cut, rest))) for corners in skin]
    return _Frame(
        *(float(middle[0]), float(middle[1]), scale, height, slack, tight, balls, planes),
        *(skin, rest, max(strains, default=0.0)),
    )


def _lengths(view: View3d, a: str, b: str, rows: slice) -> Floats:
    return np.asarray(np.linalg.norm(view.at[a][rows] - view.at[b][rows], axis=1))


def _balls(view: View3d) -> dict[str, float]:
    """Return the radii of nodes drawn as balls: the port of a contact, or half each."""
    ports = {port.name for port in view.network.ports}
    radii: dict[str, float] = {}
    for link in view.network.links:
        if LINK_KINDS[link.kind].one_way and link.normal is None and not link.solid:
            hands = [end for end in (link.a, link.b) if end in ports]
            for end in hands or (link.a, link.b):
                radius = link.rest if hands else 0.5 * link.rest
                radii[end] = max(radii.get(end, 0.0), radius)
    return radii


FACES_DRAWN = 300
"""Triangles of a solid that are drawn; of more, some."""


def _planes(view: View3d, rows: slice) -> list[Floats]:
    """Return the corners of a square piece of every plane, as wide as what moves over it."""
    planes: list[Floats] = []
    known: set[tuple[str, tuple[float, float, float]]] = set()
    for link in view.network.links:
        if link.normal is None or link.b not in view.at or (link.b, link.normal) in known:
            continue
        known.add((link.b, link.normal))
        way = np.array(link.normal) / np.linalg.norm(link.normal)
        where = np.concatenate([view.at[name][rows] for name in _used(view)])
        where = where[np.isfinite(where).all(axis=1)]
        middle = where.mean(axis=0)
        middle = middle - way * float((middle - view.at[link.b][rows][0]) @ way - link.rest)
        side = np.cross(way, [0.0, 1.0, 0.0] if abs(way[1]) < 0.9 else [1.0, 0.0, 0.0])
        side /= np.linalg.norm(side)
        off = where - middle
        across = off - np.outer(off @ way, way)
        size = float(max(np.abs(across).max(), 0.15 * np.abs(off).max())) or 1e-3
        other = np.cross(way, side)
        corners = [(1, 1), (1, -1), (-1, -1), (-1, 1)]
        planes.append(np.array([middle + size * (i * side + j * other) for i, j in corners]))
    for _, solid in view.network.solids:
        thin = max(1, len(solid.triangles) // FACES_DRAWN)
        planes += [np.array([solid.points[at] for at in one]) for one in solid.triangles[::thin]]
    return planes


def _draw(view: View3d, frame: _Frame, row: int, title: str, hue: Colours = LIGHT) -> Image.Image:
    image = Image.new("RGB", (WIDTH * OVER, frame.height * OVER), hue[PAPER])
    slack, tight = ImageColor.getrgb(hue[SHADE]), ImageColor.getrgb(hue[SLAVE])
    pen = ImageDraw.Draw(image)
    for corners in frame.planes:
        pen.polygon([frame.pixels(seen) for seen in project(corners)], fill=hue[GRID])
    seen = {name: project(view.at[name][row]) for name in _used(view)}
    seen = {name: place for name, place in seen.items() if np.isfinite(place).all()}
    shapes: list[tuple[float, str, tuple[str, ...], float]] = []
    for link in view.network.links:
        if LINK_KINDS[link.kind].symbol in DRAWN and link.a in seen and link.b in seen:
            stretch = _lengths(view, link.a, link.b, slice(row, row + 1))[0] - link.rest
            share = (float(stretch) - frame.slack) / ((frame.tight - frame.slack) or 1.0)
            share = min(max(share, 0.0), 1.0)
            nearness = 0.5 * float(seen[link.a][2] + seen[link.b][2])
            shapes.append((nearness, "link", (link.a, link.b), share))
    shapes += [
        (0.5 * float(seen[one][2] + seen[two][2]), "tool", (one, two), 0.0)
        for tool in view.network.tools
        for (one, _), (two, _) in itertools.pairwise(tool.points)
        if one in seen and two in seen
    ]
    now = {name: view.at[name][row : row + 1] for face in frame.skin for name in face}
    for face in frame.skin:
        if seen.keys() >= set(face):
            share = float(strain_of(face, now, frame.rest)[0]) / (frame.worst or 1.0)
            nearness = sum(float(seen[name][2]) for name in face) / 3.0
            shapes.append((nearness, "skin", face, min(share, 1.0)))
    inside = {name for face in frame.skin for name in face}
    shapes += [
        (float(place[2]), "node", (name,), 0.0)
        for name, place in seen.items()
        if name not in inside
    ]
    ports = {port.name for port in view.network.ports}
    fixed = {name for name, _ in view.network.grounds}
    # A knot is a point: draw it small, so that knots do not hide the ball.
    dot = max(1.2, min(2.4, 12.0 / math.sqrt(max(len(seen), 1)))) * OVER
    for _, kind, names, share in sorted(shapes):
        ends = [frame.pixels(seen[name]) for name in names]
        if kind in ("link", "skin"):
            colour = tuple(
                round(one + share * (two - one)) for one, two in zip(slack, tight, strict=True)
            )
        if kind == "skin":
            pen.polygon(ends, fill=colour, outline=hue[EDGE], width=OVER)
            continue
        if kind == "tool":
            pen.line(ends, fill=hue[MASTER], width=4 * OVER)
            continue
        if kind == "link":
            pen.line(ends, fill=colour, width=round(1.5 * OVER))
            continue
        (x, y), name = ends[0], names[0]
        if name in fixed:
            half = 0.6 * dot
            pen.rectangle((x - half, y - half, x + half, y + half), fill=hue[EDGE])
            continue
        radius = max(frame.balls.get(name, 0.0) * frame.scale, dot)
        fill = hue[MASTER] if name in ports else hue[SLAVE]
        box = (x - radius, y - radius, x + radius, y + radius)
        pen.ellipse(box, fill=fill, outline=hue[INK], width=OVER)
        if radius > 6.0 * OVER:  # a highlight at the upper left makes a disc look like a ball
            shine = tuple(round(0.6 * part + 0.4 * 255) for part in ImageColor.getrgb(fill))
            x, y, radius = x - 0.35 * radius, y - 0.35 * radius, 0.3 * radius
            pen.ellipse((x - radius, y - radius, x + radius, y + radius), fill=shine)
    for name in frame.balls:  # its outline over everything in front of it
        if name in ports and name in seen:
            (x, y), radius = frame.pixels(seen[name]), max(frame.balls[name] * frame.scale, dot)
            box = (x - radius, y - radius, x + radius, y + radius)
            pen.ellipse(box, outline=hue[INK], width=OVER)
    caption = f"{title}{view.time[row]:.4f} s"
    place = (0.01 * WIDTH * OVER, (frame.height - 0.07 * HEIGHT) * OVER)
    pen.text(place, caption, fill=hue[SOFT], font_size=13 * OVER)
    return image


Triangle = tuple[str, str, str]


def surface_of(network: Network3d) -> list[Triangle]:
    """Return the triangles of all tissues that belong to one element only."""
    seen: dict[frozenset[str], Triangle | None] = {}
    for element in network.elements:
        for corners in itertools.combinations(element.corners, 3):
            key = frozenset(corners)
            seen[key] = None if key in seen else corners
    return [triangle for triangle in seen.values() if triangle is not None]


def edges_at_rest(network: Network3d) -> dict[frozenset[str], float]:
    """Return the length of each edge of a tissue without stress [m]."""
    lengths: dict[frozenset[str], float] = {}
    for element in network.elements:
        for (one, a), (two, b) in itertools.combinations(
            zip(element.corners, element.rest, strict=True), 2
        ):
            lengths[frozenset((one, two))] = float(np.linalg.norm(np.subtract(a, b)))
    return lengths


def strain_of(
    triangle: Triangle, at: Mapping[str, Floats], rest: Mapping[frozenset[str], float]
) -> Floats:
    """Return the greatest stretch of a triangle's edges over time, as a share of their length."""
    shares = [
        np.linalg.norm(at[one] - at[two], axis=1) / rest[frozenset((one, two))] - 1.0
        for one, two in itertools.combinations(triangle, 2)
    ]
    return np.asarray(np.abs(shares).max(axis=0))
