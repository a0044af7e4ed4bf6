"""`tautwave run --play`: by a player of the system, by the library, or a sentence."""

from __future__ import annotations

import stat
import sys
import types
import wave
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from tautwave.cli import main
from tautwave.cli.run import _played
from tautwave.cli.terminal import play as playing
from tautwave.cli.terminal.play import play_sound
from tautwave_scenes.report import sound
from tautwave_scenes.report.sound import SOUND_HZ, write_sound

CONFIGS = Path(__file__).parents[2] / "configs"
RATTLE = CONFIGS / "sounds" / "rattle.wav"


@pytest.fixture
def players(tmp_path, monkeypatch):
    """Make players by name with a shell script each, the only programs on PATH."""
    folder = tmp_path / "bin"
    folder.mkdir()
    monkeypatch.setenv("PATH", str(folder))
    monkeypatch.setattr(playing.importlib.util, "find_spec", lambda name: None)

    def make(name: str, script: str) -> None:
        player = folder / name
        player.write_text(f"#!/bin/sh\n{script}\n")
        player.chmod(player.stat().st_mode | stat.S_IXUSR)

    return make


def test_a_player_on_the_path_plays_it(players, tmp_path):
    heard = tmp_path / "heard"
    players("aplay", f'echo "$@" > {heard}')
    assert play_sound(RATTLE) == ""
    assert heard.read_text().split() == ["-q", str(RATTLE)]


def test_the_next_player_is_tried_where_one_has_no_device(players, tmp_path):
    heard = tmp_path / "heard"
    players("paplay", "echo Connection refused >&2; exit 1")
    players("aplay", f"echo yes > {heard}")
    assert play_sound(RATTLE) == ""
    assert heard.read_text() == "yes\n"


def test_without_a_device_it_is_one_sentence(players):
    reported = play_sound(RATTLE)
    assert reported.startswith("not played: none of paplay, pw-play, aplay, afplay on PATH")
    assert reported.endswith(f"the sound is in {RATTLE}")
    players("aplay", "echo 'aplay: main: audio open error: No such file' >&2; exit 1")
    reported = play_sound(RATTLE)
    assert "not played: aplay: aplay: main: audio open error: No such file; the sound" in reported
    assert "\n" not in reported


def test_a_player_that_hangs_is_ended(players, monkeypatch):
    players("aplay", "exec /bin/sleep 60")
    monkeypatch.setattr(playing, "PATIENCE_S", -0.4)
    assert "aplay: did not finish within" in play_sound(RATTLE)


def test_the_library_plays_where_no_command_does(players, monkeypatch):
    given = []
    fake = types.ModuleType("sounddevice")
    fake.PortAudioError = type("PortAudioError", (Exception,), {})
    fake.play = lambda samples, rate, blocking: given.append((len(samples), rate, blocking))
    monkeypatch.setitem(sys.modules, "sounddevice", fake)
    monkeypatch.setattr(playing.importlib.util, "find_spec", lambda name: True)
    assert play_sound(RATTLE) == ""
    with wave.open(str(RATTLE)) as file:
        assert given == [(file.getnframes(), file.getframerate(), True)]

    def fail(*_, **__):
        raise fake.PortAudioError("Error querying device -1")

    fake.play = fail
    assert "sounddevice: Error querying device -1; the sound is in" in play_sound(RATTLE)


def test_no_sound_and_a_broken_one(players, tmp_path):
    assert _played(tmp_path) == "not played: this run produced no sound"
    (tmp_path / "output.wav").write_bytes(b"RIFF")
    assert _played(tmp_path).startswith(f"not played: {tmp_path / 'output.wav'} cannot be read")


def test_only_a_scene_can_be_played(tmp_path):
    rig = str(CONFIGS / "bench-1dof-loopback.yaml")
    done = CliRunner().invoke(main, ["run", rig, "--play", "--out", str(tmp_path / "run")])
    assert done.exit_code == 2
    assert "--play: this rig has no scene, so there is no sound to play" in done.output
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(("signal", "peak"), [(np.sin(np.arange(400.0)), 0.9), (np.zeros(9), 0.0)])
def test_a_run_s_sound_is_one_channel_of_16_bits_as_loud_as_it_may_be(
    tmp_path, monkeypatch, signal, peak
):
    monkeypatch.setattr(sound, "output_signal", lambda view: 1e-6 * signal)
    view = types.SimpleNamespace(rig=types.SimpleNamespace(rate_hz=float(SOUND_HZ)))
    path = tmp_path / "output.wav"
    write_sound(view, path)
    with wave.open(str(path)) as file:
        assert file.getparams()[:4] == (1, 2, 44_100, len(signal))
        heard = np.frombuffer(file.readframes(len(signal)), "<i2")
    assert np.abs(heard).max() == pytest.approx(32767 * peak, abs=2)
    assert np.allclose(heard, 32767 * peak * signal / max(np.abs(signal).max(), 1e-9), atol=1.0)


@pytest.mark.slow  # a report
@pytest.mark.nightly
def test_a_run_is_played_after_its_end(tmp_path, monkeypatch):
    player = tmp_path / "paplay"
    player.write_text(f'#!/bin/sh\ncp "$1" {tmp_path}/heard.wav\n')
    player.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    command = ["run", str(CONFIGS / "scene-resonator.yaml"), "--clock", "fake", "--play"]
    command += ["--duration", "0.3", "--out", str(tmp_path / "run")]
    done = CliRunner().invoke(main, command)
    assert done.exit_code == 0, done.output
    assert f"played {tmp_path / 'run' / 'output.wav'}" in done.output
    with wave.open(str(tmp_path / "heard.wav")) as file:
        assert np.frombuffer(file.readframes(file.getnframes()), "<i2").any()
