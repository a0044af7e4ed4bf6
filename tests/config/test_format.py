"""Rig files and recordings carry a version; one that is newer than this reader is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tautwave import formats
from tautwave.config import load_rig, parse_rig, resolved_yaml
from tautwave.errors import ConfigError, RecordingError
from tautwave.recordings.recording import read_recording
from tautwave.report.run.loading import load_run
from tautwave.runtime.mcap_file import McapFile

BENCH = Path(__file__).parents[2] / "configs" / "bench-1dof-loopback.yaml"
pytestmark = pytest.mark.installed
REMEDY = "pip install --upgrade tautwave"


def test_a_rig_without_a_version_is_of_the_newest() -> None:
    assert "format:" not in BENCH.read_text()
    rig = load_rig(BENCH)
    assert rig.format == 2
    assert resolved_yaml(rig).splitlines()[1] == "format: 2"
    assert parse_rig(resolved_yaml(rig), BENCH) == rig


@pytest.mark.parametrize("version", ["3", "7", "123456789012"])
def test_a_newer_rig_is_refused_with_the_remedy_and_nothing_else(version: str) -> None:
    text = f"format: {version}\n" + BENCH.read_text().replace("name:", "nahme:", 1)
    with pytest.raises(ConfigError) as caught:
        parse_rig(text)
    (problem,) = caught.value.problems
    assert problem.startswith(f"rig.yaml:1: format: {version} is newer than the rig format 2")
    assert REMEDY in problem


POSITION = """\
coupling:
  law: position
  wave_filter_hz: null
  pairs:
    lever: {stiffness: 1, damping: 0.001, drift_time_s: 0.05}
"""


def test_a_resolved_rig_of_version_1_is_read_where_it_means_the_same() -> None:
    text = BENCH.read_text()
    text = text[: text.index("coupling:")] + POSITION + text[text.index("# The truth") :]
    assert parse_rig(f"format: 1\n{text}").format == 2
    with pytest.raises(
        ConfigError, match="drift_time_s: no longer needed: positions on a wave line do not drift"
    ):
        parse_rig(text)


OLD = {
    "coupling.wave_filter_hz": ("  delay_s: 0.02", "  wave_filter_hz: 100\n  delay_s: 0.02"),
    "coupling.pairs.lever.drift_time_s": (
        "      wave_impedance: 0.02",
        "      drift_time_s: 0.05\n      wave_impedance: 0.02",
    ),
    "coupling.law": ("  law: wave", "  law: observed_wave"),
}
REMEDIES = {
    "coupling.wave_filter_hz": "move it to each pair, as coupling.pairs.NAME.wave_filter_hz",
    "coupling.pairs.lever.drift_time_s": "remove it",
    "coupling.law": "write law: wave",
}


@pytest.mark.parametrize("version", ["", "format: 1\n"])
@pytest.mark.parametrize("key", OLD)
def test_a_key_of_version_1_is_refused_with_its_replacement(key: str, version: str) -> None:
    text = version + BENCH.read_text().replace(*OLD[key], 1)
    line = 1 + text[: text.index(OLD[key][1].split("\n")[0])].count("\n")
    with pytest.raises(ConfigError) as caught:
        parse_rig(text)
    (problem,) = caught.value.problems
    assert problem.startswith(f"rig.yaml:{line}: {key}: ")
    assert REMEDIES[key] in problem


def test_a_velocity_filter_is_refused_where_nothing_reads_it() -> None:
    key = "slave.axes.lever.velocity_filter_s=0.002"
    assert parse_rig(BENCH.read_text(), overrides=[key])  # its wall has a damper
    undamped = "coupling.pairs.lever.wall_slave.damping=0"
    with pytest.raises(ConfigError, match=r"not used here: .* see .*pole_slave; remove it"):
        parse_rig(BENCH.read_text(), overrides=[key, undamped])


@pytest.mark.parametrize("version", ["0", "-1", "1.5", "yes", "true", "[1]"])
def test_what_is_no_version_is_a_mistake_like_others(version: str) -> None:
    with pytest.raises(ConfigError, match=r"rig.yaml:1: format: Input should be"):
        parse_rig(f"format: {version}\n{BENCH.read_text()}")


def _record(path: Path) -> None:
    file = McapFile(str(path), ["time_s", "x"], {"rig": "bench"}, {}, 0)
    file.append(np.zeros((3, 3)))
    file.finish({})
    file.close()


def test_a_recording_carries_its_version(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "recording.mcap"
    _record(path)
    assert read_recording(path).metadata["format"] == "1"
    monkeypatch.setattr(formats, "RECORDING", 2)
    _record(path)
    assert read_recording(path).metadata["format"] == "2"
    monkeypatch.setattr(formats, "RECORDING", 1)
    with pytest.raises(RecordingError, match=f"newer than the recording format 1 .*{REMEDY}"):
        read_recording(path)


def test_a_run_of_a_newer_rig_is_not_reported_on(tmp_path: Path) -> None:
    (tmp_path / "rig.yaml").write_text("format: 3\nname: bench\n")
    (tmp_path / "summary.json").write_text("{}")
    with pytest.raises(RecordingError, match=REMEDY):
        load_run(tmp_path)
