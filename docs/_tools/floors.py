"""Picture of the floors, drawn from the import contracts: each row may import what is below it."""

from __future__ import annotations

import tomllib
from html import escape
from pathlib import Path

PYPROJECT = Path(__file__).parents[2] / "pyproject.toml"
WIDTH, ROW, GAP, MARGIN = 920, 34, 8, 12
PER_LETTER, PADDING = 7.4, 16
"""Width of a letter and around a name, in pixels at 12 px."""


def floors() -> list[list[str]]:
    """Return the rooms of `tautwave` by floor, the highest first, as the contract has them."""
    contracts = tomllib.loads(PYPROJECT.read_text())["tool"]["importlinter"]["contracts"]
    (layers,) = [one["layers"] for one in contracts if one["id"] == "floors"]
    return [[room.strip(" ()") for room in layer.replace(":", "|").split("|")] for layer in layers]


def floors_svg() -> str:
    """Return the picture: a row for each floor, a box for each room."""
    rows = floors()
    height = 2 * MARGIN + len(rows) * (ROW + GAP) - GAP
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" '
        f'width="{WIDTH}" height="{height}" font-family="sans-serif" font-size="12">',
        f'<rect width="{WIDTH}" height="{height}" fill="#ffffff"/>',
    ]
    for at, rooms in enumerate(rows):
        y = MARGIN + at * (ROW + GAP)
        sizes = [PER_LETTER * len(room) + PADDING for room in rooms]
        spare = (WIDTH - 2 * MARGIN - GAP * (len(rooms) - 1) - sum(sizes)) / len(rooms)
        x = float(MARGIN)
        for room, size in zip(rooms, sizes, strict=True):
            wide = size + spare
            parts.append(
                f'<rect x="{x:.1f}" y="{y}" width="{wide:.1f}" height="{ROW}" rx="4" '
                'fill="#eef2f7" stroke="#5b6b7f"/>'
                f'<text x="{x + wide / 2:.1f}" y="{y + ROW / 2 + 4:.1f}" text-anchor="middle" '
                f'fill="#1d2733">{escape(room)}</text>'
            )
            x += wide + GAP
    return "\n".join([*parts, "</svg>\n"])
