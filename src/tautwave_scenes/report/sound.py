"""The sound of a scene: the force on the device, high-passed, as a WAV file at 44.1 kHz."""

from __future__ import annotations

import io
import math
import wave
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tautwave.files import write_bytes
from tautwave.report.figures.envelope import Floats
from tautwave_scenes.report.view import SceneView
from tautwave_scenes.rig.network import keys_of

if TYPE_CHECKING:
    from tautwave_scenes.report3d.view import View3d

SOUND_HZ = 44_100
PEAK = 0.9
"""Peak level as a share of full scale; the file is normalised, so it has no scale in newtons."""


def output_signal(view: SceneView | View3d) -> Floats:
    """Return the high-passed force on the output port, at the rig's rate [N]."""
    keys = keys_of(view.rig).output
    name = keys.port if keys.port is not None else next(iter(view.efforts))
    return high_pass(view.efforts[name], keys.highpass_hz, view.rig.rate_hz)


def high_pass(signal: Floats, corner_hz: float, rate_hz: float) -> Floats:
    """Return a signal through a second-order Butterworth high-pass, without the initial transient.

    Bilinear transform, prewarped at the corner.
    """
    if not 0.0 < corner_hz < 0.5 * rate_hz:
        return np.zeros_like(signal)
    k = math.tan(math.pi * corner_hz / rate_hz)
    norm = 1.0 / (1.0 + math.sqrt(2.0) * k + k * k)
    a1, a2 = 2.0 * (k * k - 1.0) * norm, (1.0 - math.sqrt(2.0) * k + k * k) * norm
    out = np.empty(len(signal))
    first = float(signal[0]) if len(signal) else 0.0
    x1 = x2 = first
    y1 = y2 = 0.0
    values = signal.tolist()
    for at, x in enumerate(values):
        y = norm * (x - 2.0 * x1 + x2) - a1 * y1 - a2 * y2
        x2, x1, y2, y1 = x1, x, y1, y
        out[at] = y
    return out


def resample(signal: Floats, rate_hz: float, target_hz: float) -> Floats:
    """Return a signal at another rate, band-limited: its spectrum truncated or zero-padded."""
    if rate_hz == target_hz or len(signal) < 2:
        return signal
    count = max(round(len(signal) * target_hz / rate_hz), 2)
    spectrum = np.fft.rfft(signal)
    kept = np.zeros(count // 2 + 1, np.complex128)
    both = min(len(spectrum), len(kept))
    kept[:both] = spectrum[:both]
    return np.asarray(np.fft.irfft(kept, count) * (count / len(signal)))


def write_sound(view: SceneView | View3d, path: Path) -> None:
    """Write output.wav: one channel, 16 bits, 44.1 kHz, normalised."""
    signal = resample(output_signal(view), view.rig.rate_hz, SOUND_HZ)
    peak = float(np.abs(signal).max()) if len(signal) else 0.0
    scaled = signal * (PEAK * 32767.0 / peak) if peak > 0.0 else signal
    made = io.BytesIO()
    with wave.open(made, "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(SOUND_HZ)
        file.writeframes(np.round(scaled).astype("<i2").tobytes())
    write_bytes(path, made.getvalue())  # in one step: a page waits for it
