"""An installation without the package of scenes, for processes and those that they start."""

from __future__ import annotations

import os
from pathlib import Path

PACKAGE = "tautwave_scenes"
BLOCK = f"""
import os, sys

class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] == {PACKAGE!r}:
            with open(os.environ["TAUTWAVE_ASKED"], "a") as file:
                file.write(f"{{sys.argv}}: {{name}}\\n")
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Missing())
"""


def without_scenes(folder: Path) -> tuple[dict[str, str], Path]:
    """Return an environment in which the package cannot be imported, and who asked for it.

    The second is a file with a line for each attempt; it is not there without any.
    """
    path = folder / "without"
    path.mkdir()
    (path / "sitecustomize.py").write_text(BLOCK)
    asked = folder / "asked"
    before = os.environ.get("PYTHONPATH", "")
    found = f"{path}{os.pathsep}{before}" if before else str(path)
    return os.environ | {"PYTHONPATH": found, "TAUTWAVE_ASKED": str(asked)}, asked
