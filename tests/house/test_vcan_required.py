"""Where vcan is required (`.ci/vcan`), no way of skipping a vcan test ends in success."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

CONFTEST = Path(__file__).parent.parent / "conftest.py"
SKIPS = {
    "by mark": "@pytest.mark.skip(reason='no reason')\ndef test_it(): pass",
    "in its body": "def test_it(): pytest.skip('no reason')",
    "with its module": "pytest.importorskip('no_such_module', reason='no reason')",
}
GOOD = {
    "by mark": "def test_it(): pass",
    "expected to fail": "@pytest.mark.xfail\ndef test_it(): assert False",
}


def run_pytest(folder: Path, body: str, vcan: str) -> tuple[int, str]:
    """Run one module of vcan tests under the conftest of this project."""
    (folder / "vcan").mkdir()
    (folder / "conftest.py").write_text(CONFTEST.read_text())
    (folder / "pytest.ini").write_text("[pytest]\nmarkers = vcan\n")
    module = folder / "vcan" / "test_it.py"
    module.write_text(f"import pytest\npytestmark = pytest.mark.vcan\n{body}\n")
    # the interface is there, as far as the conftest can tell
    (folder / "there.py").write_text(
        "import socket\nsocket.if_nameindex = lambda: [(1, 'vcan0')]\n"
    )
    command = [sys.executable, "-m", "pytest", "-p", "there", "-p", "no:cacheprovider", "-ra"]
    environment = {**os.environ, "TAUTWAVE_VCAN": vcan, "PYTHONPATH": str(folder)}
    environment.pop("PYTEST_ADDOPTS", None)
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    return done.returncode, done.stdout


@pytest.mark.parametrize("how", SKIPS)
def test_a_skip_is_a_failure_where_vcan_is_required(tmp_path: Path, how: str) -> None:
    status, text = run_pytest(tmp_path, SKIPS[how], vcan="required")
    assert status in (1, 2), text
    assert "TAUTWAVE_VCAN=required, but: " in text
    assert "no reason" in text


@pytest.mark.parametrize("how", GOOD)
def test_what_holds_still_holds(tmp_path: Path, how: str) -> None:
    status, text = run_pytest(tmp_path, GOOD[how], vcan="required")
    assert status == 0, text


def test_a_skip_is_a_skip_elsewhere(tmp_path: Path) -> None:
    status, text = run_pytest(tmp_path, SKIPS["by mark"], vcan="")
    assert status == 0, text
    assert "1 skipped" in text
