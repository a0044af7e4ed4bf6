"""Sounds as external forces: every format, mistakes, and a run that can be repeated."""

from __future__ import annotations

import contextlib
import io
import json
import math
import struct
import wave
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st

from tautwave.cli import main
from tautwave.config import load_rig, resolved_yaml
from tautwave.config.inputs import sounds
from tautwave.errors import ConfigError
from tautwave.rig.scene.network import keep_sounds, pruned_network, scene_forces
from tautwave.scene.signals import sound_signal

CONFIGS = Path(__file__).parents[2] / "configs"
VALUES = [0.0, 0.5, -0.5, 0.25, -1.0, 0.75]


def wav_bytes(
    samples: list[float],
    bits: int = 16,
    channels: int = 1,
    rate: int = 44_100,
    kind: int = 1,
    *,
    extensible: bool = False,
) -> bytes:
    """Return a WAV file made by hand, so that what reads it is held against something else."""
    if kind == 3:
        data = struct.pack(f"<{len(samples)}{'f' if bits == 32 else 'd'}", *samples)
    else:
        full = 1 << (bits - 1)
        numbers = [max(min(round(value * full), full - 1), -full) for value in samples]
        if bits == 8:
            data = bytes(number + 128 for number in numbers)
        else:
            data = b"".join(n.to_bytes(bits // 8, "little", signed=True) for n in numbers)
    block = channels * bits // 8
    tag = 0xFFFE if extensible else kind
    form = struct.pack("<HHIIHH", tag, channels, rate, rate * block, block, bits)
    if extensible:
        form += struct.pack("<HHIH", 22, bits, 0, kind) + bytes(14)
    odd = b"LIST" + struct.pack("<I", 3) + b"abc\0"  # a chunk of odd length is padded
    body = b"WAVE" + odd + b"fmt " + struct.pack("<I", len(form)) + form
    body += b"data" + struct.pack("<I", len(data)) + data
    return b"RIFF" + struct.pack("<I", len(body)) + body


def rig_with(path: Path, *more: str):
    keys = f"scene.forces.rattle.file={path}"
    return load_rig(CONFIGS / "scene-granular.yaml", [keys, *more])


@pytest.mark.parametrize(("bits", "kind"), [(8, 1), (16, 1), (24, 1), (32, 1), (32, 3), (64, 3)])
@pytest.mark.parametrize("extensible", [False, True])
def test_every_format_gives_the_same_sound(tmp_path, bits, kind, extensible):
    path = tmp_path / "a.wav"
    path.write_bytes(wav_bytes(VALUES, bits, 2, 48_000, kind, extensible=extensible))
    found = sounds.read_sound(path)
    assert found.rate_hz == 48_000
    assert found.samples.ravel().tolist() == VALUES
    assert found.samples.shape == (3, 2)


@given(st.lists(st.integers(-32768, 32767), min_size=2, max_size=50))
@settings(max_examples=40, deadline=None)
def test_what_the_standard_library_writes_is_read(tmp_path_factory, numbers):
    held = io.BytesIO()
    with wave.open(held, "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(8000)
        file.writeframes(np.array(numbers, "<i2").tobytes())
    path = tmp_path_factory.getbasetemp() / "std.wav"
    path.write_bytes(held.getvalue())
    found = sounds.read_sound(path)
    assert (found.samples.ravel() * 32768.0).tolist() == numbers


@given(st.binary(max_size=200), st.integers(0, 60))
@settings(max_examples=100, deadline=None)
def test_no_bytes_raise_anything_but_a_sentence(tmp_path_factory, garbage, cut):
    path = tmp_path_factory.getbasetemp() / "garbage.wav"
    path.write_bytes(wav_bytes(VALUES)[:cut] + garbage)
    with contextlib.suppress(ConfigError):
        assert np.isfinite(sounds.read_sound(path).samples).all()


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"", "s.wav is empty"),
        (b"ID3 and so on, no sound", "s.wav is not a WAV file"),
        (b"RF64" + wav_bytes(VALUES)[4:], "is an RF64 file; save it as plain WAV"),
        (wav_bytes([]), "contains no samples"),
        (wav_bytes(VALUES)[:-4], "truncated: 12 bytes of sound are announced, 8 are there"),
        (wav_bytes(VALUES)[:40], "is corrupt: "),
        (wav_bytes(VALUES, kind=6), "coded as A-law; save it as PCM or float"),
        (wav_bytes(VALUES, bits=16, kind=3)[:20], "is corrupt"),
        (wav_bytes([0.0, math.nan], bits=32, kind=3), "NaN or infinite"),
    ],
)
def test_what_is_wrong_with_a_sound_is_one_sentence_with_its_place(tmp_path, content, sentence):
    path = tmp_path / "s.wav"
    path.write_bytes(content)
    with pytest.raises(ConfigError) as caught:
        rig_with(path)
    (reported,) = caught.value.problems
    assert reported.startswith(f"--set scene.forces.rattle.file={path}: ")
    assert sentence in reported


