"""Pictures without a camera: a bar that crosses once a second of CLOCK_MONOTONIC."""

from __future__ import annotations

import time

import numpy as np

from tautwave.clock import MonotonicClock
from tautwave.config.keys.devices import Camera
from tautwave.view.camera.v4l2 import Frame, jpeg_of

BAR = 16
"""Of the width: one part is white."""


class Synthetic:
    """A camera that sees the time: the bar's left edge is at the width times the second's share."""

    def __init__(self, camera: Camera) -> None:
        self.width, self.height = camera.width, camera.height
        self._period_ns = round(1e9 / camera.fps)
        self._clock = MonotonicClock()
        self._next_ns = self._clock.now_ns()
        self._number = 0

    def read(self, seconds: float) -> Frame | None:
        """Return the next picture, None if it is later than that."""
        until = self._clock.now_ns() + round(1e9 * seconds)
        self._clock.sleep_until(min(until, self._next_ns))
        if until < self._next_ns:
            return None
        at = self._next_ns
        late = max(0, (time.monotonic_ns() - at) // self._period_ns)
        self._next_ns += (1 + late) * self._period_ns
        self._number += 1 + late
        picture = np.zeros((self.height, self.width, 3), np.uint8)
        left = at % 1_000_000_000 * self.width // 1_000_000_000
        picture[:, left : left + max(1, self.width // BAR)] = 255
        return Frame(at, jpeg_of(picture, "RGB"), self._number - late - 1, False)

    def close(self) -> None:
        """Nothing is open."""
