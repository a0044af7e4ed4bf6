"""The pages on adding parts work as they stand: their blocks, run from top to bottom."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"


def follow(page: Path, folder: Path) -> subprocess.CompletedProcess[str]:
    """Save all blocks of a page as one file, and run the suite that they make."""
    blocks = re.findall(r"```python\n(.*?)```", page.read_text(), re.DOTALL)
    assert len(blocks) > 1
    (folder / "test_page.py").write_text("\n".join(blocks))
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_page.py"]
    command += ["-k", "not compiled"]  # half a minute for what the example package shows
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.slow
@pytest.mark.parametrize("page", ["add-a-driver", "add-a-coupling"])
def test_who_follows_the_page_has_a_suite_that_passes(page: str, tmp_path: Path) -> None:
    done = follow(DOCS / f"{page}.md", tmp_path)
    assert done.returncode == 0, done.stdout
    assert " passed" in done.stdout
    assert "failed" not in done.stdout


@pytest.mark.slow
def test_the_driver_of_the_page_is_checked_in_its_rig_and_opens_nothing_before(
    tmp_path: Path,
) -> None:
    page = (DOCS / "add-a-driver.md").read_text()
    blocks = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    (tmp_path / "my_driver.py").write_text("\n".join(blocks[:2]))
    installed = tmp_path / "my_driver-0.1.dist-info"
    installed.mkdir()
    (installed / "METADATA").write_text("Metadata-Version: 2.1\nName: my-driver\nVersion: 0.1\n")
    (installed / "entry_points.txt").write_text("[tautwave.drivers]\nmybus = my_driver:plugin\n")
    found = re.search(r"```yaml\n(.*?)```", page, re.DOTALL)
    assert found is not None
    (tmp_path / "rig.yaml").write_text(found[1])
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}

    def tautwave(*words: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-c", "from tautwave.cli import main; main()", *words]
        return subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )

    checked = tautwave("check", "rig.yaml", "--verbose")
    assert (checked.returncode, checked.stderr) == (0, "")
    assert "2 axes x 21 bytes at 1 Mbaud" in checked.stdout
    ran = tautwave("run", "rig.yaml")
    assert ran.returncode == 5
    assert "/dev/ttyUSB0: open it here" in ran.stderr