def test_a_missing_file_a_missing_channel_and_a_long_one(tmp_path, monkeypatch):
    with pytest.raises(ConfigError, match=r"no such file, nowhere\.wav"):
        rig_with(Path("nowhere.wav"))
    path = tmp_path / "s.wav"
    path.write_bytes(wav_bytes(VALUES, channels=2))
    with pytest.raises(ConfigError, match=r"s\.wav has 2 \(got 3\)"):
        rig_with(path, "scene.forces.rattle.channel=3")
    monkeypatch.setattr(sounds, "MOST_SAMPLES", 5)
    with pytest.raises(ConfigError, match="is too long: over 0 s in 2 channels"):
        rig_with(path)


def test_channel_loop_start_and_gain(tmp_path):
    path = tmp_path / "s.wav"
    path.write_bytes(wav_bytes([0.5, -0.25, 0.25, 0.75], channels=2))
    found = sounds.read_sound(path)
    keys = {"amplitude": 2.0, "channel": "mono", "loop": False, "start_s": 0.0}

    def made(cycles=6, **change):
        return sound_signal({**keys, **change}, found.samples, 44_100, 44_100.0, cycles).tolist()

    assert made() == [0.25, 1.0, 0.0, 0.0, 0.0, 0.0]
    assert made(channel=1) == [1.0, 0.5, 0.0, 0.0, 0.0, 0.0]
    assert made(channel=2, loop=True, cycles=5) == [-0.5, 1.5, -0.5, 1.5, -0.5]
    assert made(channel=1, loop=True, start_s=2 / 44_100) == [0.0, 0.0, 1.0, 0.5, 1.0, 0.5]
    assert made(channel=1, start_s=9.0) == [0.0] * 6
    assert made(cycles=1) == [0.25]


def test_another_rate_is_resampled_or_refused(tmp_path, monkeypatch):
    tone = np.sin(2.0 * np.pi * 300.0 * np.arange(4000) / 8000.0)
    path = tmp_path / "tone.wav"
    path.write_bytes(wav_bytes(tone.tolist(), 32, 1, 8000, 3))
    rig = rig_with(path, "scene.forces.rattle.amplitude=1", "scene.forces.rattle.loop=false")
    keys = rig.scene.forces["rattle"].model_dump()
    found = sounds.read_sound(path)
    got = sound_signal(keys, found.samples, found.rate_hz, 44_100.0, 22_050)
    want = np.sin(2.0 * np.pi * 300.0 * np.arange(22_050) / 44_100.0)
    assert np.abs(got - want)[2000:-2000].max() < 2e-3
    monkeypatch.setattr(sounds, "can_resample", lambda: False)
    with pytest.raises(ConfigError, match=r"tone\.wav has 8000 samples per second and the scene"):
        rig_with(path)


def test_a_group_shares_the_sound_and_keeps_its_own_noise():
    rig = load_rig(CONFIGS / "scene-granular.yaml")
    network = pruned_network(rig).network
    with_sound = np.array(scene_forces(rig, network, 3000))
    others = {name: keys for name, keys in rig.scene.forces.items() if name != "rattle"}
    quiet = rig.model_copy(update={"scene": rig.scene.model_copy(update={"forces": others})})
    added = with_sound - np.array(scene_forces(quiet, network, 3000))
    assert np.abs(added).max() > 0.1
    assert np.abs(added - added[0]).max() < 1e-15


def test_a_rig_and_its_sounds_can_go_anywhere(tmp_path):
    original = tmp_path / "s.wav"
    original.write_bytes((CONFIGS / "sounds" / "rattle.wav").read_bytes())
    rig = rig_with(original)
    before, moved = tmp_path / "before", tmp_path / "moved"
    before.mkdir()
    (before / "rig.yaml").write_text(resolved_yaml(keep_sounds(rig, before)))
    original.unlink()
    before.rename(moved)
    again = load_rig(moved / "rig.yaml")
    network = pruned_network(again).network
    forces = scene_forces(again, network, 1000)
    original.write_bytes((moved / "sounds" / "rattle.wav").read_bytes())
    assert forces == scene_forces(rig, network, 1000)
    (moved / "sounds" / "rattle.wav").write_bytes(wav_bytes(VALUES))
    with pytest.raises(ConfigError, match=r"rattle\.sha256: rattle\.wav has changed"):
        load_rig(moved / "rig.yaml")
    original.unlink()
    with pytest.raises(ConfigError, match=r"s\.wav: cannot be read: No such file"):
        scene_forces(rig, network, 1000)


@pytest.mark.long
@pytest.mark.slow  # two reports
def test_a_run_keeps_its_sounds_and_can_be_run_again(tmp_path):
    """The same rows to the bit from the run's own folder, wherever it lies."""
    original = tmp_path / "s.wav"
    original.write_bytes((CONFIGS / "sounds" / "rattle.wav").read_bytes())
    first, again = tmp_path / "first", tmp_path / "again"
    command = ["run", str(CONFIGS / "scene-granular.yaml"), "--clock", "fake", "--duration", "0.02"]
    command += ["--set", f"scene.forces.rattle.file={original}", "--out", str(first)]
    assert CliRunner().invoke(main, command).exit_code == 0
    original.unlink()
    moved = tmp_path / "elsewhere"
    first.rename(moved)
    rig = str(moved / "rig.yaml")
    command = ["run", rig, "--clock", "fake", "--duration", "0.02", "--out", str(again)]
    assert CliRunner().invoke(main, command).exit_code == 0
    energy = [json.loads((out / "summary.json").read_text())["scene"] for out in (moved, again)]
    assert energy[0] == energy[1]
