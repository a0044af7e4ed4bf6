"""Where vcan or all libraries are required (`.ci/`), no way of skipping ends in success."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

CONFTEST = Path(__file__).parent.parent / "conftest.py"
SKIPS = {
    "by_mark": "@pytest.mark.skip(reason='no reason')\ndef test_it(): pass",
    "in_its_body": "def test_it(): pytest.skip('no reason')",
    "with_its_module": "pytest.importorskip('no_such_module', reason='no reason')",
}
GOOD = {
    "good": "def test_it(): pass",
    "expected_to_fail": "@pytest.mark.xfail\ndef test_it(): assert False",
}


def run_pytest(
    folder: Path, bodies: dict[str, str], vcan: str, libraries: str = ""
) -> tuple[int, str]:
    """Run modules of vcan tests under the conftest of this project."""
    (folder / "vcan").mkdir()
    (folder / "conftest.py").write_text(CONFTEST.read_text())
    (folder / "pytest.ini").write_text("[pytest]\nmarkers = vcan\n")
    for name, body in bodies.items():
        module = folder / "vcan" / f"test_{name}.py"
        module.write_text(f"import pytest\npytestmark = pytest.mark.vcan\n{body}\n")
    # the interface is there, as far as the conftest can tell
    (folder / "there.py").write_text(
        "import socket\nsocket.if_nameindex = lambda: [(1, 'vcan0')]\n"
    )
    command = [
        *(sys.executable, "-m", "pytest", "-p", "there", "-p", "no:cacheprovider", "-ra"),
        "--continue-on-collection-errors",
    ]
    required = {"TAUTWAVE_VCAN": vcan, "TAUTWAVE_LIBRARIES": libraries}
    path = f"{folder}{os.pathsep}{CONFTEST.parents[1]}"  # the conftest imports from tests
    environment = {**os.environ, **required, "PYTHONPATH": path}
    for name in ("PYTEST_ADDOPTS", "CI", "BUILD_NUMBER"):  # CI's summaries repeat whole messages
        environment.pop(name, None)
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    return done.returncode, done.stdout


@pytest.mark.slow
def test_a_skip_is_a_failure_where_vcan_is_required(tmp_path: Path) -> None:
    status, text = run_pytest(tmp_path, {**SKIPS, **GOOD}, vcan="required")
    assert status == 1, text
    ends = text[text.index("short test summary info") :]
    assert "ERROR vcan/test_by_mark.py::test_it - TAUTWAVE_VCAN=required, but: " in ends
    assert "FAILED vcan/test_in_its_body.py::test_it - TAUTWAVE_VCAN=required, but: " in ends
    assert "ERROR vcan/test_with_its_module.py - TAUTWAVE_VCAN=required, but: " in ends
    assert text.count("no reason") >= 3
    # what holds still holds
    assert "1 failed, 1 passed, 1 xfailed, 2 errors" in ends
    assert "skipped" not in ends


@pytest.mark.slow
def test_a_missing_library_is_a_failure_where_all_are_required(tmp_path: Path) -> None:
    missing = {
        "library_in_its_body": "def test_it(): pytest.importorskip('no_such_module')",
        "library_with_its_module": "pytest.importorskip('no_such_module')",
    }
    status, text = run_pytest(tmp_path, {**SKIPS, **missing}, vcan="", libraries="required")
    assert status == 1, text
    assert text.count("TAUTWAVE_LIBRARIES=required, but: Skipped: could not import") == 2
    # a skip for any other reason is a skip
    assert "1 failed, 3 skipped, 1 error" in text, text
