"""Frames of an animation, drawn with Pillow: size, length, colours, and a GIF of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from tautwave.canvas import DARK
from tautwave.files import create, writing

Colours = Mapping[str, str]
LIGHT: Colours = {colour: colour for colour in DARK}
OVER = 2
"""Drawn so many times as large, then scaled down: smooth edges."""
FRAMES = 90
FRAME_MS = 50


def ground(dark: bool) -> Colours:
    """Return each colour of the palette for a light or dark background."""
    return DARK if dark else LIGHT


def save_frames(drawn: Sequence[Image.Image], path: Path) -> None:
    """Write frames as a GIF with one palette."""
    small = [image.reduce(OVER) for image in drawn]
    palette, plain = _palette(small), Image.Dither.NONE
    images = [image.quantize(palette=palette, dither=plain) for image in small]
    with writing(path), open(create(path), "wb") as file:
        images[0].save(
            file, "GIF", save_all=True, append_images=images[1:], duration=FRAME_MS, loop=0
        )


def _palette(drawn: Sequence[Image.Image]) -> Image.Image:
    """Return the colours of a few frames; all frames show the same objects."""
    some = drawn[:: max(1, len(drawn) // 4)]
    wide, tall = drawn[0].size
    strip = Image.new("RGB", (wide, tall * len(some)))
    for at, image in enumerate(some):
        strip.paste(image, (0, tall * at))
    colours = np.array(strip.quantize(32, dither=Image.Dither.NONE).getpalette()).reshape(-1, 3)
    colours[colours.min(axis=1) > 244] = 255  # the mean of white and next to white
    palette = Image.new("P", (1, 1))
    palette.putpalette(colours.ravel().tolist())
    return palette
