"""Play the sound of a run afterwards, if there is a player."""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import shutil
import subprocess
import wave
from pathlib import Path
from typing import Any

PLAYERS = (("paplay",), ("pw-play",), ("aplay", "-q"), ("afplay",))
"""Commands of the system, tried in this order; then the library sounddevice, if installed."""
PATIENCE_S = 10.0
"""Time limit of a player beyond the length of its sound [s]."""


def play_sound(path: Path) -> str:
    """Play a WAV file to its end; return "" or, in a sentence, why it was not played.

    Ctrl-C ends only the sound.
    """
    try:
        seconds = _length(path)
    except (OSError, EOFError, wave.Error) as err:
        return f"not played: {path} cannot be read ({err})"
    reasons = []
    with contextlib.suppress(KeyboardInterrupt):
        for command in PLAYERS:
            player = shutil.which(command[0])
            if player is None:
                continue
            why_not = _run([player, *command[1:], str(path)], seconds + PATIENCE_S)
            if not why_not:
                return ""
            reasons.append(f"{command[0]}: {why_not}")
        if importlib.util.find_spec("sounddevice") is not None:
            why_not = _by_library(path)
            if not why_not:
                return ""
            reasons.append(f"sounddevice: {why_not}")
        if reasons:
            return f"not played: {'; '.join(reasons)}; the sound is in {path}"
        names = ", ".join(command[0] for command in PLAYERS)
        return (
            f"not played: none of {names} on PATH, and the Python package "
            "sounddevice is not installed; "
            f"the sound is in {path}"
        )
    return ""


def _length(path: Path) -> float:
    with wave.open(str(path), "rb") as file:
        return file.getnframes() / file.getframerate()


def _run(command: list[str], timeout_s: float) -> str:
    """Return why a player failed, "" if it did not."""
    try:
        done = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=timeout_s,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"did not finish within {timeout_s:.0f} s"
    except OSError as err:
        return str(err.strerror)
    if done.returncode == 0:
        return ""
    errors = done.stderr.strip().splitlines()
    return errors[0] if errors else f"exit code {done.returncode}"


def _by_library(path: Path) -> str:
    import numpy as np

    try:
        device: Any = importlib.import_module("sounddevice")
    except (ImportError, OSError) as err:  # the library is there, PortAudio is not
        return " ".join(str(err).split())
    with wave.open(str(path), "rb") as file:
        samples = np.frombuffer(file.readframes(file.getnframes()), "<i2")
        rate_hz = file.getframerate()
    try:
        device.play(samples, rate_hz, blocking=True)
    except (ValueError, device.PortAudioError) as err:
        return " ".join(str(err).split()) or type(err).__name__
    return ""
