"""The process that reports a run reads what the run left once, and writes its summary once."""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

from tautwave.errors import ConfigError
from tautwave.report.__main__ import main
from tests.report.synthetic import Columns, make_run

COUNTING = """
import json, os, sys
opened = []
def hear(event, values):
    if event == "open" and isinstance(values[0], str):
        writes = values[2] & (os.O_WRONLY | os.O_RDWR)
        opened.append(("write " if writes else "read ") + os.path.basename(values[0]))
sys.addaudithook(hear)
from tautwave.report.run import parts
parts.svg = lambda *_: '<svg xmlns="http://www.w3.org/2000/svg"><title>empty</title></svg>'
from tautwave.report.__main__ import main
code = main()
print(json.dumps(opened))
sys.exit(code)
"""


@pytest.mark.slow
def test_a_run_is_loaded_once_and_its_summary_written_once(
    tmp_path: Path, columns: Columns
) -> None:
    make_run(tmp_path, columns=columns)
    done = subprocess.run(
        [sys.executable, "-c", COUNTING, tmp_path], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    opened = Counter(json.loads(done.stdout.splitlines()[-1]))
    assert opened["read rig.yaml"] == 1
    assert opened["read summary.json"] == 1
    assert opened["write summary.json.part"] == 1
    assert opened["read recording.mcap"] == 2  # what it holds, and all of it
    assert json.loads((tmp_path / "summary.json").read_text())["certificate"]["after_run"]


def test_a_directory_without_a_run_is_one_sentence_and_an_exit_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["tautwave.report", str(tmp_path)])
    assert main() == ConfigError.exit_code
    [sentence] = capsys.readouterr().err.splitlines()
    assert str(tmp_path) in sentence
