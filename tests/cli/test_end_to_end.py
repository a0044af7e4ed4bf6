"""The installed command on the shipped rig: files, exit codes, Ctrl-C, and what it imports."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests import commands

RIG = Path(__file__).parents[2] / "configs" / "bench-1dof-loopback.yaml"
LEFT_BEHIND = ("rig.yaml", "summary.json", "recording.mcap", "report.html")
NOT_IN_A_LIVE_RUN = {
    "numba", "scipy", "matplotlib", "can", "canopen", "pymodbus", "dynamixel_sdk",
    "tautwave_drivers", "tautwave.analysis.ports",
    "tautwave.certificate",
}  # fmt: skip
"""What a wall takes of its device's damping is part of an axis' allowance, so `analysis.walls` may
be there: closed forms and integers."""
COMMAND = [sys.executable, "-c", "from tautwave.cli import main; main(prog_name='tautwave')"]
TELLING = """
import sys, atexit, pathlib
atexit.register(lambda: pathlib.Path("modules.txt").write_text(" ".join(sys.modules)))
from tautwave.cli import main; main(prog_name="tautwave")
"""
"""The command, and what it had imported when it ended."""


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    return Path(shutil.copy(RIG, tmp_path / "rig.yaml"))


def tautwave(*words: object, cwd: Path, code: str = COMMAND[2]) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", code, *map(str, words)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)


def assert_complete(directory: Path) -> dict[str, object]:
    for name in LEFT_BEHIND:
        assert (directory / name).stat().st_size > 0, name
    summary = json.loads((directory / "summary.json").read_text())
    assert isinstance(summary, dict)
    return summary


def assert_light(modules: Path) -> None:
    """Neither offline work nor a vendor's library was imported by the process that moves motors."""
    loaded = modules.read_text().split()
    assert "tautwave_sim" in loaded
    heads = {".".join(name.split(".")[:n]) for name in loaded for n in (1, 2, 3)}
    assert not NOT_IN_A_LIVE_RUN & heads


def test_check_of_the_shipped_rig(rig: Path, tmp_path: Path) -> None:
    done = tautwave("check", rig, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "--verbose shows all" in done.stdout
    printed = json.loads(commands.tautwave("check", rig, "--json", cwd=tmp_path).stdout)
    assert printed["certificate"]["passed"] is True
    assert list(tmp_path.iterdir()) == [rig], "check writes nothing"


def test_the_schema_knows_the_rig(tmp_path: Path) -> None:
    schema = json.loads(commands.tautwave("check", "--schema", cwd=tmp_path).stdout)
    assert {"buses", "coupling", "rate_hz"} <= set(schema["properties"])


@pytest.mark.parametrize("command", ["run", "check"])
def test_a_wrong_rig_is_a_sentence_with_its_line(rig: Path, tmp_path: Path, command: str) -> None:
    rig.write_text(rig.read_text() + "\nrate: 5\n")
    line = len(rig.read_text().splitlines())
    done = tautwave(command, rig.name, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith(f"rig.yaml:{line}: rate: ")
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "runs").exists() or not list((tmp_path / "runs").iterdir())


@pytest.mark.slow
def test_ctrl_c_ramps_down_reports_and_exits_0(rig: Path, tmp_path: Path) -> None:
    words = ("run", str(rig), "--duration", "60", "--out", "out", *commands.PATIENT)
    with subprocess.Popen(
        [sys.executable, "-c", TELLING, *words],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as run:
        assert run.stderr is not None
        for line in run.stderr:
            if "running" in line:
                break
        run.send_signal(signal.SIGINT)
        output, errors = run.communicate(timeout=60)
    assert run.returncode == 0, errors
    assert "interrupted" in output
    assert "position rms" in output
    assert "100 %" in errors
    summary = assert_complete(tmp_path / "out")
    assert isinstance(summary["outcome"], dict)
    assert summary["outcome"]["kind"] == "interrupted"
    assert_light(tmp_path / "modules.txt")
    again = tautwave(*words, cwd=tmp_path)
    assert again.returncode == 2
    assert "not empty" in again.stderr
