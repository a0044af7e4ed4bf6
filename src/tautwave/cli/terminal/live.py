"""A live run as lines of text: one per pair, the loop's health, what was said last. 80 columns."""

from __future__ import annotations

import math
import os
import textwrap
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

from tautwave.cli.terminal.show import printable
from tautwave.config.guard import parse_json
from tautwave.runtime.operate.states import STATES
from tautwave.runtime.tap import Live

HEAD = f"{'pair':<14}{'master':>11}{'slave':>11}{'error':>11}{'effort':>13}  state"
NAME = 14


class Health(NamedTuple):
    """Of the rows since the last look: greatest lateness [us], skipped slots so far."""

    late_us: float = 0.0
    skipped: int = 0


def watch_health(rows: Sequence[Sequence[float]], live: Live, before: Health) -> Health:
    """Return the loop's health after some more rows."""
    late, skipped = (live.columns.index(name) for name in ("lateness_us", "skipped_slots"))
    return Health(
        max((row[late] for row in rows), default=before.late_us),
        before.skipped + sum(round(row[skipped]) for row in rows),
    )


def live_lines(row: Sequence[float], live: Live, health: Health, missed: int) -> list[str]:
    """Return what is shown of a row: a headline, a line a pair, the loop.

    Positions in the pair's own units, effort as commanded to the master [N m or N], at a slave's
    site to the slave.
    """
    values = dict(zip(live.columns, row, strict=True))
    units: Mapping[str, Any] = live.facts.get("units", {})
    state = values.get("operation.state")
    word = "engaged" if state is None else STATES[int(state)]
    word = "no other site" if values.get("link.holding") else word
    lines = [HEAD]
    for name, unit in units.items():
        ends = [f"{side}.{name}" for side in ("master", "slave")]
        lost = [end for end in ends if not values.get(f"{end}.valid", 1.0)]
        places = [_number(values.get(f"{end}.position")) for end in ends]
        error = _number(values.get(f"{name}.position_error"))
        own = ends[0] if f"{ends[0]}.commanded" in values else ends[1]  # of one of two sites
        effort = _number(values.get(f"{own}.commanded"))
        force = "N m" if unit == "rad" else "N"
        shown = word if not lost else f"no sample of {lost[0].partition('.')[0]}"
        lines.append(
            f"{_short(name):<{NAME}}{places[0]:>7} {unit:<3}{places[1]:>7} {unit:<3}"
            f"{error:>7} {unit:<3}{effort:>9} {force:<3}  {shown}"
        )
    episode = int(values.get("operation.episode", 0.0))
    parts = [
        f"{values['time_s']:.1f} s",
        f"{live.rate_hz:g} Hz",
        f"late up to {1e-3 * health.late_us:.2f} ms",
        f"{health.skipped} slots skipped",
    ]
    parts += [f"episode {episode}"] if episode else []
    parts += [f"{missed} rows not seen"] if missed else []
    lines.append("loop  " + ", ".join(parts))
    return [line[:80].rstrip() for line in lines]


def news_lines(news: str, columns: int = 80) -> list[str]:
    """Return the newest of the journal's entries in `news` [JSON], in two lines at most.

    Why a command was refused, or what a fault is, has to be seen where the key was pressed.
    """
    try:
        *_, (_, entry) = parse_json(news)
        at_s, word, source, text = (entry[key] for key in ("at_s", "word", "source", "text"))
    except (ValueError, KeyError, TypeError):
        return []
    if not text:
        text = f"{word} by {source}"
    elif not text.startswith(word):
        text = f"{word}: {text}"
    return textwrap.wrap(
        printable(f"last  {at_s:.1f} s, {text}"),
        max(columns, 20),
        subsequent_indent="      ",
        max_lines=2,
        placeholder=" ...",
    )


def room(descriptor: int) -> tuple[int, int]:
    """Return the columns and lines of a terminal; a pipe or file has room for everything."""
    with suppress(OSError):
        columns, lines = os.get_terminal_size(descriptor)
        if columns > 0 and lines > 1:
            return columns, lines - 1
    return 80, 1_000


def _number(value: float | None) -> str:
    if value is None or not math.isfinite(value):
        return "-"
    return f"{value:+.3f}" if abs(value) < 100.0 else f"{value:+.3g}"


def _short(name: str) -> str:
    return name if len(name) < NAME else f"{name[: NAME - 2]}~"
