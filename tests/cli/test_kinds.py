"""A file or directory of the wrong kind is one sentence, in every command that takes one."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from tautwave.cli import main
from tautwave.config.shipped import find_example
from tautwave.errors import ConfigError
from tautwave.kinds import kind_of_keys, mistaken
from tautwave.runtime.operate.commands import read_script

RIG = ("run", "check", "sim", "calibrate", "doctor", "compile")
RUN = ("view", "ros", "report", "export")
FILES = {
    "rig.yaml": "a rig",
    "sweep.yaml": "a sweep",
    "map.yaml": "a sweep",
    "trials.yaml": "a protocol of trials",
    "drive.yaml": "a profile of a drive",
    "rig.calibration.yaml": "a calibration",
    "summary.json": "the summary of a run",
    "scheduler.json": "a scheduler file of Dask",
    "done": "the directory of a run",
    "recording.mcap": "a recording",
    "camera-wrist.mcap": "the pictures of a camera",
    "report.html": "the page of a report",
    "peg": "a LeRobot dataset",
    "swept": "the results of a sweep",
    "bag": "a ROS 2 bag",
    "rows.csv": "a table",
}
MAIN = {"sweep": "a sweep", "trials": "a protocol of trials"}
TAKEN = {
    "export": ("a recording",),
    "identify": (
        "a recording",
        "a table",
        "the directory of a run",
        "a LeRobot dataset",
        "a ROS 2 bag",
    ),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with one of each kind."""
    folder = tmp_path_factory.mktemp("kinds")
    profile = Path(__file__).parents[2] / "drivers/tautwave_drivers/modbus/profiles/generic.yaml"
    texts = {
        "rig.yaml": find_example("bench-1dof-loopback").path.read_text(),
        "sweep.yaml": find_example("sweeps/many-walls").path.read_text(),
        "map.yaml": find_example("sweeps/wall-kb-plane").path.read_text(),
        "trials.yaml": "rig: rig.yaml\nconditions: {near: {}}\ntrial_s: 1.0\n",
        "drive.yaml": profile.read_text(),
        "rig.calibration.yaml": "rig: bench\naxes: {master.lever: {zero: 0.0}}\n",
        "summary.json": json.dumps({"rig": "bench", "outcome": {}, "clock": "fake", "buses": {}}),
        "scheduler.json": json.dumps({"type": "Scheduler", "address": "tcp://127.0.0.1:1"}),
        "done/summary.json": "{}",
        "peg/meta/info.json": "{}",
        "swept/points.csv": "",
        "bag/metadata.yaml": "",
        "report.html": "<!DOCTYPE html>\n",
        "rows.csv": "time_s\n0\n",
    }
    for name, text in texts.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    for name in ("recording.mcap", "camera-wrist.mcap"):
        (folder / name).write_bytes(b"\x89MCAP0\r\n" + b"\0" * 300_000)
    return folder


@pytest.mark.parametrize("command", [*RIG, *RUN, "sweep", "trials", "identify"])
def test_another_kind_is_named_in_one_sentence(
    command: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    wanted = MAIN.get(command, "the directory of a run" if command in RUN else "a rig")
    more = ["--participant", "P"] if command == "trials" else []
    for name, kind in FILES.items():
        if kind == wanted or kind in TAKEN.get(command, ()):
            continue
        done = CliRunner().invoke(main, [command, name, *more])
        assert done.exit_code == 2, (name, done.output)
        (sentence,) = done.output.splitlines()
        if command == "sim" and Path(name).suffix == "":
            continue  # a name without a suffix is a driver
        assert sentence.startswith(f"{name}: {kind}, not {wanted}; "), sentence


def test_what_may_be_anything_is_left_to_its_reader() -> None:
    assert kind_of_keys({"rig": "x.yaml"}) == ""
    assert kind_of_keys({"name": "half a rig", "buses": {}}) == ""
    assert mistaken("a.yaml", "", "a rig") == ""


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (["run", "reach.yaml", "--commands"], "contains no line TIME COMMAND"),
        (["calibrate", "reach.yaml", "--script"], "contains no line SECONDS ANSWER"),
    ],
)
def test_a_script_that_is_none_is_one_sentence(
    words: list[str], part: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    text = (folder / "rig.yaml").read_text()
    (folder / "reach.yaml").write_text(text + "\noperate: {}\n")
    done = CliRunner().invoke(main, [*words, "rig.yaml", "--clock", "fake"])
    assert done.exit_code == 2
    assert done.output.splitlines()[-1].startswith(f"rig.yaml: {part}")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("0.5 engage\n0.7 bogus\n", "keys.txt:2: write TIME COMMAND"),
        ("bogus\n", "keys.txt:1: write TIME COMMAND"),
        (
            "# keys\nfoo\nbar\n",
            "keys.txt: contains no line TIME COMMAND, such as `1.5 engage` (line 2",
        ),
    ],
)
def test_a_wrong_line_of_commands_is_named(text: str, said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        read_script(text, "keys.txt")
    assert str(caught.value).startswith(said)


def test_a_duration_below_a_cycle_is_no_matter_of_the_rig_file(tmp_path: Path) -> None:
    words = ["run", str(find_example("bench-1dof-loopback").path), "--clock", "fake"]
    done = CliRunner().invoke(
        main, [*words, "--duration", "1e-9", "--quiet", "--out", str(tmp_path / "run")]
    )
    assert done.exit_code == 2
    sentence = "a duration of 1e-09 s is shorter than one cycle of 0.001 s"
    assert done.output.splitlines()[-1] == sentence
    assert not (tmp_path / "run").exists()
