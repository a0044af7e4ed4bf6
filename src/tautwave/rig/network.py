"""The network between both sides of a rig: what is recorded of it, and how long it takes."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tautwave import registry
from tautwave.config import Link, Rig
from tautwave.config.guard import read_guarded
from tautwave.config.keys.common import AUTO
from tautwave.errors import ConfigError
from tautwave.link.trace import LARGEST, parse_trace

LATE = 0.99
"""Share of packets that an `auto` depth waits for."""


class LineDelay(NamedTuple):
    """Where the time between both sides goes, in slots: on the way, and waiting to be played out.

    `exact`: it is a constant line's; else what is to be expected of a network.
    """

    way: int
    play_out: int
    exact: bool

    @property
    def samples(self) -> int:
        """Return both together."""
        return self.way + self.play_out


def trace_of(link: Link) -> list[float]:
    """Return the recorded network of a link as `link.trace` has it; nothing if it is drawn.

    Raises
    ------
    ConfigError
        The file cannot be read, or is not a trace.
    """
    return [] if link.trace is None else list(_trace(link.trace))


@lru_cache(maxsize=8)
def _trace(file: str) -> tuple[float, ...]:
    try:
        text = read_guarded(Path(file), "network trace", LARGEST)
    except ConfigError as err:
        raise ConfigError(f"link.trace: {err}") from err
    return tuple(parse_trace(text, file))


def line_delay(rig: Rig) -> LineDelay:
    """Return the delay each way between both sides, in slots."""
    link = rig.link
    if link is None:
        return LineDelay(rig.delay_samples, 0, True)
    least, mean, late = lateness(link)
    period = rig.period_s
    way = max(1, int(np.ceil(least / period - 1e-9)))
    waves = registry.load_coupling(rig.coupling.law).carries == "waves"
    if link.play_out == "newest" or not waves:
        return LineDelay(way + round(mean / period), 0, False)
    depth = min(late, link.deepest_s) if link.depth_s == AUTO else float(link.depth_s)
    return LineDelay(way, round(depth / period), False)


def lateness(link: Link) -> tuple[float, float, float]:
    """Return of a network the least delay, and mean and 99th percentile beyond it [s]."""
    trace = np.array(trace_of(link)[1::2])
    if len(trace):
        delays = 1e-9 * trace[trace >= 0.0]
        if len(delays) == 0:
            return 0.0, 0.0, 0.0
        least = float(delays.min())
        return least, float(delays.mean()) - least, float(np.quantile(delays, LATE)) - least
    tail = -float(np.log(1.0 - LATE))
    kinds = {"uniform": (0.5, LATE), "exponential": (1.0, tail), "spikes": (0.02, 1.0)}
    mean, late = kinds[link.jitter]
    return link.delay_s, mean * link.jitter_s, late * link.jitter_s
