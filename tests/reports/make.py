"""Make the three files of our own simulators: `python -m tests.reports.make [FOLDER]`."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import yaml
from click.testing import CliRunner

from tautwave.cli import main
from tests.rigs.running import Tree
from tests.rigs.test_modbus_rows import one_rate_tree

HERE = Path(__file__).parent
CONFIGS = HERE.parents[1] / "configs"


def shipped(name: str) -> Tree:
    data: Tree = yaml.safe_load((CONFIGS / f"{name}.yaml").read_text())
    return data


def old_servo() -> Tree:
    """A servo of firmware without a bus watchdog."""
    data = shipped("bench-dynamixel-sim")
    data["buses"]["servos"]["options"]["simulator"] = {"servos": {1: {"firmware": 37}}}
    return data


def modbus() -> Tree:
    data = one_rate_tree("generic")
    data["rate_hz"] = 100
    return data


WALKS: dict[str, tuple[Tree, str, str, tuple[str, ...]]] = {
    "simulated-canopen": (shipped("bench-canopen-virtual"), "identity,motion", "0.1\n0.1\n", ()),
    # Turned by half a radian, and said to have been turned by 15 degrees: a scale twice too large.
    "simulated-dynamixel-scale": (
        old_servo(), "identity,hand", "0.1\n3.0 15\n", ("--allow-unwatched",)
    ),
    "simulated-modbus": (modbus(), "identity,motion", "0.1\n0.1\n", ()),
}  # fmt: skip


def make(name: str, folder: Path) -> Path:
    """Walk with a rig on the fake clock, and write its file."""
    data, stages, answers, options = WALKS[name]
    target = folder / f"{name}.json"
    target.unlink(missing_ok=True)
    with tempfile.TemporaryDirectory() as text:
        work = Path(text)
        (work / "rig.yaml").write_text(yaml.safe_dump(data))
        (work / "answers.txt").write_text(answers)
        words = ["accept", str(work / "rig.yaml"), "--by", "tests", "--clock", "fake", *options]
        side = "master" if "hand" in stages else "slave"
        axis = next(iter(data[side]["axes"]))
        words += ["--script", str(work / "answers.txt"), "--out", str(work / "out")]
        words += ["--axis", f"{side}.{axis}", "--stages", stages, "--share", str(target)]
        done = CliRunner().invoke(main, words)
    if not target.is_file():
        raise RuntimeError(done.output)
    return target


if __name__ == "__main__":
    for each in WALKS:
        print(make(each, Path(sys.argv[1]) if len(sys.argv) > 1 else HERE))
