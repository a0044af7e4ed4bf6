"""Recorded networks: the CSV of `tautwave link test --record`, as the numbers of a table.

Columns: `time_s` since the first packet, `delay_s`, `lost` (0 or 1), times rising.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from tautwave.errors import ConfigError
from tautwave.models.network import LOST

HEADER = "time_s,delay_s,lost"
LARGEST = 64 * 1024 * 1024
"""[bytes] Of a trace: 40 minutes at 1 kHz."""
LATEST_S = 9e6
"""A hundred days: whole nanoseconds of it are exact in the table."""


def parse_trace(text: str, name: str) -> list[float]:
    """Return pairs of time and delay [ns], LOST for a lost packet, one after the other.

    Raises
    ------
    ConfigError
        A line is none of a trace; `name` is the file's.
    """
    lines = text.splitlines()
    if not lines or lines[0].strip() != HEADER:
        raise ConfigError(f"{name}: the first line of a trace is {HEADER}")
    pairs: list[float] = []
    for number, line in enumerate(lines[1:], 2):
        try:
            at, delay, lost = (float(part) for part in line.split(","))
        except ValueError as err:
            raise ConfigError(f"{name}:{number}: a line has three numbers: {HEADER}") from err
        if not (math.fabs(at) <= LATEST_S and 0.0 <= delay <= 60.0 and lost in (0.0, 1.0)):
            raise ConfigError(
                f"{name}:{number}: a time is {LATEST_S:.0e} s at most, a delay 0 to 60 s, and lost "
                f"0 or 1 (got {line.strip()[:80]})"
            )
        if pairs and round(1e9 * at) <= pairs[-2]:
            raise ConfigError(f"{name}:{number}: times must increase")
        pairs += [round(1e9 * at), LOST if lost else round(1e9 * delay)]
    if len(pairs) < 4:
        raise ConfigError(f"{name}: a trace needs at least two packets")
    return pairs


def replayed(table: Sequence[float], at: int, count: int, now_ns: int) -> int:
    """Return the arrival [ns] of a packet as a trace has it, LOST for none.

    Parameters
    ----------
    table : sequence of float
        Holds the trace: pairs of time and delay [ns], times rising.
    at, count : int
        First index, and number of pairs, at least two.
    now_ns : int
        When the packet leaves [ns]. The trace counts from its first time, and begins again after
        its last, which lasts as long as the one before.
    """
    first = int(table[at])
    last = int(table[at + 2 * count - 2])
    whole = last - first + last - int(table[at + 2 * count - 4])
    since = first + now_ns % whole
    low = 0
    high = count
    while high - low > 1:
        middle = (low + high) // 2
        if table[at + 2 * middle] <= since:
            low = middle
        else:
            high = middle
    delay = int(table[at + 2 * low + 1])
    if delay == LOST:
        return LOST
    return now_ns + delay
