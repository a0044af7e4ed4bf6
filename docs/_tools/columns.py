"""The page of a recording's columns; a test holds it against every shipped rig."""

from __future__ import annotations

from _tools.markdown import table
from tautwave.report.columns import sections


def columns_page() -> str:
    """Return the page."""
    parts = [
        "# Row columns\n",
        "One row is recorded per cycle. `read_recording` gives each column as a NumPy array;"
        " Foxglove and PlotJuggler show the same names as topics. SIDE is `master` or `slave`,"
        " ARM that or, of several, such as `slave.left`; AXIS, PAIR, PORT and NODE are names of the rig. Units follow the axis, rotary first."
        " A rig records only the columns of what it has.\n",
    ]
    for title, columns in sections().items():
        parts.append(f"## {title}\n")
        parts.append(
            table(
                ("column", "unit", "meaning"), [(f"`{c.name}`", c.unit, c.meaning) for c in columns]
            )
        )
    return "\n".join(parts)
