"""The kernel's virtual camera, in the guest that `vivid.sh` boots: `python -m tests.view.vivid`."""

from __future__ import annotations

import io
import os

import numpy as np
from PIL import Image

from tautwave.config.keys.devices import Camera
from tautwave.view.camera.v4l2 import V4l2

BARS = ["111", "110", "011", "010", "101", "100", "001", "000"]
"""Red, green and blue of its bars, three quarters bright, from left to right."""
PICTURES = 5


def main() -> None:
    """Take pictures in two sizes, and hold times, numbers and colours against what it sends."""
    shown = 191.25 * np.array([[int(one) for one in bar] for bar in BARS])
    for width, height in ((640, 360), (320, 180)):
        camera = V4l2(Camera(width=width, height=height, fps=10))
        taken = [camera.read(30.0) for _ in range(PICTURES)]
        camera.close()
        frames = [one for one in taken if one is not None]
        assert len(frames) == PICTURES, "a picture did not come"
        assert all(one.by_kernel for one in frames)
        numbers, times = [one.number for one in frames], [one.time_ns for one in frames]
        assert numbers == sorted(set(numbers))
        assert times == sorted(set(times))
        picture = np.asarray(Image.open(io.BytesIO(frames[-1].jpeg)).convert("RGB"), float)
        assert picture.shape == (height, width, 3)
        seen = picture[-8, width // 16 :: width // 8]
        assert np.abs(seen - shown).max() < 8.0, seen
        print(
            f"{width} x {height}: {PICTURES} pictures, timed by the kernel, bars in their colours"
        )
    print(f"all of it holds, Linux {os.uname().release}")


if __name__ == "__main__":
    main()
