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
from tautwave.errors import ConfigError
from tautwave_scenes.config import sounds
from tautwave_scenes.networks.signals import force_signal, sound_signal
from tautwave_scenes.rig.network import keep_sounds, pruned_network, scene_forces
from tests.examples import tried

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
@settings(max_examples=tried(40), deadline=None)
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
@settings(max_examples=tried(100), deadline=None)
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
        (wav_bytes(VALUES)[:-4], "truncated: 12 bytes are expected, but only 8 are present"),
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
    monkeypatch.setattr(sounds, "MAX_SAMPLES", 5)
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


@pytest.mark.nightly
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


def test_a_tone_is_a_sine_from_zero():
    keys = {"type": "sine", "amplitude": 3.0, "frequency_hz": 250.0}
    found = force_signal(keys, 1000.0, 6, (0, 0))
    assert found == pytest.approx([0.0, 3.0, 0.0, -3.0, 0.0, 3.0], abs=1e-14)


@pytest.mark.parametrize(
    ("low", "high", "first", "last"),
    [(100.0, 100.0, 1000, 1000), (99.85, 100.15, 999, 1001), (20.0, 2000.0, 200, 20_000)],
)
def test_noise_has_its_deviation_and_nothing_outside_its_band(low, high, first, last):
    """However narrow: 10 s at 10 kHz have lines 0.1 Hz apart, each a tiny part of white noise."""
    keys = {"type": "noise", "amplitude": 2.5, "low_hz": low, "high_hz": high}
    found = force_signal(keys, 10_000.0, 100_000, (1, 2))
    assert np.sqrt(np.mean(found**2)) == pytest.approx(2.5, rel=1e-12)
    lines = np.abs(np.fft.rfft(found))
    assert np.flatnonzero(lines > 1e-6 * lines.max()).tolist() == list(range(first, last + 1))
    assert force_signal(keys, 10_000.0, 100_000, (1, 2)).tolist() == found.tolist()
    assert np.abs(force_signal(keys, 10_000.0, 100_000, (1, 3)) - found).max() > 0.1


def test_noise_between_two_lines_of_a_short_run_is_silence():
    keys = {"type": "noise", "amplitude": 2.5, "low_hz": 101.0, "high_hz": 109.0}
    assert force_signal(keys, 1000.0, 100, (1, 2)).tolist() == [0.0] * 100


def test_taps_are_half_sines_of_their_length_between_a_fifth_and_all_of_the_amplitude():
    keys = {"type": "taps", "amplitude": 2.0, "per_second": 0.4, "length_s": 0.004}
    found = force_signal(keys, 1000.0, 1_000_000, (1, 2))
    shape = np.sin(np.pi * np.array([0.125, 0.375, 0.625, 0.875]))
    pushed = np.flatnonzero(found)
    starts = pushed[np.diff(pushed, prepend=-2) > 1]
    assert len(pushed) == 4 * len(starts)  # none over another here
    taps = found[starts[:, None] + np.arange(4)]
    heights = taps[:, 1] / shape[1]
    assert taps == pytest.approx(heights[:, None] * shape, rel=1e-12)
    assert 0.4 <= heights.min() < 0.42
    assert 1.98 < heights.max() <= 2.0
    assert len(starts) == pytest.approx(400, abs=40)  # two deviations
    short = force_signal({**keys, "length_s": 1e-5}, 1000.0, 1_000_000, (1, 2))
    assert np.flatnonzero(short).tolist() == starts.tolist()  # a sample at least
    assert short[starts] == pytest.approx(heights, rel=1e-12)


def test_taps_at_once_add_up_and_the_last_is_cut_off():
    keys = {"type": "taps", "amplitude": 1.0, "per_second": 100.0, "length_s": 3.0}
    # Some 100 begin at 0 and as many at 1 s, of 0.6 in the mean, with samples 0.5, 1, 0.5.
    assert force_signal(keys, 1.0, 2, (1, 2)) == pytest.approx([30.0, 90.0], rel=0.1)
