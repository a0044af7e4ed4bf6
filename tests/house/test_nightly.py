"""What nightly runs is there: it would be missed a night later only."""

from __future__ import annotations

import importlib.util
import re
import subprocess
from pathlib import Path

from tests.lab.__main__ import lab

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / ".ci" / "nightly"


def test_nightly_is_a_script_whose_programs_and_tests_are_there() -> None:
    subprocess.run(["bash", "-n", str(SCRIPT)], check=True)
    text = SCRIPT.read_text()
    modules = re.findall(r'"\$python" -m ([\w.]+)', text)
    assert {"tests.lab", "pytest", "tests.drivers.canopen.public_files"} <= set(modules)
    for name in modules:
        assert importlib.util.find_spec(name) is not None, name
    files = re.findall(r"\btests/[\w/]+\.py", text)
    assert files
    for name in files:
        assert (ROOT / name).is_file(), name


def test_each_option_that_nightly_gives_is_taken() -> None:
    for line in re.findall(r"-m tests\.lab (.*)", SCRIPT.read_text()):
        name, *words = line.split()
        taken = {one for each in lab.commands[name].params for one in each.opts}
        assert {word for word in words if word.startswith("--")} <= taken, line
