"""A hand that moves smoothly to a place and trembles there: noise in a band of a few hertz."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence

from pydantic import Field

from tautwave.plugin import HandPart, HandPlugin

SINES = 12


class TremorKeys(HandPart):
    """Where the hand wants to be, and how it trembles."""

    position: float = Field(description="[rad | m] Where it wants to be in the end.")
    after_s: float = Field(default=1.0, gt=0, description="[s] How long it takes to get there.")
    amplitude: float = Field(ge=0, description="[rad | m] Of the tremor, root mean square.")
    lowest_hz: float = Field(default=8.0, gt=0, description="[Hz] Lower end of its band.")
    highest_hz: float = Field(default=12.0, gt=0, description="[Hz] Upper end of its band.")


def motion(keys: TremorKeys, times: Sequence[float], seed: tuple[int, ...]) -> list[float]:
    """Return the wanted positions [rad or m] at the times [s]; alike for the same seed."""
    draw = random.Random(repr(seed))
    sines = [
        (2.0 * math.pi * draw.uniform(keys.lowest_hz, keys.highest_hz), draw.uniform(0.0, math.tau))
        for _ in range(SINES)
    ]
    size = keys.amplitude * math.sqrt(2.0 / SINES)
    wanted = []
    for time in times:
        share = min(time / keys.after_s, 1.0)
        smooth = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        tremor = math.fsum(math.sin(omega * time + phase) for omega, phase in sines)
        wanted.append(smooth * (keys.position + size * tremor))
    return wanted


plugin = HandPlugin("smooth move with a tremor in a band", TremorKeys, motion)
