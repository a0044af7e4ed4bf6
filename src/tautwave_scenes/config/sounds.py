"""WAV files used as forces on masses: reading and checking them.

Read by hand, since the standard library refuses floats and `WAVE_FORMAT_EXTENSIBLE` (until 3.12).
Source: Microsoft and IBM, Multimedia Programming Interface and Data Specifications 1.0, RIFF WAVE;
8 bits are unsigned, everything above signed, little-endian throughout.
"""

from __future__ import annotations

import importlib.util
import struct
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from tautwave.config.inputs.recordings import find_recording
from tautwave.config.text.document import Document, show_path
from tautwave.config.text.yaml12 import KeyPath
from tautwave.errors import ConfigError
from tautwave.reading import digest_of, open_file
from tautwave_scenes.config.keys import SoundForce

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

MAX_SAMPLES = 20_000_000
"""Largest number of samples over all channels; seven minutes of one channel at 44.1 kHz."""

_PCM, _FLOAT, _EXTENSIBLE = 1, 3, 0xFFFE
_NAMES = {2: "ADPCM", 6: "A-law", 7: "mu-law", 0x11: "ADPCM", 0x55: "MP3"}


class Sound(NamedTuple):
    """A sound: samples per second, and samples (frames, channels) in full scales, -1 to 1."""

    rate_hz: int
    samples: npt.NDArray[np.float64]


class _Layout(NamedTuple):
    kind: int
    channels: int
    rate_hz: int
    bits: int


def read_sound(path: Path) -> Sound:
    """Return what a WAV file of 8, 16, 24 or 32 bits PCM, or of 32 or 64 bits float, holds.

    Raises
    ------
    ConfigError
        It is not a WAV file, is truncated, empty or too long, or has another format.
    """
    import numpy as np

    try:
        with open_file(path) as stream:
            raw = stream.read(8 * MAX_SAMPLES + 65536)
    except OSError as err:
        raise ConfigError(f"cannot be read: {err.strerror}") from err
    layout, data = _chunks(raw)
    width = layout.bits // 8
    count = len(data) // width
    count -= count % layout.channels
    if count == 0:
        raise ConfigError("contains no samples")
    if count > MAX_SAMPLES:
        raise ConfigError(
            f"is too long: over {count / layout.channels / layout.rate_hz:.0f} s in "
            f"{layout.channels} channels, and {MAX_SAMPLES} samples are the limit; cut it"
        )
    data = data[: count * width]
    if layout.kind == _FLOAT:
        samples = np.frombuffer(data, f"<f{width}").astype(np.float64)
        if not np.isfinite(samples).all():
            raise ConfigError("holds samples that are NaN or infinite")
    elif width == 1:
        samples = (np.frombuffer(data, np.uint8).astype(np.float64) - 128.0) / 128.0
    elif width == 3:
        # The three bytes become the upper ones of four, which preserves the sign.
        wide = np.zeros((count, 4), np.uint8)
        wide[:, 1:] = np.frombuffer(data, np.uint8).reshape(count, 3)
        samples = wide.view("<i4").ravel().astype(np.float64) / 2147483648.0
    else:
        full = 2.0 ** (layout.bits - 1)
        samples = np.frombuffer(data, f"<i{width}").astype(np.float64) / full
    return Sound(layout.rate_hz, samples.reshape(-1, layout.channels))


def can_resample() -> bool:
    """Return whether the library for resampling sounds is installed."""
    return importlib.util.find_spec("scipy") is not None


def check_sound(document: Document, path: KeyPath, force: SoundForce, rate_hz: float) -> None:
    """Note a sound that is missing or unusable; `path` is the force's."""
    at = (*path, "file")
    existing = find_recording(document, at, force.file)
    if existing is None:
        document.report(
            at,
            f"no such file, {force.file} (relative paths are resolved "
            "against the rig file's directory); "
            f"give another with --set {show_path(at)}=PATH",
        )
        return
    try:
        sound = read_sound(existing)
    except ConfigError as err:
        document.report(at, f"{existing.name} {err}")
        return
    channels = sound.samples.shape[1]
    if force.channel != "mono" and force.channel > channels:
        document.report((*path, "channel"), f"{existing.name} has {channels} (got {force.channel})")
    if sound.rate_hz != rate_hz and not can_resample():
        document.report(
            at,
            f"{existing.name} has {sound.rate_hz} samples per second and the scene {rate_hz:g}; "
            "convert it, or pip install 'tautwave[analysis]', which brings scipy",
        )
    if force.sha256 is not None and force.sha256 != digest_of(existing):
        document.report(
            (*path, "sha256"),
            f"{existing.name} has changed (SHA-256 differs); restore the file, or remove this key",
        )


def complete_sound(document: Document, name: str, force: SoundForce) -> SoundForce:
    """Return a force with the absolute path of its sound, and its hash."""
    existing = find_recording(document, ("scene", "forces", name, "file"), force.file)
    if existing is None:
        return force
    return force.model_copy(update={"file": str(existing), "sha256": digest_of(existing)})


def _chunks(raw: bytes) -> tuple[_Layout, bytes]:
    """Return the layout and the bytes of the samples of a RIFF file."""
    if not raw:
        raise ConfigError("is empty")
    if raw[:4] in (b"RF64", b"RIFX"):
        raise ConfigError(f"is an {raw[:4].decode()} file; save it as plain WAV")
    if raw[:4] != b"RIFF" or raw[8:12] != b"WAVE":
        raise ConfigError("is not a WAV file")
    layout: _Layout | None = None
    at = 12
    while at + 8 <= len(raw):
        name, size = raw[at : at + 4], int.from_bytes(raw[at + 4 : at + 8], "little")
        body = raw[at + 8 : at + 8 + size]
        if name == b"fmt ":
            layout = _layout(body)
        elif name == b"data":
            if layout is None:
                raise ConfigError("is corrupt: its format chunk does not precede its data")
            if size // (layout.bits // 8) <= MAX_SAMPLES and len(body) < size:
                raise ConfigError(
                    f"is truncated: {size} bytes are expected, but only {len(body)} are present"
                )
            return layout, body
        at += 8 + size + size % 2
    raise ConfigError("is corrupt: it has no data" if layout else "is corrupt: it has no format")


def _layout(body: bytes) -> _Layout:
    if len(body) < 16:
        raise ConfigError("is corrupt: its format chunk is truncated")
    kind, channels, rate_hz, _, _, bits = struct.unpack("<HHIIHH", body[:16])
    if kind == _EXTENSIBLE and len(body) >= 26:
        kind = int.from_bytes(body[24:26], "little")
    if kind not in (_PCM, _FLOAT):
        raise ConfigError(
            f"is encoded as {_NAMES.get(kind, f'format {kind}')}; save it as PCM or float"
        )
    if bits not in ((8, 16, 24, 32) if kind == _PCM else (32, 64)):
        word = "bits" if kind == _PCM else "bits of float"
        raise ConfigError(
            f"has {bits} {word}; supported are PCM of 8, 16, 24 or 32 bits and float of 32 or 64"
        )
    if channels == 0 or rate_hz == 0:
        raise ConfigError(f"is corrupt: {channels} channels, {rate_hz} samples per second")
    return _Layout(kind, channels, rate_hz, bits)
