"""The states of an operated rig, drawn from their table: `python docs/_tools/states.py`."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

from tautwave.runtime.operate.states import (
    ALIGNING,
    CLUTCHED,
    ENGAGED,
    FAULT,
    HOLDING,
    IDLE,
    PARTED,
    SCALE,
    STATES,
    STOP,
    STOPPING,
    TRANSITIONS,
)

PICTURE = Path(__file__).parents[1] / "_static" / "states.svg"

PLACES = {
    IDLE: (110, 70),
    ALIGNING: (440, 70),
    ENGAGED: (900, 70),
    HOLDING: (440, 380),
    CLUTCHED: (630, 152),
    STOPPING: (110, 380),
}
COLOURS = """<style>
svg { --paper: #fff; --box: #e7f0fb; --engaged: #d8f0dd; --edge: #345; --ink: #222; --line: #555; }
@media (prefers-color-scheme: dark) {
  svg { --paper: #131416; --box: #16283b; --engaged: #17352a; --edge: #6ba5dd; --ink: #e6e6e6;
    --line: #a3a9b0; }
}
</style>"""
WIDE, HIGH = 130, 44
BESIDE = {
    (IDLE, ALIGNING): 9.0,
    (ALIGNING, IDLE): 9.0,
    (ALIGNING, ENGAGED): 0.0,
    (ALIGNING, HOLDING): 30.0,
    (HOLDING, ALIGNING): 30.0,
    (ENGAGED, CLUTCHED): 0.0,
    (CLUTCHED, ALIGNING): 0.0,
    (ENGAGED, HOLDING): -1.0,
    (CLUTCHED, HOLDING): 0.0,
    (IDLE, HOLDING): 9.0,
    (HOLDING, IDLE): 9.0,
}
"""How far an arrow is to the right of the line between two states, seen along it."""

SHARES = {
    (IDLE, HOLDING): 0.6,
    (HOLDING, IDLE): 0.3,
    (ALIGNING, HOLDING): 0.25,
    (ENGAGED, HOLDING): 0.45,
    (HOLDING, ALIGNING): 0.62,
}
"""Where along an arrow its label is; else in the middle."""


def drawing() -> str:
    """Return the picture as SVG."""
    words: dict[tuple[str, str], list[str]] = defaultdict(list)
    for (state, word), after in TRANSITIONS.items():
        if word not in (STOP, FAULT, SCALE, PARTED) and (state, after) != (CLUTCHED, IDLE):
            words[state, after].append(word)
    parts = [
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1000 470" font-family="sans-serif"'
        ' font-size="13" role="img" aria-label="States of an operated rig">',
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="8"'
        ' markerHeight="8" orient="auto">'
        '<path d="M0 0L8 4L0 8z" fill="var(--line)"/></marker></defs>',
        COLOURS,
        '<rect width="1000" height="470" fill="var(--paper)"/>',
    ]
    for (one, two), named in words.items():
        half = (len(named) + 1) // 2 if len(named) > 2 else len(named)
        rows = [f"{', '.join(named[:half])},", ", ".join(named[half:])]
        rows = rows if named[half:] else [rows[0].rstrip(",")]
        parts.append(_arrow(one, two, rows))
    for state in STATES:
        x, y = PLACES[state]
        fill = "var(--box)" if state != ENGAGED else "var(--engaged)"
        parts.append(
            f'<rect x="{x - WIDE / 2:g}" y="{y - HIGH / 2:g}" width="{WIDE}" height="{HIGH}"'
            f' rx="8" fill="{fill}" stroke="var(--edge)"/>'
            f'<text x="{x}" y="{y + 5}" text-anchor="middle" fill="var(--ink)">{state}</text>'
        )
    parts.append(
        '<text x="45" y="424" fill="var(--ink)">stop: from every state to stopping</text>'
        '<text x="375" y="424" fill="var(--ink)">'
        "fault: from every state but stopping to holding</text>"
        '<text x="375" y="442" fill="var(--ink)">rest: from clutched to idle, too</text>'
        '<text x="375" y="458" fill="var(--ink)">'
        "scale: stays; parted: from engaged to aligning</text>"
        "</svg>"
    )
    return "\n".join(parts) + "\n"


def _arrow(one: str, two: str, label: list[str]) -> str:
    (ax, ay), (bx, by) = PLACES[one], PLACES[two]
    length = ((bx - ax) ** 2 + (by - ay) ** 2) ** 0.5
    ux, uy = (bx - ax) / length, (by - ay) / length
    nx, ny = -uy * BESIDE[one, two], ux * BESIDE[one, two]
    steps = [k for k in range(int(length)) if not _inside(one, ax + nx + k * ux, ay + ny + k * uy)]
    steps = [k for k in steps if not _inside(two, ax + nx + k * ux, ay + ny + k * uy)]
    x1, y1, x2, y2 = (
        base + side + k * way
        for k in (steps[0], steps[-1])
        for base, side, way in ((ax, nx, ux), (ay, ny, uy))
    )
    share = SHARES.get((one, two), 0.5)
    tx, ty = x1 + share * (x2 - x1), y1 + share * (y2 - y1)
    level = uy == 0.0
    anchor = "middle" if level else "start" if nx > 0.0 or (nx == 0.0 and ux >= 0.0) else "end"
    tx += 0.0 if level else 7.0 if anchor == "start" else -7.0
    ty += (-6.0 if ux < 0.0 or ny == 0.0 else 16.0) if level else 4.0
    rows = "".join(
        f'<tspan x="{tx:.1f}" dy="{"1.2em" if row else "0"}">{text}</tspan>'
        for row, text in enumerate(label)
    )
    return (
        f'<path d="M{x1:.1f} {y1:.1f}L{x2:.1f} {y2:.1f}" stroke="var(--line)" fill="none"'
        f' marker-end="url(#tip)"/><text x="{tx:.1f}" y="{ty:.1f}" text-anchor="{anchor}"'
        f' fill="var(--ink)" stroke="var(--paper)" stroke-width="4" paint-order="stroke">'
        f"{rows}</text>"
    )


def _inside(state: str, x: float, y: float) -> bool:
    """Return whether a point is in the box of a state."""
    cx, cy = PLACES[state]
    return abs(x - cx) <= WIDE / 2 and abs(y - cy) <= HIGH / 2


if __name__ == "__main__":
    PICTURE.write_text(drawing(), encoding="utf-8")
